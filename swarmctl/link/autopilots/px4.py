"""PX4: its mode numbers, how it is asked, and what it does without a controller.

Measured on PX4 v1.16 SITL; the mode numbers are ``px4_custom_mode.h`` of PX4-Autopilot.

Its guided mode is OFFBOARD, which needs a stream of setpoints: they must come before the mode is
asked for, they raise the vehicle from the ground, and they must never pause. A vehicle that cannot
enter OFFBOARD therefore never leaves the ground.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import assert_never

from swarmctl.commands import Command, SetMode, TakeOff
from swarmctl.events import Mode
from swarmctl.link.autopilots.common import (
    CUSTOM_MODE_ENABLED,
    common_request,
    not_above_home,
    shows_airborne,
    shows_mode,
)
from swarmctl.link.codec.messages import CommandLong, MavCmd, Spelling
from swarmctl.link.command_request import Request

NAME = "PX4"
GUIDED_BY_STREAM = True
BYTEWISE_PARAMETERS = True

_AUTO = 4
MODE_NAMES = {
    (1, 0): "MANUAL",
    (2, 0): "ALTCTL",
    (3, 0): "POSCTL",
    (3, 1): "POSCTL.ORBIT",
    (3, 2): "POSCTL.SLOW",
    (_AUTO, 1): "AUTO.READY",
    (_AUTO, 2): "AUTO.TAKEOFF",
    (_AUTO, 3): "AUTO.LOITER",
    (_AUTO, 4): "AUTO.MISSION",
    (_AUTO, 5): "AUTO.RTL",
    (_AUTO, 6): "AUTO.LAND",
    (_AUTO, 8): "AUTO.FOLLOW_TARGET",
    (_AUTO, 9): "AUTO.PRECLAND",
    (_AUTO, 10): "AUTO.VTOL_TAKEOFF",
    (5, 0): "ACRO",
    (6, 0): "OFFBOARD",
    (7, 0): "STABILIZED",
    (10, 0): "TERMINATION",
}
"""Name of each main and sub mode."""

_MODE_NUMBERS = {
    Mode.GUIDED: (6, 0),
    Mode.HOLD: (_AUTO, 3),
    Mode.RETURN: (_AUTO, 5),
    Mode.LAND: (_AUTO, 6),
}
_MODES = {numbers: mode for mode, numbers in _MODE_NUMBERS.items()} | {(_AUTO, 9): Mode.LAND}

_FAST_UNASKED = (31, 32, 105, 331)
"""ATTITUDE_QUATERNION, LOCAL_POSITION_NED, HIGHRES_IMU, ODOMETRY: 30 Hz and more each."""

_WITHOUT_SETPOINTS = {
    0.0: "holds its position by the remote control, without one sinking at 0.7 m/s",
    3.0: "returns to its own home, lands there and disarms",
    4.0: "lands where it is and disarms",
    5.0: "hovers",
}
"""What values of COM_OBL_RC_ACT do; the others hand control to a pilot or cut the motors."""


def mode_of(custom_mode: int) -> tuple[Mode, str]:
    """Mode and name of a HEARTBEAT's ``custom_mode``: sub mode << 24 | main mode << 16."""
    numbers = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    name = MODE_NAMES.get(numbers, f"{numbers[0]}.{numbers[1]}")
    return _MODES.get(numbers, Mode.OTHER), name


def request_for(command: Command, home_alt_amsl_m: float | None) -> Request | str:
    """The request for a command.

    Args:
        command: The command.
        home_alt_amsl_m: Altitude of the vehicle's home, m; None while it is not known.

    Returns:
        The request; or, if the vehicle cannot be asked for this, why not.
    """
    match command:
        case SetMode():
            numbers = _MODE_NUMBERS.get(command.mode)
            if numbers is None:
                return f"PX4 has no mode that is called {command.mode} here"
            main, sub = numbers
            step = CommandLong(MavCmd.DO_SET_MODE, (CUSTOM_MODE_ENABLED, float(main), float(sub)))
            # ACCEPTED is not enough: without setpoints the mode stays what it was.
            return Request(command.kind, (step,), shows_mode(MODE_NAMES[numbers]), needs_state=True)
        case TakeOff():
            if home_alt_amsl_m is not None and not command.alt_amsl_m > home_alt_amsl_m:
                return not_above_home(command.alt_amsl_m, home_alt_amsl_m)
            # AMSL; a latitude and longitude of 0 would be a place to go to.
            params = (0.0, 0.0, 0.0, math.nan, math.nan, math.nan, command.alt_amsl_m)
            return Request(command.kind, (CommandLong(MavCmd.NAV_TAKEOFF, params),), shows_airborne)
        case _:
            request = common_request(command, _FAST_UNASKED)
            return request or f"PX4 has no command for {command.kind}"


def spellings(parameter: str) -> tuple[Spelling, ...]:
    """Every name that a parameter has had, the newest first."""
    return (Spelling(parameter),)


def after_controller_stops(mode: Mode, armed: bool, parameters: Mapping[str, float]) -> str:
    """What the vehicle does by itself when no more setpoints come, as a sentence's predicate.

    Args:
        mode: Its mode at that moment.
        armed: Whether it is armed.
        parameters: What is known of its parameters.

    Returns:
        For example ``"lands where it is and disarms"``.
    """
    if not armed:
        return "stays where it is with its motors off"
    match mode:
        case Mode.GUIDED:
            return _after_offboard(parameters)
        case Mode.HOLD:
            return f"hovers where it is{_on_lost_station(parameters)}"
        case Mode.LAND:
            return "lands where it is and disarms"
        case Mode.RETURN:
            return "returns to its own home, lands there and disarms"
        case Mode.OTHER:
            return "carries on in a mode that was chosen elsewhere and that takes no setpoints"
        case _:
            assert_never(mode)


def _after_offboard(parameters: Mapping[str, float]) -> str:
    wait_s = parameters.get("COM_OF_LOSS_T", 1.0)
    action = parameters.get("COM_OBL_RC_ACT")
    if action is None:
        does = "does what its COM_OBL_RC_ACT says"
    else:
        does = _WITHOUT_SETPOINTS.get(action, f"does what COM_OBL_RC_ACT = {action:g} says")
    later = "" if action in {3.0, 4.0} else _on_lost_station(parameters)
    return f"leaves OFFBOARD about {wait_s:g} s after the last setpoint and {does}{later}"


def _on_lost_station(parameters: Mapping[str, float]) -> str:
    if parameters.get("NAV_DLL_ACT") == 2.0:
        return ", and returns to its own home once it misses its ground station (COM_DL_LOSS_T)"
    return (
        " until its battery failsafe acts (its failsafe on a lost ground station, NAV_DLL_ACT, "
        "is off unless it was set)"
    )
