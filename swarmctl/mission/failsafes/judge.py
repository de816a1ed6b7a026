"""Whether the vehicles' own failsafes would bring the swarm home safely and apart.

A pure judgement of the parameters that the vehicles have told: each vehicle by the rules of its
autopilot, and then all vehicles together by the altitudes of their returns.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from swarmctl.mission.failsafes import ardupilot, px4
from swarmctl.mission.failsafes.rules import Demands, Ok, OperatorDecides, RuleClass, SetTo

RULES = {"ardupilot": ardupilot.RULES, "px4": px4.RULES}
"""The table of each autopilot, by the name that Heartbeat gives it."""
RETURN_ALTITUDE = {"ardupilot": ardupilot.RETURN_ALTITUDE, "px4": px4.RETURN_ALTITUDE}
"""The parameter with the least altitude of a return above home, m, by autopilot."""


@dataclass(frozen=True)
class JudgedVehicle:
    """A vehicle whose failsafes are judged.

    Attributes:
        sysid: MAVLink system id.
        autopilot: ``ardupilot`` or ``px4``.
        demands: What the mission asks of it.
        home_amsl_m: Altitude of its home, m.
        values: What it has told of the parameters in :func:`parameters_of` its autopilot. A
            parameter that is missing here is not judged.
    """

    sysid: int
    autopilot: str
    demands: Demands
    home_amsl_m: float
    values: Mapping[str, float]

    @property
    def altitude_amsl_m(self) -> float:
        """The altitude the mission gives it, m."""
        return self.home_amsl_m + self.demands.height_m

    @property
    def return_amsl_m(self) -> float:
        """The altitude it returns at, m: it climbs to that of a return, but never descends."""
        least = self.values[RETURN_ALTITUDE[self.autopilot]]
        return max(self.altitude_amsl_m, self.home_amsl_m + least)


@dataclass(frozen=True)
class UnsafeParameter:
    """A parameter that must not stay as it is, or that the operator should know of.

    Attributes:
        sysid: MAVLink system id of the vehicle.
        parameter: Its name.
        value: Its value.
        verdict: What would be right.
        rule_class: What follows from it.
    """

    sysid: int
    parameter: str
    value: float
    verdict: SetTo | OperatorDecides
    rule_class: RuleClass


def parameters_of(autopilot: str) -> tuple[str, ...]:
    """Names of all parameters that are judged, by autopilot; none for an unknown autopilot."""
    if autopilot not in RULES:
        return ()
    names = [name for rule in RULES[autopilot] for name in (rule.parameter, *rule.needs)]
    return tuple(dict.fromkeys((*names, RETURN_ALTITUDE[autopilot])))


def required_of(autopilot: str) -> frozenset[str]:
    """Names of the parameters that must be known before a vehicle may fly."""
    if autopilot not in RULES:
        return frozenset()
    required = {
        rule.parameter
        for rule in RULES[autopilot]
        if rule.rule_class is RuleClass.REQUIRED and not rule.optional
    }
    return frozenset(required | {RETURN_ALTITUDE[autopilot]})


def advised_of(autopilot: str) -> frozenset[str]:
    """Names of the parameters that may stay unknown, but not without a warning."""
    if autopilot not in RULES:
        return frozenset()
    rules = [rule for rule in RULES[autopilot] if not rule.optional]
    names = {name for rule in rules for name in (rule.parameter, *rule.needs)}
    return frozenset(names) - required_of(autopilot)


def find_unsafe(
    vehicles: Sequence[JudgedVehicle], *, separation_m: float, ceiling_amsl_m: float
) -> list[UnsafeParameter]:
    """Everything that would keep the swarm from coming home safely and apart by itself.

    Args:
        vehicles: The vehicles.
        separation_m: Least difference between the altitudes of two returns, m.
        ceiling_amsl_m: Greatest altitude, m.

    Returns:
        Every unsafe parameter: by the rules, in the order of the vehicles, then by the returns.
    """
    found = [fault for vehicle in vehicles for fault in _by_the_rules(vehicle)]
    return found + _by_the_returns(vehicles, separation_m, ceiling_amsl_m)


def _by_the_rules(vehicle: JudgedVehicle) -> Iterator[UnsafeParameter]:
    """What is not right about one vehicle, each parameter once: by the first rule it breaks."""
    seen = set()
    for rule in RULES[vehicle.autopilot]:
        value = vehicle.values.get(rule.parameter)
        if value is None or rule.parameter in seen:
            continue
        verdict = rule.check(value, vehicle.values, vehicle.demands)
        if isinstance(verdict, Ok) and math.isnan(value):
            verdict = OperatorDecides("which is not a number")
        if not isinstance(verdict, Ok):
            seen.add(rule.parameter)
            yield UnsafeParameter(vehicle.sysid, rule.parameter, value, verdict, rule.rule_class)


def _by_the_returns(
    vehicles: Sequence[JudgedVehicle], separation_m: float, ceiling_amsl_m: float
) -> list[UnsafeParameter]:
    """The return altitudes to lower if returns would meet or pass the ceiling."""
    vehicles = [v for v in vehicles if RETURN_ALTITUDE[v.autopilot] in v.values]
    levels = sorted(vehicle.return_amsl_m for vehicle in vehicles)
    is_apart = all(high - low >= separation_m for low, high in itertools.pairwise(levels))
    if is_apart and max(levels, default=-math.inf) <= ceiling_amsl_m:
        return []
    # The mission's own altitudes are apart and below the ceiling, so every vehicle that would
    # climb is kept at its own. Rounded down, for a return never descends.
    found = []
    for vehicle in vehicles:
        if vehicle.return_amsl_m > vehicle.altitude_amsl_m:
            name = RETURN_ALTITUDE[vehicle.autopilot]
            right = SetTo(
                float(math.floor(vehicle.altitude_amsl_m - vehicle.home_amsl_m)),
                f"it returns at its own {vehicle.altitude_amsl_m:g} m AMSL, apart from the others"
                " and below the ceiling",
            )
            found.append(
                UnsafeParameter(
                    vehicle.sysid, name, vehicle.values[name], right, RuleClass.REQUIRED
                )
            )
    return found
