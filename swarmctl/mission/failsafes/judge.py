"""Whether the vehicles' own failsafes would bring the swarm home safely and apart.

A pure judgement of what the vehicles say of their parameters, by the tables of
:mod:`swarmctl.mission.failsafes.rules` and by what they do together.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from swarmctl.mission.failsafes.rules import RULES, Demands, Weight

RETURN_ALTITUDE = {"ardupilot": "RTL_ALT_M", "px4": "RTL_RETURN_ALT"}
"""The parameter with the least altitude above home of a return, m, by autopilot."""


@dataclass(frozen=True)
class Craft:
    """A vehicle whose failsafes are judged.

    Attributes:
        sysid: MAVLink system id.
        autopilot: ``ardupilot`` or ``px4``.
        demands: What the mission asks of it.
        home_amsl_m: Altitude of its home, m.
        values: Those of :func:`parameters_of` its autopilot that it has told. What is not among
            them is not judged.
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
class Unsafe:
    """A parameter that must not stay as it is.

    Attributes:
        sysid: MAVLink system id of the vehicle.
        parameter: Its name.
        value: What it is.
        right: What would be right; not a number if that depends.
        why: What the right value does, as a clause.
        weight: What becomes of it.
    """

    sysid: int
    parameter: str
    value: float
    right: float
    why: str
    weight: Weight


def parameters_of(autopilot: str) -> tuple[str, ...]:
    """Names of the parameters that are looked at, by autopilot; none for one that is not known."""
    if autopilot not in RULES:
        return ()
    names = [name for rule in RULES[autopilot] for name in (rule.parameter, *rule.needs)]
    return tuple(dict.fromkeys((*names, RETURN_ALTITUDE[autopilot])))


def required_of(autopilot: str) -> frozenset[str]:
    """Names of those without which nobody can tell whether a vehicle comes home safely."""
    if autopilot not in RULES:
        return frozenset()
    rules = RULES[autopilot]
    must = {r.parameter for r in rules if r.weight is Weight.MUST and not r.optional}
    return frozenset(must | {RETURN_ALTITUDE[autopilot]})


def advised_of(autopilot: str) -> frozenset[str]:
    """Names of those that a flight may do without, but not without saying so."""
    if autopilot not in RULES:
        return frozenset()
    rules = [rule for rule in RULES[autopilot] if not rule.optional]
    names = {name for rule in rules for name in (rule.parameter, *rule.needs)}
    return frozenset(names) - required_of(autopilot)


def unsafe(crafts: Sequence[Craft], *, separation_m: float, ceiling_amsl_m: float) -> list[Unsafe]:
    """What would keep the swarm from coming home safely and apart by itself.

    Args:
        crafts: The vehicles.
        separation_m: Least difference between the altitudes of two returns, m.
        ceiling_amsl_m: Greatest altitude, m.

    Returns:
        Every unsafe parameter, in the order of the vehicles.
    """
    found = [fault for craft in crafts for fault in _alone(craft)]
    crafts = [craft for craft in crafts if RETURN_ALTITUDE[craft.autopilot] in craft.values]
    levels = sorted(craft.return_amsl_m for craft in crafts)
    is_apart = all(high - low >= separation_m for low, high in itertools.pairwise(levels))
    if is_apart and max(levels, default=-math.inf) <= ceiling_amsl_m:
        return found
    # The mission's own altitudes are apart and below the ceiling, so whoever would leave its
    # own is kept there. Rounded down: a return never descends.
    for craft in crafts:
        if craft.return_amsl_m > craft.altitude_amsl_m:
            name = RETURN_ALTITUDE[craft.autopilot]
            right = float(math.floor(craft.altitude_amsl_m - craft.home_amsl_m))
            found.append(
                Unsafe(
                    craft.sysid,
                    name,
                    craft.values[name],
                    right,
                    f"it returns at its own {craft.altitude_amsl_m:g} m AMSL, apart from the others"
                    " and below the ceiling",
                    Weight.MUST,
                )
            )
    return found


def _alone(craft: Craft) -> Iterator[Unsafe]:
    """What is not right about one vehicle, whatever the others do; a parameter only once."""
    seen = set()
    for rule in RULES[craft.autopilot]:
        value = craft.values.get(rule.parameter)
        if value is None or rule.parameter in seen:
            continue
        right = rule.right(value, craft.values, craft.demands)
        if right != value:
            seen.add(rule.parameter)
            yield Unsafe(craft.sysid, rule.parameter, value, right, rule.why, rule.weight)
