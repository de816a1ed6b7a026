"""Before anything is armed: waits for the vehicles, asks for what is missing, uploads geofences."""

from __future__ import annotations

from swarmctl.commands import Command, RequestHome, RequestVersion, StreamTelemetry, UploadFence
from swarmctl.events import CommandKind, CommandOutcome
from swarmctl.mission.failsafes.session import FailsafeSession
from swarmctl.mission.failure import Failure
from swarmctl.mission.fleet import Fleet, VehicleState
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.preflight_checks import clock_fault, fleet_faults, unmet_checks
from swarmctl.results import MissionResult

POSITION_HZ = 10.0
"""Rate of position reports that every vehicle is asked for, Hz."""
ANSWER_TIMEOUT_S = 30.0
"""A vehicle that has not been heard this long after the start has failed."""
CHECK_TIMEOUT_S = 60.0
"""A check that has not passed this long after the last vehicle was heard has failed."""
ASK_AGAIN_S = 5.0
"""Telemetry that does not come is asked for again after this long."""

UPLOADED_FENCE_MARGIN_M = 30.0
"""The fence uploaded to a vehicle is this much wider than the mission's geofence."""
FENCE_AGAIN_S = 15.0
"""A fence that was not taken is uploaded again after this long."""


class Preflight:
    """Gets the vehicles ready: waits for them, asks for what is missing, and checks them.

    Args:
        mission: The mission.
        fleet: The vehicles.
        now: Controller's time, s.
        hiccup_s: Delay that this computer may be to blame for, s.
        shadow: Whether others fly the vehicles.

    Attributes:
        failsafes: The vehicles' failsafe parameters.
        failure: Why the mission cannot start; None while it still may.
        complete: Whether every check of every vehicle has passed.
    """

    def __init__(
        self,
        mission: Mission,
        fleet: Fleet,
        now: float,
        hiccup_s: float = 0.0,
        *,
        shadow: bool = False,
    ) -> None:
        self._shadow = shadow
        self._hiccup_s = hiccup_s
        self._mission = mission
        self._fleet = fleet
        self._since = now
        self._heard_since: float | None = None
        self._asked_at: dict[int, float] = {}
        self._fence_at: dict[int, float] = {}
        self._fence: dict[int, CommandOutcome] = {}
        self.failsafes = FailsafeSession(mission, fleet)
        self.failure: Failure | None = None
        self.complete = False

    @property
    def heard(self) -> int:
        """How many vehicles have been heard."""
        return sum(v.heartbeat is not None for v in self._fleet.vehicles.values())

    @property
    def ready(self) -> int:
        """How many vehicles pass every check."""
        return sum(not self._unmet(v) for v in self._fleet.vehicles.values())

    @property
    def all_heard(self) -> bool:
        """Whether every vehicle has been heard."""
        return self.heard == len(self._fleet.vehicles)

    def step(self, now: float) -> list[Command]:
        """Advance with time; returns what to ask the vehicles."""
        vehicles = list(self._fleet.vehicles.values())
        fault = next(
            (text for v in vehicles if (text := clock_fault(v, self._hiccup_s)) is not None), None
        )
        if fault is not None:
            self.failure = Failure(MissionResult.CLOCK_MISMATCH, fault)
            return []
        unready = {
            v.sysid for v in vehicles if unmet_checks(v, self._mission, may_fly=self._shadow)
        }
        commands = [
            command
            for v in vehicles
            if v.heartbeat is not None and v.sysid in unready
            for command in self._ask(v.sysid, now)
        ]
        if not self._shadow:
            # Nothing is set on vehicles that could not fly anyway.
            commands += self.failsafes.step(now, may_set=not unready)
            commands += [] if unready else self._upload_fences(now)
        unmet = {v.sysid: texts for v in vehicles if (texts := self._unmet(v))}
        if not self.all_heard:
            if now - self._since > ANSWER_TIMEOUT_S:
                self.failure = self._silence(vehicles)
            return commands
        if self._heard_since is None:
            self._heard_since = now
        refusal = None if unready or self._shadow else self.failsafes.refusal()
        if refusal is not None:
            self.failure = Failure(MissionResult.UNSAFE_FAILSAFES, refusal)
        elif not unmet:
            self._check_together()
        elif now - self._heard_since > CHECK_TIMEOUT_S:
            missing = (f"vehicle {sysid}: {', '.join(texts)}" for sysid, texts in unmet.items())
            self.failure = Failure(MissionResult.NOT_READY, "; ".join(missing))
        return commands

    def warnings(self) -> list[str]:
        """What the operator should know before vehicles that pass every check take off."""
        return [] if self._shadow else self.failsafes.warnings()

    def _unmet(self, vehicle: VehicleState) -> list[str]:
        unmet = unmet_checks(vehicle, self._mission, may_fly=self._shadow)
        if self._shadow:
            return unmet
        unmet += self.failsafes.unmet(vehicle)
        if self._mission.limits.upload_geofence and not self._is_fenced(vehicle):
            outcome = self._fence.get(vehicle.sysid)
            said = "" if outcome is None else f" ({outcome.detail})"
            unmet.append(f"it has not taken the geofence{said}")
        return unmet

    def outcome(self, event: CommandOutcome) -> None:
        """Take the end of a command's exchange."""
        if event.command is CommandKind.UPLOAD_FENCE:
            self._fence[event.sysid] = event

    def _is_fenced(self, vehicle: VehicleState) -> bool:
        outcome = self._fence.get(vehicle.sysid)
        return outcome is not None and outcome.result == "accepted"

    def _upload_fences(self, now: float) -> list[Command]:
        if not self._mission.limits.upload_geofence:
            return []
        lat, lon, _ = self._mission.origin.geodetic
        radius = self._mission.limits.geofence_radius_m + UPLOADED_FENCE_MARGIN_M
        commands: list[Command] = []
        for vehicle in self._fleet.vehicles.values():
            again = self._fence_at.get(vehicle.sysid, -FENCE_AGAIN_S) + FENCE_AGAIN_S
            if now >= again and not self._is_fenced(vehicle):
                self._fence_at[vehicle.sysid] = now
                commands.append(
                    UploadFence(sysid=vehicle.sysid, lat_rad=lat, lon_rad=lon, radius_m=radius)
                )
        return commands

    def _ask(self, sysid: int, now: float) -> list[Command]:
        if now < self._asked_at.get(sysid, -ASK_AGAIN_S) + ASK_AGAIN_S:
            return []
        self._asked_at[sysid] = now
        return [
            StreamTelemetry(sysid=sysid, position_hz=POSITION_HZ),
            RequestVersion(sysid=sysid),
            RequestHome(sysid=sysid),
        ]

    def _silence(self, vehicles: list[VehicleState]) -> Failure:
        silent = [str(v.sysid) for v in vehicles if v.heartbeat is None]
        who = f"vehicle {silent[0]}" if len(silent) == 1 else f"vehicles {', '.join(silent)}"
        return Failure(
            MissionResult.VEHICLE_SILENT,
            f"{who} never answered on {' or '.join(self._mission.swarm.link)} within"
            f" {ANSWER_TIMEOUT_S:.0f} s: check power, radio, system id and where the vehicle"
            " sends its MAVLink",
        )

    def _check_together(self) -> None:
        faults = fleet_faults(self._fleet, self._mission)
        if faults:
            self.failure = Failure(MissionResult.NOT_READY, "; ".join(faults))
        else:
            self.complete = True
