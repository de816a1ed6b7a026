"""The controller core: observations in, commands and decisions out, no clock of its own.

Contract for whoever drives it:

* hand every observation to :meth:`Controller.receive` with the monotonic time ``now``;
* call :meth:`Controller.tick` when :meth:`Controller.next_tick` has come;
* after either, send what :meth:`Controller.commands` drains and record what
  :meth:`Controller.decisions` drains.

The same observations at the same times give the same commands, byte for byte.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from swarmctl.commands import Command
from swarmctl.decisions import Decision, HealthChanged, MissionEnded, Notice, PhaseChanged, Plan
from swarmctl.estimation.integrity.health import sentence
from swarmctl.events import (
    ArrivalTime,
    CommandOutcome,
    FeedConnection,
    InputRejected,
    LinkConnection,
    Observation,
    OperatorRequest,
    RangeDifferences,
    StatusText,
    VehicleObservation,
    VehiclePosition,
)
from swarmctl.mission.custody import Custody
from swarmctl.mission.emitter_tracking import EmitterTracking
from swarmctl.mission.estimate_trust import EstimateTrust, Trust
from swarmctl.mission.failure import Failure
from swarmctl.mission.fleet import Fleet, VehicleState
from swarmctl.mission.in_flight_checks import InFlightChecks
from swarmctl.mission.landing import Landing
from swarmctl.mission.launch import Launch
from swarmctl.mission.loss_detection import LossDetection
from swarmctl.mission.lost_vehicles import LostVehicles
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.phases import FLYING_FORMATION, Phase, Trigger, can, next_phase
from swarmctl.mission.planner import PlannedMotion, Planner
from swarmctl.mission.preflight import Preflight
from swarmctl.mission.setpoints import measured_slots, setpoint_commands
from swarmctl.mission.target import Target
from swarmctl.results import MissionResult

PERIOD_S = 0.1
"""Control period, s."""
FORMED_M = 3.0
"""A follower counts as in its slot within this distance, m."""
HOME_M = 3.0
"""A vehicle counts as above its launch point within this horizontal distance, m."""


class Controller:
    """Flies one mission.

    Args:
        mission: The mission.
        now: Controller's monotonic time, s.
        hiccup_s: Silence that this computer may be to blame for (a busy processor delays
            what vehicles say), in the controller's seconds; it is granted to every sender.
        shadow: The commands are not carried out: others fly the vehicles, or they stand on
            the ground. The plan starts where they are and then goes on by itself, up to where
            the swarm would be brought home.

    Raises:
        FormationError: If the formation does not fit the mission's limits.
    """

    def __init__(
        self, mission: Mission, now: float, hiccup_s: float = 0.0, *, shadow: bool = False
    ) -> None:
        self.mission = mission
        self._shadow = shadow
        self.frame = mission.frame
        self.fleet = Fleet(
            self.frame,
            {v.sysid: VehicleState(v.sysid, v.altitude_amsl_m) for v in mission.swarm.vehicles},
        )
        self.tracking = EmitterTracking(mission, hiccup_s)
        self._trust = EstimateTrust(self.tracking.target)
        self.planner = Planner(mission)
        self.phase = Phase.WAITING
        self.plan: Plan | None = None
        self.started_s = now
        self._losses = LossDetection(hiccup_s)
        self._checks = InFlightChecks(mission, self._losses, hiccup_s)
        self._lost = LostVehicles(mission, self.fleet, self.planner, self._losses)
        self._phase_since = now
        self._next_tick = now
        self._last_tick = now
        self._preflight = Preflight(mission, self.fleet, now, hiccup_s, shadow=shadow)
        self._launch: Launch | None = None
        self._landing: Landing | None = None
        self._custody = Custody(self.fleet)
        self._broken_off_on_ground: Trigger | None = None
        self._planned: PlannedMotion | None = None
        self._worst_error_m = 0.0
        self._is_track_doubted = False
        self._result = (MissionResult.NOT_LOCATED, "")
        self._commands: list[Command] = []
        self._decisions: list[Decision] = []
        self._notices: set[str] = set()
        self._enter(Phase.WAITING, "start", "waiting for the vehicles", now)

    # --- In and out ------------------------------------------------------------------

    def receive(self, event: Observation, now: float) -> None:
        """Take one observation."""
        match event:
            case VehicleObservation():
                self.fleet.observe(event)
                self._receive_vehicle(event, now)
            case RangeDifferences():
                self.tracking.range_differences(event)
                self._estimate(now)
            case ArrivalTime():
                self.tracking.arrival(event)  # in use once its burst is whole: at a tick
            case OperatorRequest():
                self._break_off(
                    Trigger.CALLED_HOME,
                    MissionResult.CANCELLED,
                    "the operator asked for the return home",
                    now,
                )
            case FeedConnection(connected=connected):
                text = "the broker is back" if connected else "the broker is lost; reconnecting"
                self._say(now, "warning", text, once=False)
            case LinkConnection():
                text = "is back" if event.connected else "is lost; reconnecting"
                self._say(now, "warning", f"the link {event.url} {text}", once=False)
            case InputRejected():
                self._say(now, "warning", f"{event.source}: {event.detail}")

    def tick(self, now: float) -> None:
        """Run one control period; call it when :meth:`next_tick` has come."""
        dt = min(now - self._last_tick, 3.0 * PERIOD_S)
        self._last_tick = now
        # A late caller does not make up for lost periods in a burst.
        self._next_tick = max(self._next_tick + PERIOD_S, now)
        self._estimate(now)
        for complaint in self.tracking.complaints():
            self._say(now, "warning", complaint)
        match self.phase:
            case Phase.WAITING | Phase.CHECKING:
                self._prepare(now)
            case Phase.LAUNCHING:
                self._go_up(now)
            case Phase.LANDING:
                self._come_down(now)
            case Phase.ENDED:
                pass
            case _:
                self._fly(now, dt)

    def next_tick(self) -> float:
        """When :meth:`tick` is due, controller's time, s."""
        return self._next_tick

    def commands(self) -> list[Command]:
        """Drain the commands to send."""
        drained, self._commands = self._commands, []
        return drained

    def decisions(self) -> list[Decision]:
        """Drain the decisions to record and show."""
        drained, self._decisions = self._decisions, []
        return drained

    @property
    def ended(self) -> bool:
        """Whether the mission is over."""
        return self.phase is Phase.ENDED

    @property
    def result(self) -> tuple[MissionResult, str]:
        """How the mission ends as far as is known, and one sentence; empty while it is unknown."""
        return self._result

    @property
    def unrestored_parameters(self) -> list[str]:
        """Parameters of vehicles that were set for the flight and are not restored, in words."""
        return self._preflight.failsafes.left_behind()

    def progress(self, now: float) -> str:
        """How far the phase is, in words."""
        vehicles = self.fleet.vehicles.values()
        match self.phase:
            case Phase.WAITING:
                return f"{self._preflight.heard} of {len(vehicles)} vehicles heard"
            case Phase.CHECKING:
                return f"{self._preflight.ready} of {len(vehicles)} vehicles ready"
            case Phase.LAUNCHING if self._launch is not None:
                return f"{self._launch.at_altitude} of {len(vehicles)} vehicles at altitude"
            case Phase.FORMING:
                return f"worst slot error {self._worst_error_m:.0f} m"
            case phase if phase in FLYING_FORMATION and self._trust.level is Trust.NONE:
                return "holding until the emitter is found again"
            case Phase.APPROACHING:
                return f"{self.planner.to_orbit_m(self.tracking.target):.0f} m to the orbit"
            case Phase.ORBITING:
                done = now - self._phase_since
                return f"{done:.0f} of {self.mission.goal.orbit_s:.0f} s observed"
            case Phase.RETURNING:
                return f"{max(self._home_distances(), default=0.0):.0f} m to the launch points"
            case Phase.LANDING:
                down = sum(not v.is_armed for v in vehicles)
                return f"{down} of {len(vehicles)} vehicles disarmed"
            case _:
                return self._result[1]

    # --- Phases ----------------------------------------------------------------------

    def _enter(self, phase: Phase, trigger: str, reason: str, now: float) -> None:
        self.phase = phase
        self._phase_since = now
        self._decisions.append(
            PhaseChanged(at_s=now, phase=str(phase), trigger=trigger, reason=reason)
        )

    def _move(self, trigger: Trigger, reason: str, now: float) -> None:
        self._enter(next_phase(self.phase, trigger), str(trigger), reason, now)

    def _fail(self, failure: Failure, now: float) -> None:
        self._break_off(Trigger.FAILED, failure.result, failure.detail, now)

    def _break_off(self, trigger: Trigger, result: MissionResult, detail: str, now: float) -> None:
        """End the mission early: on the ground at once, in the air by way of the return."""
        if not can(self.phase, trigger):
            self._say(now, "warning", f"{detail} (already {self.phase})")
            return
        if self._broken_off_on_ground is not None:
            return
        self._result = (result, detail)
        airborne = self.phase not in {Phase.WAITING, Phase.CHECKING}
        action = "bringing the swarm home" if airborne else "nothing has left the ground"
        self._say(now, "error", f"{detail}; {action}")
        if not airborne:
            self._broken_off_on_ground = trigger
            self._prepare(now)
            return
        if self.phase not in FLYING_FORMATION:
            self._begin_plan(now)
        self._move(trigger, detail, now)

    def _restored(self, now: float) -> bool:
        """Give the vehicles their own parameters back; whether that has come to its end."""
        failsafes = self._preflight.failsafes
        self._commands += failsafes.restore(now)
        if not failsafes.is_restored(now):
            return False
        for text in failsafes.left_behind():
            self._say(now, "error", f"could not restore {text}: set it back yourself")
        return True

    def _end(self, now: float) -> None:
        lost = next(iter(self._lost.failures.values()), None)
        if lost is not None and self._result[0] is MissionResult.LOCATED:
            # Found what was looked for, but not everyone is home.
            self._result = (lost.result, f"{self._result[1]}, but {lost.detail}")
        self._decisions.append(
            MissionEnded(at_s=now, result=self._result[0], detail=self._result[1])
        )

    def _prepare(self, now: float) -> None:
        preflight = self._preflight
        if self._broken_off_on_ground is not None:
            if self._restored(now):
                self._move(self._broken_off_on_ground, self._result[1], now)
                self._end(now)
            return
        self._commands += preflight.step(now)
        if preflight.failure is not None:
            self._fail(preflight.failure, now)
        elif self.phase is Phase.WAITING and preflight.all_heard:
            self._move(Trigger.HEARD, "every vehicle answers", now)
        elif self.phase is Phase.CHECKING and preflight.complete:
            for text in preflight.warnings():
                self._say(now, "warning", text)
            self._launch = Launch(list(self.fleet.vehicles.values()), now)
            self._move(Trigger.CHECKED, "every vehicle is ready", now)

    def _go_up(self, now: float) -> None:
        if self._launch is None:
            return
        self._commands += self._launch.rehearsal() if self._shadow else self._launch.step(now)
        failure = self._launch.failure or self._checks.vehicle_failure(self.fleet, (), False, now)
        if failure is not None:
            self._fail(failure, now)
        elif self._launch.complete or self._shadow:
            self._begin_plan(now)
            self._move(Trigger.AIRBORNE, "every vehicle is at its altitude", now)

    def _begin_plan(self, now: float) -> None:
        utc = self.fleet.utc(now)
        positions = np.zeros((len(self.fleet.vehicles), 2))
        for i, vehicle in enumerate(self.fleet.vehicles.values()):
            here = vehicle.position_at(utc) if utc is not None else None
            if here is not None:
                positions[i] = here[:2]
        self.planner.begin(positions, self._aim(utc))

    def _aim(self, utc: float | None) -> Target:
        """The estimate of now, as far as guidance may rely on it."""
        tracking = self.tracking
        tracking.predict(utc)
        self._trust.review(tracking.target, tracking.verdict.status, restarted=tracking.restarted)
        return self._trust.target

    def _fly(self, now: float, dt: float) -> None:
        utc = self.fleet.utc(now)
        target = self._aim(utc)
        launch = np.array([v.launch_enu for v in self.fleet.vehicles.values()])[:, :2]
        planned = self.planner.step(
            self.phase, target, self._worst_error_m, launch, dt, self._trust.level
        )
        self._planned = planned
        self._command(planned)
        self.plan = self._compare(planned, utc, now)
        self._decisions.append(self.plan)
        if planned.broken:
            self._say(now, "warning", f"held the plan: it had {planned.broken[0]}")
        self._release_taken_over(now)
        if self.phase is Phase.RETURNING:
            if self._shadow or all(distance < HOME_M for distance in self._home_distances()):
                vehicles = () if self._shadow else self.fleet.vehicles.values()
                flying = [v for v in vehicles if v.sysid not in self._custody.released]
                self._landing = Landing(flying, self._losses, now)
                reason = (
                    "nobody is brought home"
                    if self._shadow
                    else "every vehicle is above its launch point"
                )
                self._move(Trigger.HOME, reason, now)
            return
        for rejoined in self._lost.take_in_again(utc, now, self._is_ours):
            self._say(now, "warning", rejoined, once=False)
        excused = self._custody.released | self._lost.failures.keys()
        failure = self._checks.vehicle_failure(self.fleet, excused, not self._shadow, now)
        loss = None
        if failure is not None:
            loss = self._lost.do_without(
                failure,
                self.phase,
                target,
                rereferences=self.tracking.rereferences,
            )
        if loss is not None:
            self.tracking.leader = self._lost.reference
            self._say(now, "error", loss, once=False)
            return
        failure = failure or self._checks.observation_failure(
            self.phase, bool(planned.broken), self.tracking.last_used_s, self.started_s, now
        )
        if failure is not None:
            self._fail(failure, now)
        elif self._trust.level is not Trust.NONE:
            self._advance(target, now)

    def _advance(self, target: Target, now: float) -> None:
        goal = self.mission.goal
        if self.phase is Phase.FORMING and self._worst_error_m < FORMED_M:
            self._move(Trigger.FORMED, "every follower is in its slot", now)
        elif self.phase is Phase.APPROACHING and self.planner.at_radius(target):
            self._move(Trigger.AT_RADIUS, "the stand-off circle is reached", now)
        elif (
            self.phase is Phase.ORBITING
            and now - self._phase_since >= goal.orbit_s
            and target.sigma_m <= goal.sigma_m
        ):
            detail = f"the emitter is located to {target.sigma_m:.1f} m (1 sigma, larger axis)"
            if self._trust.level is not Trust.FULL:
                detail += f", if that may be believed: {sentence(self.tracking.verdict)}"
            self._result = (MissionResult.LOCATED, detail)
            self._move(Trigger.OBSERVED, self._result[1], now)

    def _come_down(self, now: float) -> None:
        if self._landing is None:
            return
        self._commands += self._landing.step(now)
        if self._planned is not None:
            # Whoever waits for its turn, or has not obeyed yet, must not miss its setpoints.
            at_rest = replace(self._planned, velocities=np.zeros_like(self._planned.velocities))
            self._command(at_rest)
        if self._landing.complete and self._restored(now):
            if self._landing.given_up:
                ids = ", ".join(str(s) for s in self._landing.given_up)
                self._say(now, "error", f"vehicle {ids} was not seen to land and disarm")
            self._move(Trigger.LANDED, "every vehicle is on the ground and disarmed", now)
            self._end(now)

    # --- Details ---------------------------------------------------------------------

    def _estimate(self, now: float) -> None:
        """Use what can be used of the feed, and say what became of the track."""
        for decision in self.tracking.process(now):
            self._decisions.append(decision)
            if not isinstance(decision, HealthChanged):
                continue
            if decision.status in {"degraded", "diverged"}:
                self._is_track_doubted = True
                self._say(now, "warning", decision.detail, once=False)
            elif decision.status == "tracking" and self._is_track_doubted:
                self._is_track_doubted = False
                self._say(now, "info", decision.detail, once=False)

    def _command(self, planned: PlannedMotion) -> None:
        ours = [self._is_ours(vehicle) for vehicle in self.fleet.vehicles.values()]
        self._commands += setpoint_commands(planned, self.fleet, ours)

    def _compare(self, planned: PlannedMotion, utc: float | None, now: float) -> Plan:
        slots = measured_slots(planned, self.fleet, self.planner, utc)
        rows = enumerate(slots)
        errors = [s.error_m for i, s in rows if i in self.planner.companions and s.error_m]
        self._worst_error_m = max(errors, default=0.0)
        if self._shadow:
            away = planned.slots - planned.positions
            self._worst_error_m = float(np.linalg.norm(away, axis=1).max())
        return Plan(
            at_s=now,
            reference=self._lost.reference,
            los_rad=planned.los.angle_rad,
            formed=self.phase in FLYING_FORMATION and self.phase is not Phase.FORMING,
            slots=tuple(slots),
        )

    def _home_distances(self) -> list[float]:
        """Horizontal distance to the launch point of every vehicle still flown by us, m."""
        distances = []
        for vehicle in self.fleet.vehicles.values():
            here, home = vehicle.position_enu, vehicle.launch_enu
            if here is None or home is None or self._losses.is_lost(vehicle, self._last_tick):
                continue
            if not self._is_ours(vehicle):
                continue
            distances.append(float(np.hypot(here[0] - home[0], here[1] - home[1])))
        return distances

    def _is_ours(self, vehicle: VehicleState) -> bool:
        if self._shadow:
            return True
        raised = self._launch is not None and self._launch.raises(vehicle.sysid)
        return self._custody.is_ours(vehicle, raised=raised)

    def _release_taken_over(self, now: float) -> None:
        if self._shadow:
            return
        said, failures = self._custody.review(now)
        for text in said:
            self._say(now, "warning", text)
        for failure in failures:
            self._fail(failure, now)

    def _receive_vehicle(self, event: VehicleObservation, now: float) -> None:
        match event:
            case VehiclePosition():
                vehicle = self.fleet.vehicles.get(event.sysid)
                if vehicle is not None and vehicle.position_enu is not None:
                    self.tracking.position(event, vehicle.position_enu)
            case CommandOutcome():
                self._preflight.outcome(event)
                if self._launch is not None and self.phase is Phase.LAUNCHING:
                    self._commands += self._launch.outcome(event, now)
                if event.result != "accepted":
                    self._say(
                        now,
                        "warning",
                        f"vehicle {event.sysid}: {event.command} {event.result} ({event.detail})",
                    )
            case StatusText() if event.severity <= 4:
                self._say(now, "warning", f"vehicle {event.sysid} says: {event.text}")

    def _say(
        self,
        now: float,
        level: Literal["info", "warning", "error"],
        text: str,
        *,
        once: bool = True,
    ) -> None:
        if once and text in self._notices:
            return
        self._notices.add(text)
        self._decisions.append(Notice(at_s=now, level=level, text=text))
