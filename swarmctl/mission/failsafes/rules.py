"""What the vehicles' parameters should be for a swarm without pilots: one table per autopilot.

Parameters go by their newest names and units; the link knows the older ones. Meanings: ArduCopter
4.7 and PX4 v1.16.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum, auto


@dataclass(frozen=True)
class Demands:
    """What a mission asks of a vehicle.

    Attributes:
        gcs_sysid: This controller's own system id.
        speed_mps: Greatest ground speed commanded, m/s.
        acceleration_mps2: Greatest acceleration commanded, m/s².
        height_m: Above its home, m.
        reach_m: Greatest horizontal distance from its home, m.
        is_fenced: Whether it is given a fence.
    """

    gcs_sysid: int
    speed_mps: float
    acceleration_mps2: float
    height_m: float
    reach_m: float
    is_fenced: bool


class Weight(Enum):
    """What becomes of a parameter that is not right."""

    MUST = auto()
    """It is set if the operator consents; if not, nothing is started."""
    OWN = auto()
    """Nothing is started: it bounds the flight, so to widen it is the operator's own."""
    BETTER = auto()
    """It is set if the operator consents; if not, it is said."""
    KNOWN = auto()
    """It is said: what is right is not for us to decide."""


Right = Callable[[float, Mapping[str, float], Demands], float]
"""What a parameter should be: of its value, all that is known of the others, and the demands. The
value itself if it is right; not a number if it is wrong, but what is right depends."""


@dataclass(frozen=True)
class Rule:
    """What one parameter should be.

    Attributes:
        parameter: Its name.
        right: Tells the right value.
        why: What the right value does, as a clause.
        weight: What becomes of it if it is not right.
        needs: Other parameters that ``right`` looks at.
        optional: Whether some firmware does not have it, or what it needs; what that does
            instead is right.
    """

    parameter: str
    right: Right
    why: str
    weight: Weight = Weight.MUST
    needs: tuple[str, ...] = ()
    optional: bool = False


def _always(right: float) -> Right:
    return lambda value, others, demands: right


def _among(allowed: set[float], right: float) -> Right:
    return lambda value, others, demands: value if value in allowed else right


def _within(least: float, greatest: float, right: float) -> Right:
    return lambda value, others, demands: value if least <= value <= greatest else right


def _at_least(needed: Callable[[Demands], float]) -> Right:
    def right(value: float, _others: Mapping[str, float], demands: Demands) -> float:
        least = needed(demands)
        # A value that went through another unit as a 32-bit float.
        return value if value >= least * (1.0 - 1e-6) else float(math.ceil(least))

    return right


def _bits(value: float) -> int:
    return int(value) if math.isfinite(value) and value >= 0.0 else 0


def _without_bits(bits: int) -> Right:
    return lambda value, others, demands: float(_bits(value) & ~bits)


def _with_bits(bits: int, unless: tuple[str, float]) -> Right:
    name, excused = unless

    def right(value: float, others: Mapping[str, float], _demands: Demands) -> float:
        return value if others.get(name) == excused else float(_bits(value) | bits)

    return right


def _positive_or(other: str) -> Right:
    def right(value: float, others: Mapping[str, float], _demands: Demands) -> float:
        return value if value > 0.0 or others.get(other, 0.0) > 0.0 else math.nan

    return right


def _is_fence_on(values: Mapping[str, float]) -> bool:
    return values.get("FENCE_ENABLE") == 1.0 or values.get("FENCE_AUTOENABLE", 0.0) > 0.0


def _beyond(needed: Callable[[Demands], float], kind: int) -> Right:
    """For ArduCopter's fence of one kind, by its bit: far enough out, or off."""

    def right(value: float, others: Mapping[str, float], demands: Demands) -> float:
        if not (_is_fence_on(others) and _bits(others.get("FENCE_TYPE", math.nan)) & kind):
            return value
        # It holds back so far inside.
        margin_m = others.get("FENCE_MARGIN", 0.0)
        return value if value - margin_m >= needed(demands) else math.nan

    return right


def _beyond_or_off(needed: Callable[[Demands], float]) -> Right:
    """For PX4's: 0 is none, and actions 0 and 1 do nothing about it."""

    def right(value: float, others: Mapping[str, float], demands: Demands) -> float:
        acts = others.get("GF_ACTION", 0.0) > 1.0
        return math.nan if acts and 0.0 < value < needed(demands) else value

    return right


def _minds_a_fence(value: float, others: Mapping[str, float], demands: Demands) -> float:
    minded = _is_fence_on(others) and _bits(value) & 4
    return value if minded or not demands.is_fenced else math.nan


def _acts_at_a_fence(value: float, _others: Mapping[str, float], demands: Demands) -> float:
    return math.nan if demands.is_fenced and value < 2.0 else value


_BELOW_ITS_FENCE = "and the mission flies higher above its home: its own fence would end the flight"
_WITHIN_ITS_FENCE = "and the mission may take it farther from its home, where that fence acts"
_RETURNS_WITHOUT_GCS = "it returns home when its ground station falls silent"
_RETURNS_BEFORE_EMPTY = "it returns home by itself when its battery is low"
_NEVER_TERMINATES = "its motors do not stop in flight"
_FAST_ENOUGH = "it can fly limits.max_speed_mps"

_FENCE = ("FENCE_ENABLE", "FENCE_AUTOENABLE", "FENCE_TYPE", "FENCE_MARGIN")

ARDUPILOT = (
    # 3 and 4 retrace each vehicle's own path, which may cross another's; 5 and 7 land it.
    Rule("FS_GCS_ENABLE", _always(1.0), _RETURNS_WITHOUT_GCS),
    # At 1 Hz, a radio that loses one heartbeat in five loses five in a row every hour.
    Rule(
        "FS_GCS_TIMEOUT",
        _within(10.0, 60.0, 10.0),
        "a lossy radio is no lost ground station",
        optional=True,
    ),
    Rule(
        "MAV_GCS_SYSID",
        lambda value, others, demands: float(demands.gcs_sysid),
        "this controller is the ground station it listens for",
    ),
    # It climbs so much before it returns, wherever it is.
    Rule(
        "RTL_CLIMB_MIN_M",
        lambda value, others, demands: value if value <= 0.0 else 0.0,
        "it returns at its own altitude, apart from the others",
        optional=True,
    ),
    # 0 flies on by a position that is wrong, 2 hands it to a stick that nobody holds.
    Rule(
        "FS_EKF_ACTION",
        _among({1.0, 3.0}, 1.0),
        "it lands when it does not know where it is, without a pilot",
    ),
    # Bits 4 and 5 take position and velocity out of the control loop.
    Rule(
        "GUID_OPTIONS",
        _without_bits(16 | 32),
        "it keeps to the position and the velocity of our setpoints",
        optional=True,
    ),
    Rule("WP_SPD", _at_least(lambda demands: demands.speed_mps), _FAST_ENOUGH),
    Rule(
        "WP_ACC",
        _at_least(lambda demands: demands.acceleration_mps2),
        "it keeps up with limits.max_acceleration_mps2",
        Weight.BETTER,
    ),
    # Without FS_THR_ENABLE nothing acts on that loss; bit 2 excepts GUIDED.
    Rule(
        "FS_OPTIONS",
        _with_bits(4, unless=("FS_THR_ENABLE", 0.0)),
        "in GUIDED it flies on when it loses a remote control",
        Weight.BETTER,
        needs=("FS_THR_ENABLE",),
    ),
    Rule("BATT_FS_LOW_ACT", _among({0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 7.0}, 2.0), _NEVER_TERMINATES),
    Rule("BATT_FS_CRT_ACT", _among({0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 7.0}, 1.0), _NEVER_TERMINATES),
    # When it acts depends on the battery, so it is not for us to switch it on.
    Rule("BATT_FS_LOW_ACT", _among({2.0}, 2.0), _RETURNS_BEFORE_EMPTY, Weight.KNOWN),
    Rule(
        "BATT_LOW_VOLT",
        _positive_or("BATT_LOW_MAH"),
        "and BATT_LOW_MAH, too, so its own battery failsafe never acts",
        Weight.KNOWN,
        needs=("BATT_LOW_MAH",),
    ),
    Rule(
        "FENCE_ALT_MAX",
        _beyond(lambda demands: demands.height_m, kind=1),
        _BELOW_ITS_FENCE,
        Weight.OWN,
        needs=_FENCE,
        optional=True,
    ),
    Rule(
        "FENCE_RADIUS",
        _beyond(lambda demands: demands.reach_m, kind=2),
        _WITHIN_ITS_FENCE,
        Weight.KNOWN,
        needs=_FENCE,
        optional=True,
    ),
    Rule(
        "FENCE_TYPE",
        _minds_a_fence,
        "so it does not mind the fence uploaded to it: FENCE_ENABLE must be 1, and 4 in FENCE_TYPE",
        Weight.KNOWN,
        needs=_FENCE,
        optional=True,
    ),
)
"""ArduCopter's."""

PX4 = (
    Rule("NAV_DLL_ACT", _always(2.0), _RETURNS_WITHOUT_GCS),
    Rule(
        "COM_OBL_RC_ACT",
        _among({3.0, 5.0}, 5.0),
        "without setpoints it hovers, with or without a remote control",
    ),
    # Until 1.13 in place of COM_OBL_RC_ACT where no remote control is there, or none is needed.
    Rule(
        "COM_OBL_ACT",
        _among({1.0, 2.0}, 1.0),
        "without setpoints and a remote control it hovers",
        optional=True,
    ),
    Rule(
        "COM_OF_LOSS_T",
        _within(0.5, 5.0, 1.0),
        "it outlasts a hiccup of the radio, and no more",
    ),
    # 5 terminates the flight, 6 stops the motors.
    Rule("NAV_RCL_ACT", _among({0.0, 1.0, 2.0, 3.0}, 2.0), _NEVER_TERMINATES),
    # With COM_RC_IN_MODE 4 there is no stick to lose; bit 2 excepts OFFBOARD.
    Rule(
        "COM_RCL_EXCEPT",
        _with_bits(4, unless=("COM_RC_IN_MODE", 4.0)),
        "in OFFBOARD it flies on without a remote control",
        Weight.BETTER,
        needs=("COM_RC_IN_MODE",),
    ),
    # When it acts is in per cent, and the same for every battery.
    Rule("COM_LOW_BAT_ACT", _among({3.0}, 3.0), _RETURNS_BEFORE_EMPTY, Weight.BETTER),
    # OFFBOARD is not bound by MPC_XY_CRUISE.
    Rule("MPC_XY_VEL_MAX", _at_least(lambda demands: demands.speed_mps), _FAST_ENOUGH),
    Rule(
        "GF_MAX_VER_DIST",
        _beyond_or_off(lambda demands: demands.height_m),
        _BELOW_ITS_FENCE,
        Weight.OWN,
        needs=("GF_ACTION",),
        optional=True,
    ),
    Rule(
        "GF_MAX_HOR_DIST",
        _beyond_or_off(lambda demands: demands.reach_m),
        _WITHIN_ITS_FENCE,
        Weight.KNOWN,
        needs=("GF_ACTION",),
        optional=True,
    ),
    Rule(
        "GF_ACTION",
        _acts_at_a_fence,
        "so it does nothing at the fence uploaded to it: 2 would hold it, 3 bring it home",
        Weight.KNOWN,
        optional=True,
    ),
)
"""PX4's."""

RULES = {"ardupilot": ARDUPILOT, "px4": PX4}
"""By the name that Heartbeat gives the autopilot."""
