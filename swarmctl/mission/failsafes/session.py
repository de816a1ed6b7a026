"""Reads the vehicles' failsafe parameters, sets them with consent, and restores them."""

from __future__ import annotations

import math
from collections import Counter

from swarmctl.commands import Command, ReadParameter, WriteParameter
from swarmctl.events import ParameterValue
from swarmctl.mission.failsafes.judge import (
    JudgedVehicle,
    UnsafeParameter,
    advised_of,
    find_unsafe,
    parameters_of,
    required_of,
)
from swarmctl.mission.failsafes.rules import Demands, RuleClass, SetTo
from swarmctl.mission.fleet import Fleet, VehicleState
from swarmctl.mission.mission_file import Mission
from swarmctl.units import Vector

ASK_AGAIN_S = 6.0
"""A parameter that is not known or not set this long after it was asked for is asked for again."""
TIMES_ASKED = 2
"""A parameter that is not required is asked for this many times, with four tries each. Over a
radio that loses every fifth packet either way, one in 3500 is then still unknown. A required
parameter is asked for until it is known."""
RESTORE_TIMEOUT_S = 20.0
"""A vehicle that has not taken its old values after this long keeps the new ones."""


class FailsafeSession:
    """The failsafe parameters of all vehicles, from before the flight until they are restored.

    Args:
        mission: The mission; its ``swarm.set_failsafes`` is the operator's consent.
        fleet: The vehicles.

    Attributes:
        changed: Value of each changed parameter before the flight, by system id and name.
    """

    def __init__(self, mission: Mission, fleet: Fleet) -> None:
        self._mission = mission
        self._fleet = fleet
        self._asked_at: dict[tuple[int, str], float] = {}
        self._times_asked: Counter[tuple[int, str]] = Counter()
        self._restoring_since: float | None = None
        self.changed: dict[tuple[int, str], ParameterValue] = {}

    # --- Before the flight -----------------------------------------------------------

    def step(self, now: float, *, may_set: bool) -> list[Command]:
        """Ask for what is not known, and set what is unsafe if the operator consents.

        Args:
            now: Controller's time, s.
            may_set: Whether the vehicles pass every other check.
        """
        commands: list[Command] = []
        for vehicle in self._fleet.vehicles.values():
            for name in self._missing(vehicle):
                if self._is_due(vehicle.sysid, name, now):
                    self._times_asked[vehicle.sysid, name] += 1
                    commands.append(ReadParameter(sysid=vehicle.sysid, parameter=name))
        if not (may_set and self._mission.swarm.set_failsafes):
            return commands
        faults = self.faults()
        if any(fault.rule_class is RuleClass.OPERATOR_ONLY for fault in faults):
            return commands
        for fault in faults:
            if fault.rule_class is RuleClass.REPORT_ONLY or not isinstance(fault.verdict, SetTo):
                continue
            vehicle = self._fleet.vehicles[fault.sysid]
            key = (fault.sysid, fault.parameter)
            # The first write follows its answer at once; only repeated writes have to wait.
            if key not in self.changed or self._is_due(*key, now):
                self._asked_at[key] = now
                self.changed.setdefault(key, vehicle.parameters[fault.parameter])
                commands.append(
                    WriteParameter(
                        sysid=fault.sysid, parameter=fault.parameter, value=fault.verdict.value
                    )
                )
        return commands

    def unmet(self, vehicle: VehicleState) -> list[str]:
        """What keeps a vehicle on the ground, as sentences' middles; empty when nothing does."""
        names = self._missing(vehicle)
        if names:
            return [f"it has not told its {', '.join(names)}"]
        return [
            f"it does not take {fault.parameter} = {fault.verdict.value:g}"
            for fault in self.faults()
            if fault.sysid == vehicle.sysid
            and (fault.sysid, fault.parameter) in self.changed
            and isinstance(fault.verdict, SetTo)
        ]

    def faults(self) -> list[UnsafeParameter]:
        """What is unsafe; empty until every vehicle has told all its parameters."""
        vehicles = list(self._fleet.vehicles.values())
        if any(self._missing(v) or v.launch_enu is None for v in vehicles):
            return []
        limits = self._mission.limits
        return find_unsafe(
            [
                self._judged(v, v.heartbeat.autopilot, v.launch_enu)
                for v in vehicles
                if v.heartbeat is not None
                and v.launch_enu is not None
                and parameters_of(v.heartbeat.autopilot)
            ],
            separation_m=limits.min_separation_m,
            ceiling_amsl_m=limits.ceiling_amsl_m,
        )

    def _judged(self, vehicle: VehicleState, autopilot: str, home_enu: Vector) -> JudgedVehicle:
        mission, limits = self._mission, self._mission.limits
        home_amsl_m = mission.origin.alt_amsl_m + home_enu[2]
        demands = Demands(
            mission.swarm.gcs_sysid,
            limits.max_speed_mps,
            limits.max_acceleration_mps2,
            height_m=vehicle.altitude_amsl_m - home_amsl_m,
            reach_m=limits.geofence_radius_m + math.hypot(*home_enu[:2]),
            is_fenced=limits.upload_geofence,
        )
        return JudgedVehicle(
            vehicle.sysid, autopilot, demands, home_amsl_m, vehicle.known_parameters
        )

    def refusal(self) -> str | None:
        """Why the swarm must not fly as its vehicles are set; None if it may."""
        said = []
        if own := self._sentences(RuleClass.OPERATOR_ONLY):
            said.append(f"{'; '.join(own)}. Change that on the vehicles, or fly lower")
        settable = self._sentences(RuleClass.REQUIRED)
        if settable and not self._mission.swarm.set_failsafes:
            said.append(
                f"{'; '.join(settable)}. Set these on the vehicles, or let swarmctl set them for"
                " the flight with --set-failsafes or, in the mission, swarm.set_failsafes: true"
            )
        return "; also, ".join(said) or None

    def warnings(self) -> list[str]:
        """What the operator should know of the parameters although the vehicles may fly."""
        untold = [
            f"vehicle {vehicle.sysid} has not told its {name}: nobody looked at what it is"
            for vehicle in self._fleet.vehicles.values()
            if vehicle.heartbeat is not None
            for name in sorted(advised_of(vehicle.heartbeat.autopilot))
            if name not in vehicle.known_parameters
        ]
        return [*untold, *self._sentences(RuleClass.RECOMMENDED, RuleClass.REPORT_ONLY)]

    def _sentences(self, *classes: RuleClass) -> list[str]:
        """What is unsafe, of some classes: one clause for all vehicles with the same fault."""
        alike: dict[str, list[str]] = {}
        for fault in self.faults():
            if fault.rule_class in classes:
                alike.setdefault(self._sentence(fault), []).append(f"{fault.sysid}")
        return [f"{_vehicles(sysids)}: {said}" for said, sysids in alike.items()]

    def _sentence(self, fault: UnsafeParameter) -> str:
        told = self._fleet.vehicles[fault.sysid].parameters[fault.parameter]
        found = f"{told.own_name} is {fault.value / told.own_unit:g}"
        if not isinstance(fault.verdict, SetTo):
            return f"{found}, {fault.verdict.why}"
        ought = "should" if fault.rule_class is RuleClass.REQUIRED else "had better"
        right = fault.verdict.value / told.own_unit
        return f"{found}, and {ought} be {right:g} ({fault.verdict.why})"

    # --- After the flight ------------------------------------------------------------

    def restore(self, now: float) -> list[Command]:
        """Give every vehicle its old values back; call it until :meth:`is_restored`."""
        if self._restoring_since is None:
            self._restoring_since = now
            self._asked_at.clear()
        commands: list[Command] = []
        for (sysid, name), was in self.changed.items():
            left = self._is_left(sysid, name)
            if left and was.value is not None and self._is_due(sysid, name, now):
                commands.append(WriteParameter(sysid=sysid, parameter=name, value=was.value))
        return commands

    def is_restored(self, now: float) -> bool:
        """Whether every old value is back, or it is no use to wait any longer."""
        since = self._restoring_since
        return not self.left_behind() or (since is not None and now - since > RESTORE_TIMEOUT_S)

    def left_behind(self) -> list[str]:
        """Parameters that differ from before the flight, in words."""
        return [
            f"{was.own_name} of vehicle {sysid}, which was {_in_own_unit(was):g}"
            for (sysid, name), was in self.changed.items()
            if self._is_left(sysid, name)
        ]

    def _is_left(self, sysid: int, name: str) -> bool:
        # Only what the vehicle has told after the old value was sent counts.
        since = self._restoring_since
        told = self._fleet.vehicles[sysid].parameters[name]
        was = self.changed[sysid, name]
        return since is None or told.received_s < since or told.value != was.value

    def _missing(self, vehicle: VehicleState) -> list[str]:
        """Parameters that are judged, not known, and worth another question."""
        if vehicle.heartbeat is None:
            return []
        autopilot, known = vehicle.heartbeat.autopilot, vehicle.known_parameters
        required = required_of(autopilot)
        return [
            name
            for name in parameters_of(autopilot)
            if name not in known
            and (
                name in required
                or name not in vehicle.parameters
                or self._times_asked[vehicle.sysid, name] < TIMES_ASKED
            )
        ]

    def _is_due(self, sysid: int, name: str, now: float) -> bool:
        asked = self._asked_at.get((sysid, name))
        if asked is not None and now < asked + ASK_AGAIN_S:
            return False
        self._asked_at[sysid, name] = now
        return True


def _vehicles(sysids: list[str]) -> str:
    return f"vehicle{'s' if len(sysids) > 1 else ''} {', '.join(sysids)}"


def _in_own_unit(told: ParameterValue) -> float:
    """A known parameter's value in the vehicle's own unit."""
    return (told.value or 0.0) / told.own_unit
