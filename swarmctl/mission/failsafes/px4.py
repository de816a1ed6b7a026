"""What PX4's parameters should be for a swarm without pilots (meanings as of v1.16)."""

from __future__ import annotations

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
    at_least,
    one_of,
    with_bits,
    within,
)

RETURN_ALTITUDE = "RTL_RETURN_ALT"
"""The parameter with the least altitude of a return above home, m."""


def fence_beyond(needed: Callable[[Demands], float], why: str) -> Check:
    """A fence is right if it is 0 (none), far enough out, or nothing acts at it."""

    def check(value: float, others: Values, demands: Demands) -> Verdict:
        acts = others.get("GF_ACTION", 0.0) > 1.0  # 0 does nothing, 1 only warns
        return OperatorDecides(why) if acts and 0.0 < value < needed(demands) else Ok()

    return check


def acts_at_uploaded_fence(why: str) -> Check:
    """GF_ACTION is right if the vehicle acts at a fence, or none is uploaded."""

    def check(value: float, _others: Values, demands: Demands) -> Verdict:
        return OperatorDecides(why) if demands.is_fenced and value < 2.0 else Ok()

    return check


RULES = (
    Rule("NAV_DLL_ACT", always(2.0, "it returns home when its ground station falls silent")),
    Rule(
        "COM_OBL_RC_ACT",
        one_of({3.0, 5.0}, 5.0, "without setpoints it hovers, with or without a remote control"),
    ),
    # Until 1.13 in place of COM_OBL_RC_ACT where no remote control is there, or none is needed.
    Rule(
        "COM_OBL_ACT",
        one_of({1.0, 2.0}, 1.0, "without setpoints and a remote control it hovers"),
        optional=True,
    ),
    Rule(
        "COM_OF_LOSS_T",
        within(0.5, 5.0, 1.0, "it outlasts a hiccup of the radio, and no more"),
    ),
    # 5 terminates the flight, 6 stops the motors.
    Rule("NAV_RCL_ACT", one_of({0.0, 1.0, 2.0, 3.0}, 2.0, "its motors do not stop in flight")),
    # Bit 2 excepts OFFBOARD. With COM_RC_IN_MODE = 4 there is no stick to lose.
    Rule(
        "COM_RCL_EXCEPT",
        with_bits(
            4,
            "in OFFBOARD it flies on without a remote control",
            unless=("COM_RC_IN_MODE", 4.0),
        ),
        RuleClass.RECOMMENDED,
        needs=("COM_RC_IN_MODE",),
    ),
    # When this acts is in per cent, and the same for every battery.
    Rule(
        "COM_LOW_BAT_ACT",
        always(3.0, "it returns home by itself when its battery is low"),
        RuleClass.RECOMMENDED,
    ),
    # MPC_XY_CRUISE does not bound OFFBOARD.
    Rule(
        "MPC_XY_VEL_MAX",
        at_least(lambda demands: demands.speed_mps, "it can fly limits.max_speed_mps"),
    ),
    Rule(
        "GF_MAX_VER_DIST",
        fence_beyond(
            lambda demands: demands.height_m,
            "and the mission flies higher above its home: its own fence would end the flight",
        ),
        RuleClass.OPERATOR_ONLY,
        needs=("GF_ACTION",),
        optional=True,
    ),
    Rule(
        "GF_MAX_HOR_DIST",
        fence_beyond(
            lambda demands: demands.reach_m,
            "and the mission may take it farther from its home, where that fence acts",
        ),
        RuleClass.REPORT_ONLY,
        needs=("GF_ACTION",),
        optional=True,
    ),
    Rule(
        "GF_ACTION",
        acts_at_uploaded_fence(
            "so it does nothing at the fence uploaded to it: 2 would hold it, 3 bring it home"
        ),
        RuleClass.REPORT_ONLY,
        optional=True,
    ),
)
"""PX4's rules, in the order in which they are checked and told."""
