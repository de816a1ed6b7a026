"""Getting every vehicle into the air: guided mode, arming, take-off and climb, in turn."""

from __future__ import annotations

from enum import Enum, auto

from swarmctl.commands import Arm, Command, GoTo, SetMode, TakeOff
from swarmctl.events import CommandKind, CommandOutcome, Mode, VehiclePosition
from swarmctl.mission.failure import Failure
from swarmctl.mission.fleet import VehicleState
from swarmctl.results import MissionResult

STAGGER_S = 2.0
"""One vehicle starts this long after the one before."""
TAKE_OFF_TIMEOUT_S = 90.0
"""A vehicle that is not at its altitude this long after the take-off command has failed."""
STREAM_S = 1.5
"""A vehicle that is guided by a stream gets setpoints this long before its mode is set."""
AT_ALTITUDE_M = 2.0
"""A vehicle counts as at its altitude from this far below it, m."""


class Step(Enum):
    """How far the launch of a vehicle is."""

    GROUND = auto()
    STREAM = auto()
    MODE = auto()
    ARM = auto()
    TAKE_OFF = auto()
    CLIMB = auto()
    UP = auto()


_NEXT = {Step.MODE: Step.ARM, Step.ARM: Step.TAKE_OFF, Step.TAKE_OFF: Step.CLIMB}
_REFUSED = {
    Step.MODE: (MissionResult.MODE_REFUSED, "switch to guided mode"),
    Step.ARM: (MissionResult.ARMING_REFUSED, "arm"),
    Step.TAKE_OFF: (MissionResult.TAKE_OFF_REFUSED, "take off"),
}
_COMMAND_OF = {
    Step.MODE: CommandKind.SET_MODE,
    Step.ARM: CommandKind.ARM,
    Step.TAKE_OFF: CommandKind.TAKE_OFF,
}


class Launch:
    """Guided mode, arm, take off, climb: each vehicle in turn, staggered in time.

    A vehicle that is guided by a stream gets setpoints from before it is asked for guided mode:
    first where it stands, and once it is armed at its altitude above that, which raises it.

    Args:
        vehicles: The vehicles in the order they start.
        now: Controller's time, s.
    """

    def __init__(self, vehicles: list[VehicleState], now: float) -> None:
        self._vehicles = {v.sysid: v for v in vehicles}
        self._steps = {v.sysid: Step.GROUND for v in vehicles}
        self._starts = {v.sysid: now + i * STAGGER_S for i, v in enumerate(vehicles)}
        self._climbing_since: dict[int, float] = {}
        self._streaming_since: dict[int, float] = {}
        self._stood: dict[int, VehiclePosition] = {}
        self.failure: Failure | None = None

    @property
    def at_altitude(self) -> int:
        """How many vehicles are at their altitude."""
        return sum(step is Step.UP for step in self._steps.values())

    @property
    def complete(self) -> bool:
        """Whether every vehicle is at its altitude."""
        return self.at_altitude == len(self._steps)

    def raises(self, sysid: int) -> bool:
        """Whether setpoints have begun to raise a vehicle from the ground."""
        return sysid in self._stood and self._steps[sysid] in {Step.CLIMB, Step.UP}

    def rehearsal(self) -> list[Command]:
        """Every command of the launch at once, for a controller whose commands are not sent."""
        return [
            command
            for vehicle in self._vehicles.values()
            for command in (
                SetMode(sysid=vehicle.sysid, mode=Mode.GUIDED),
                Arm(sysid=vehicle.sysid),
                TakeOff(sysid=vehicle.sysid, alt_amsl_m=vehicle.altitude_amsl_m),
            )
        ]

    def outcome(self, event: CommandOutcome, now: float) -> list[Command]:
        """Take the end of a command's exchange; returns the next command."""
        step = self._steps.get(event.sysid)
        if step is None or _COMMAND_OF.get(step) is not event.command or self.failure is not None:
            return []
        if event.result != "accepted":
            name, verb = _REFUSED[step]
            said = "refused to" if event.result == "refused" else "did not answer when told to"
            self.failure = Failure(
                name,
                f"vehicle {event.sysid} {said} {verb} ({event.detail}): clear the cause on the"
                " vehicle and start again",
            )
            return []
        self._steps[event.sysid] = _NEXT[step]
        vehicle = self._vehicles[event.sysid]
        if _NEXT[step] is Step.ARM:
            return [Arm(sysid=event.sysid)]
        if _NEXT[step] is Step.TAKE_OFF and event.sysid in self._stood:
            self._steps[event.sysid] = Step.CLIMB
        elif _NEXT[step] is Step.TAKE_OFF:
            return [TakeOff(sysid=event.sysid, alt_amsl_m=vehicle.altitude_amsl_m)]
        self._climbing_since[event.sysid] = now
        return []

    def step(self, now: float) -> list[Command]:
        """Advance with time; returns the commands that are due."""
        commands: list[Command] = []
        if self.failure is not None:
            return commands
        for sysid, vehicle in self._vehicles.items():
            step = self._steps[sysid]
            if step is Step.GROUND and now >= self._starts[sysid]:
                if vehicle.guided_by_stream and vehicle.position is not None:
                    self._stood[sysid] = vehicle.position
                    self._streaming_since[sysid] = now
                    self._steps[sysid] = Step.STREAM
                else:
                    self._ask_for_guided(sysid, commands)
            elif step is Step.STREAM and now >= self._streaming_since[sysid] + STREAM_S:
                self._ask_for_guided(sysid, commands)
            elif step is Step.CLIMB:
                self._watch_climb(vehicle, now)
            if sysid in self._stood:
                commands.append(self._setpoint(vehicle))
        return commands

    def _ask_for_guided(self, sysid: int, commands: list[Command]) -> None:
        self._steps[sysid] = Step.MODE
        commands.append(SetMode(sysid=sysid, mode=Mode.GUIDED))

    def _setpoint(self, vehicle: VehicleState) -> GoTo:
        stood = self._stood[vehicle.sysid]
        raised = self.raises(vehicle.sysid)
        return GoTo(
            sysid=vehicle.sysid,
            lat_rad=stood.lat_rad,
            lon_rad=stood.lon_rad,
            alt_amsl_m=vehicle.altitude_amsl_m if raised else stood.alt_amsl_m,
            velocity_enu=(0.0, 0.0, 0.0),
        )

    def _watch_climb(self, vehicle: VehicleState, now: float) -> None:
        report = vehicle.position
        if report is not None and report.alt_amsl_m > vehicle.altitude_amsl_m - AT_ALTITUDE_M:
            self._steps[vehicle.sysid] = Step.UP
        elif now - self._climbing_since[vehicle.sysid] > TAKE_OFF_TIMEOUT_S:
            self.failure = Failure(
                MissionResult.TAKE_OFF_TIMEOUT,
                f"vehicle {vehicle.sysid} has not reached {vehicle.altitude_amsl_m:g} m AMSL"
                f" {TAKE_OFF_TIMEOUT_S:g} s after take-off: check its climb rate and its load",
            )
