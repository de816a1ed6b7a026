"""The vehicles' failsafe parameters: read, judged, with consent set, and in the end restored."""

from __future__ import annotations

import math
from collections import Counter

from swarmctl.commands import Command, ReadParameter, WriteParameter
from swarmctl.events import ParameterValue
from swarmctl.mission.failsafes.judge import (
    Craft,
    Unsafe,
    advised_of,
    parameters_of,
    required_of,
    unsafe,
)
from swarmctl.mission.failsafes.rules import Demands, Weight
from swarmctl.mission.fleet import Fleet, VehicleState
from swarmctl.mission.mission_file import Mission
from swarmctl.units import Vector

ASK_AGAIN_S = 6.0
"""What is not known or not set this long after it was asked for is asked for again."""
TIMES_ASKED = 2
"""Questions, of four tries each, that a parameter a flight may do without is worth. Over a radio
that loses every fifth packet either way, one in 3500 is then missed; what must be known is not."""
RESTORE_TIMEOUT_S = 20.0
"""A vehicle that has not taken its old values this long is left with the new ones."""


class Settings:
    """Sees to it that every vehicle's failsafes bring it home.

    Args:
        mission: The mission; its ``swarm.set_failsafes`` is the operator's consent.
        fleet: The vehicles.

    Attributes:
        changed: What each parameter was before it was set, by system id and name.
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
        """Ask for what is not known, and set what is unsafe if the mission allows it.

        Args:
            now: Controller's time, s.
            may_set: Whether the vehicles are ready but for this.
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
        if any(fault.weight is Weight.OWN for fault in faults):
            return commands
        for fault in faults:
            if fault.weight is Weight.KNOWN:
                continue
            vehicle = self._fleet.vehicles[fault.sysid]
            key = (fault.sysid, fault.parameter)
            # Before the question of what it is has been answered, nothing is due here.
            if key not in self.changed or self._is_due(*key, now):
                self._asked_at[key] = now
                self.changed.setdefault(key, vehicle.parameters[fault.parameter])
                commands.append(
                    WriteParameter(sysid=fault.sysid, parameter=fault.parameter, value=fault.right)
                )
        return commands

    def unmet(self, vehicle: VehicleState) -> list[str]:
        """What keeps a vehicle on the ground, as sentences' middles; empty when nothing does."""
        names = self._missing(vehicle)
        if names:
            return [f"it has not told its {', '.join(names)}"]
        return [
            f"it does not take {fault.parameter} = {fault.right:g}"
            for fault in self.faults()
            if fault.sysid == vehicle.sysid and (fault.sysid, fault.parameter) in self.changed
        ]

    def faults(self) -> list[Unsafe]:
        """What is unsafe, once every vehicle has told all."""
        vehicles = list(self._fleet.vehicles.values())
        if any(self._missing(v) or v.launch_enu is None for v in vehicles):
            return []
        limits = self._mission.limits
        return unsafe(
            [
                self._craft(v, v.heartbeat.autopilot, v.launch_enu)
                for v in vehicles
                if v.heartbeat is not None
                and v.launch_enu is not None
                and parameters_of(v.heartbeat.autopilot)
            ],
            separation_m=limits.min_separation_m,
            ceiling_amsl_m=limits.ceiling_amsl_m,
        )

    def _craft(self, vehicle: VehicleState, autopilot: str, home_enu: Vector) -> Craft:
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
        return Craft(vehicle.sysid, autopilot, demands, home_amsl_m, vehicle.known_parameters)

    def refusal(self) -> str | None:
        """Why the swarm must not fly as its vehicles are set; None if it may."""
        faults = self.faults()
        said = []
        if own := self._verdicts([f for f in faults if f.weight is Weight.OWN]):
            said.append(f"{'; '.join(own)}. Change that on the vehicles, or fly lower")
        settable = self._verdicts([f for f in faults if f.weight is Weight.MUST])
        if settable and not self._mission.swarm.set_failsafes:
            said.append(
                f"{'; '.join(settable)}. Set these on the vehicles, or let swarmctl set them for"
                " the flight with --set-failsafes or, in the mission, swarm.set_failsafes: true"
            )
        return "; also, ".join(said) or None

    def warnings(self) -> list[str]:
        """What else the operator should know of how the vehicles are set, once all is read."""
        untold = [
            f"vehicle {vehicle.sysid} has not told its {name}: nobody looked at what it is"
            for vehicle in self._fleet.vehicles.values()
            if vehicle.heartbeat is not None
            for name in sorted(advised_of(vehicle.heartbeat.autopilot))
            if name not in vehicle.known_parameters
        ]
        said = [f for f in self.faults() if f.weight in {Weight.BETTER, Weight.KNOWN}]
        return [*untold, *self._verdicts(said)]

    def _verdicts(self, faults: list[Unsafe]) -> list[str]:
        """A clause for each fault, for all vehicles that have it."""
        alike: dict[str, list[str]] = {}
        for fault in faults:
            alike.setdefault(self._verdict(fault), []).append(f"{fault.sysid}")
        return [f"{_vehicles(sysids)}: {verdict}" for verdict, sysids in alike.items()]

    def _verdict(self, fault: Unsafe) -> str:
        told = self._fleet.vehicles[fault.sysid].parameters[fault.parameter]
        is_, right = fault.value / told.own_unit, fault.right / told.own_unit
        if math.isnan(right):
            return f"{told.own_name} is {is_:g}, {fault.why}"
        ought = "should" if fault.weight is Weight.MUST else "had better"
        return f"{told.own_name} is {is_:g}, and {ought} be {right:g} ({fault.why})"

    # --- After the flight ------------------------------------------------------------

    def restore(self, now: float) -> list[Command]:
        """Give every vehicle its own values back; call until :meth:`is_restored`."""
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
        """Whether nothing is left to restore, or to wait for."""
        since = self._restoring_since
        return not self.left_behind() or (since is not None and now - since > RESTORE_TIMEOUT_S)

    def left_behind(self) -> list[str]:
        """Parameters that are not what they were before the flight, for a person."""
        return [
            f"{was.own_name} of vehicle {sysid}, which was {_own(was):g}"
            for (sysid, name), was in self.changed.items()
            if self._is_left(sysid, name)
        ]

    def _is_left(self, sysid: int, name: str) -> bool:
        # What was told before the old value was sent says nothing of it.
        since = self._restoring_since
        told = self._fleet.vehicles[sysid].parameters[name]
        was = self.changed[sysid, name]
        return since is None or told.received_s < since or told.value != was.value

    def _missing(self, vehicle: VehicleState) -> list[str]:
        """Parameters that are looked at and that the vehicle may still tell."""
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


def _own(told: ParameterValue) -> float:
    """A known parameter's value in the vehicle's own unit."""
    return (told.value or 0.0) / told.own_unit
