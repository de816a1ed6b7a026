"""What ArduCopter's parameters should be for a swarm without pilots (meanings as of 4.7)."""

from __future__ import annotations

import math
from collections.abc import Callable

from swarmctl.mission.failsafes.rules import (
    Check,
    Demands,
    Ok,
    OperatorDecides,
    Rule,
    RuleClass,
    Values,
    Verdict,
    always,
    as_bits,
    at_least,
    not_positive,
    one_of,
    our_sysid,
    positive_or,
    with_bits,
    within,
    without_bits,
)

RETURN_ALTITUDE = "RTL_ALT_M"
"""The parameter with the least altitude of a return above home, m."""

FENCE_CEILING, FENCE_CIRCLE, FENCE_UPLOADED = 1, 2, 4
"""Bits of FENCE_TYPE: greatest altitude, circle round home, uploaded circles and polygons."""
_FENCE = ("FENCE_ENABLE", "FENCE_AUTOENABLE", "FENCE_TYPE", "FENCE_MARGIN")

_NEVER_TERMINATES = "its motors do not stop in flight"


def _is_fence_on(values: Values) -> bool:
    return values.get("FENCE_ENABLE") == 1.0 or values.get("FENCE_AUTOENABLE", 0.0) > 0.0


def fence_beyond(needed: Callable[[Demands], float], kind: int, why: str) -> Check:
    """A fence of one kind, by its bit of FENCE_TYPE, is right if it is off or far enough out."""

    def check(value: float, others: Values, demands: Demands) -> Verdict:
        if not (_is_fence_on(others) and as_bits(others.get("FENCE_TYPE", math.nan)) & kind):
            return Ok()
        # The vehicle is held back this far inside its fence.
        margin_m = others.get("FENCE_MARGIN", 0.0)
        return Ok() if value - margin_m >= needed(demands) else OperatorDecides(why)

    return check


def acts_at_uploaded_fence(why: str) -> Check:
    """FENCE_TYPE is right if the vehicle minds an uploaded fence, or none is uploaded."""

    def check(value: float, others: Values, demands: Demands) -> Verdict:
        minds = _is_fence_on(others) and as_bits(value) & FENCE_UPLOADED
        return Ok() if minds or not demands.is_fenced else OperatorDecides(why)

    return check


RULES = (
    # 3 and 4 retrace each vehicle's own path, which may cross another's; 5 and 7 land it.
    Rule("FS_GCS_ENABLE", always(1.0, "it returns home when its ground station falls silent")),
    # At 1 Hz, a radio that loses one heartbeat in five loses five in a row every hour.
    Rule(
        "FS_GCS_TIMEOUT",
        within(10.0, 60.0, 10.0, "a lossy radio is no lost ground station"),
        optional=True,
    ),
    Rule("MAV_GCS_SYSID", our_sysid("this controller is the ground station it listens for")),
    # It climbs this much before it returns, wherever it is.
    Rule(
        "RTL_CLIMB_MIN_M",
        not_positive("it returns at its own altitude, apart from the others"),
        optional=True,
    ),
    # 0 flies on by a wrong position; 2 gives control to a stick that nobody holds.
    Rule(
        "FS_EKF_ACTION",
        one_of({1.0, 3.0}, 1.0, "it lands when it does not know where it is, without a pilot"),
    ),
    # Bits 4 and 5 take position and velocity out of the control loop.
    Rule(
        "GUID_OPTIONS",
        without_bits(16 | 32, "it keeps to the position and the velocity of our setpoints"),
        optional=True,
    ),
    Rule("WP_SPD", at_least(lambda demands: demands.speed_mps, "it can fly limits.max_speed_mps")),
    Rule(
        "WP_ACC",
        at_least(
            lambda demands: demands.acceleration_mps2,
            "it keeps up with limits.max_acceleration_mps2",
        ),
        RuleClass.RECOMMENDED,
    ),
    # Bit 2 excepts GUIDED. With FS_THR_ENABLE = 0 nothing acts on the loss anyway.
    Rule(
        "FS_OPTIONS",
        with_bits(
            4,
            "in GUIDED it flies on when it loses a remote control",
            unless=("FS_THR_ENABLE", 0.0),
        ),
        RuleClass.RECOMMENDED,
        needs=("FS_THR_ENABLE",),
    ),
    # 5 stops the motors.
    Rule("BATT_FS_LOW_ACT", one_of({0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 7.0}, 2.0, _NEVER_TERMINATES)),
    Rule("BATT_FS_CRT_ACT", one_of({0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 7.0}, 1.0, _NEVER_TERMINATES)),
    # When this acts depends on the battery, so swarmctl does not switch it on.
    Rule(
        "BATT_FS_LOW_ACT",
        always(2.0, "it returns home by itself when its battery is low"),
        RuleClass.REPORT_ONLY,
    ),
    Rule(
        "BATT_LOW_VOLT",
        positive_or(
            "BATT_LOW_MAH", "and BATT_LOW_MAH, too, so its own battery failsafe never acts"
        ),
        RuleClass.REPORT_ONLY,
        needs=("BATT_LOW_MAH",),
    ),
    Rule(
        "FENCE_ALT_MAX",
        fence_beyond(
            lambda demands: demands.height_m,
            FENCE_CEILING,
            "and the mission flies higher above its home: its own fence would end the flight",
        ),
        RuleClass.OPERATOR_ONLY,
        needs=_FENCE,
        optional=True,
    ),
    Rule(
        "FENCE_RADIUS",
        fence_beyond(
            lambda demands: demands.reach_m,
            FENCE_CIRCLE,
            "and the mission may take it farther from its home, where that fence acts",
        ),
        RuleClass.REPORT_ONLY,
        needs=_FENCE,
        optional=True,
    ),
    Rule(
        "FENCE_TYPE",
        acts_at_uploaded_fence(
            "so it does not mind the fence uploaded to it: FENCE_ENABLE must be 1, and 4 in"
            " FENCE_TYPE"
        ),
        RuleClass.REPORT_ONLY,
        needs=_FENCE,
        optional=True,
    ),
)
"""ArduCopter's rules, in the order in which they are checked and told."""
