"""Whether the vehicles' own failsafes would bring the swarm home safely and apart.

A pure judgement of what the vehicles say of their parameters. Parameters go by their newest
names and units; the link knows the older ones. Meanings: ArduCopter 4.7 and PX4 v1.16.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

RETURN_ALTITUDE = {"ardupilot": "RTL_ALT_M", "px4": "RTL_RETURN_ALT"}
"""The parameter with the least altitude above home of a return, m, by autopilot."""


OPTIONAL = frozenset({"FS_GCS_TIMEOUT"})
"""Parameters that older firmware does not have; what it has instead is right."""


@dataclass(frozen=True)
class Craft:
    """A vehicle whose failsafes are judged.

    Attributes:
        sysid: MAVLink system id.
        autopilot: ``ardupilot`` or ``px4``.
        altitude_amsl_m: The altitude the mission gives it, m.
        home_amsl_m: Altitude of its home, m.
        values: All of :func:`parameters_of` its autopilot; of :data:`OPTIONAL` those it has.
    """

    sysid: int
    autopilot: str
    altitude_amsl_m: float
    home_amsl_m: float
    values: Mapping[str, float]

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
        right: What would be right.
        why: What the right value does, as a clause.
    """

    sysid: int
    parameter: str
    value: float
    right: float
    why: str


@dataclass(frozen=True)
class _Rule:
    parameter: str
    is_safe: Callable[[float], bool]
    right: float
    why: str


def _rules(autopilot: str, gcs_sysid: int) -> tuple[_Rule, ...]:
    if autopilot == "ardupilot":
        # 3 and 4 retrace each vehicle's own path, which may cross another's; 5 and 7 land it.
        return (
            _Rule(
                "FS_GCS_ENABLE",
                lambda value: value == 1.0,
                1.0,
                "it returns home when its ground station falls silent",
            ),
            # At 1 Hz, a radio that loses one heartbeat in five loses five in a row every hour.
            _Rule(
                "FS_GCS_TIMEOUT",
                lambda value: 10.0 <= value <= 60.0,
                10.0,
                "a lossy radio is no lost ground station",
            ),
            _Rule(
                "MAV_GCS_SYSID",
                lambda value: value == gcs_sysid,
                float(gcs_sysid),
                "this controller is the ground station it listens for",
            ),
        )
    return (
        _Rule(
            "NAV_DLL_ACT",
            lambda value: value == 2.0,
            2.0,
            "it returns home when its ground station falls silent",
        ),
        _Rule(
            "COM_OBL_RC_ACT",
            lambda value: value in {3.0, 5.0},
            5.0,
            "without setpoints it hovers, with or without a remote control",
        ),
        _Rule(
            "COM_OF_LOSS_T",
            lambda value: 0.5 <= value <= 5.0,
            1.0,
            "it outlasts a hiccup of the radio, and no more",
        ),
    )


def parameters_of(autopilot: str) -> tuple[str, ...]:
    """Names of the parameters that decide, by autopilot; none for one that is not known."""
    if autopilot not in RETURN_ALTITUDE:
        return ()
    return (*(rule.parameter for rule in _rules(autopilot, 0)), RETURN_ALTITUDE[autopilot])


def unsafe(
    crafts: Sequence[Craft], *, gcs_sysid: int, separation_m: float, ceiling_amsl_m: float
) -> list[Unsafe]:
    """What would keep the swarm from coming home safely and apart by itself.

    Args:
        crafts: The vehicles.
        gcs_sysid: This controller's own system id.
        separation_m: Least difference between the altitudes of two returns, m.
        ceiling_amsl_m: Greatest altitude, m.

    Returns:
        Every unsafe parameter, in the order of the vehicles.
    """
    found = [
        Unsafe(craft.sysid, rule.parameter, craft.values[rule.parameter], rule.right, rule.why)
        for craft in crafts
        for rule in _rules(craft.autopilot, gcs_sysid)
        if rule.parameter in craft.values and not rule.is_safe(craft.values[rule.parameter])
    ]
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
                )
            )
    return found
