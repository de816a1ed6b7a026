"""ArduCopter: its mode numbers, how it is asked, and what it does without a controller.

Measured on ArduCopter 4.7-dev SITL; the mode numbers are MAVLink's COPTER_MODE.
"""

from __future__ import annotations

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

NAME = "ArduCopter"
GUIDED_BY_STREAM = False
BYTEWISE_PARAMETERS = False

MODE_NAMES = {
    0: "STABILIZE",
    1: "ACRO",
    2: "ALT_HOLD",
    3: "AUTO",
    4: "GUIDED",
    5: "LOITER",
    6: "RTL",
    7: "CIRCLE",
    9: "LAND",
    11: "DRIFT",
    13: "SPORT",
    14: "FLIP",
    15: "AUTOTUNE",
    16: "POSHOLD",
    17: "BRAKE",
    18: "THROW",
    19: "AVOID_ADSB",
    20: "GUIDED_NOGPS",
    21: "SMART_RTL",
    22: "FLOWHOLD",
    23: "FOLLOW",
    24: "ZIGZAG",
    25: "SYSTEMID",
    26: "AUTOROTATE",
    27: "AUTO_RTL",
    28: "TURTLE",
}
"""Name of each ``custom_mode``."""

# HOLD is BRAKE, not LOITER: without RC, LOITER takes the missing throttle for a descent.
_MODE_NUMBERS = {Mode.GUIDED: 4, Mode.LAND: 9, Mode.RETURN: 6, Mode.HOLD: 17}
_MODES = {number: mode for mode, number in _MODE_NUMBERS.items()} | {
    21: Mode.RETURN,
    27: Mode.RETURN,
}

_EARLIER_SPELLINGS = {
    "MAV_SYSID": Spelling("SYSID_THISMAV"),
    "MAV_GCS_SYSID": Spelling("SYSID_MYGCS"),
    "RTL_ALT_M": Spelling("RTL_ALT", 0.01),
    "RTL_CLIMB_MIN_M": Spelling("RTL_CLIMB_MIN", 0.01),
    "WP_SPD": Spelling("WPNAV_SPEED", 0.01),
    "WP_ACC": Spelling("WPNAV_ACCEL", 0.01),
}
"""Names of parameters in firmware before 4.7."""


def mode_of(custom_mode: int) -> tuple[Mode, str]:
    """Mode and name of a HEARTBEAT's ``custom_mode``."""
    return _MODES.get(custom_mode, Mode.OTHER), MODE_NAMES.get(custom_mode, str(custom_mode))


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
            number = _MODE_NUMBERS.get(command.mode)
            if number is None:
                return f"ArduCopter has no mode that is called {command.mode} here"
            step = CommandLong(MavCmd.DO_SET_MODE, (CUSTOM_MODE_ENABLED, float(number)))
            return Request(command.kind, (step,), shows_mode(MODE_NAMES[number]), needs_state=True)
        case TakeOff():
            if home_alt_amsl_m is None:
                return "its HOME_POSITION, which a take-off altitude counts from, is not known yet"
            climb_m = command.alt_amsl_m - home_alt_amsl_m
            if not climb_m > 0.0:
                return not_above_home(command.alt_amsl_m, home_alt_amsl_m)
            step = CommandLong(MavCmd.NAV_TAKEOFF, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, climb_m))
            return Request(command.kind, (step,), shows_airborne)
        case _:
            request = common_request(command)
            return request or f"ArduCopter has no command for {command.kind}"


def spellings(parameter: str) -> tuple[Spelling, ...]:
    """Every name that a parameter has had, the newest first."""
    earlier = _EARLIER_SPELLINGS.get(parameter)
    newest = Spelling(parameter)
    return (newest,) if earlier is None else (newest, earlier)


def after_controller_stops(mode: Mode, armed: bool, parameters: Mapping[str, float]) -> str:
    """What the vehicle does by itself when no more setpoints come, as a sentence's predicate.

    Args:
        mode: Its mode at that moment.
        armed: Whether it is armed.
        parameters: What is known of its parameters, by their newest names.

    Returns:
        For example ``"lands where it is and disarms"``.
    """
    if not armed:
        return "stays where it is with its motors off"
    match mode:
        case Mode.GUIDED if parameters.get("FS_GCS_ENABLE") == 1.0:
            wait_s = parameters.get("FS_GCS_TIMEOUT", 5.0)
            return (
                "brakes about 3 s after the last setpoint and returns to its own home about "
                f"{wait_s:g} s after the last heartbeat of its ground station"
            )
        case Mode.GUIDED:
            return (
                "brakes about 3 s after the last setpoint and hovers there until its battery "
                "failsafe acts (its failsafe on a lost ground station, FS_GCS_ENABLE, is off "
                "unless it was set)"
            )
        case Mode.HOLD:
            return "hovers where it is until its battery failsafe acts"
        case Mode.LAND:
            return "lands where it is and disarms"
        case Mode.RETURN:
            return "returns to its own home, lands there and disarms"
        case Mode.OTHER:
            return "carries on in a mode that was chosen elsewhere and that takes no setpoints"
        case _:
            assert_never(mode)
