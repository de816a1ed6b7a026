"""ArduCopter: its mode numbers, how it wants to be asked, and what it does when left alone.

Measured on ArduCopter 4.7-dev SITL; the mode numbers are MAVLink's COPTER_MODE.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import assert_never

from swarmctl.events import (
    Arm,
    Command,
    Disarm,
    Heartbeat,
    LandedState,
    Mode,
    RequestHome,
    RequestVersion,
    SetMode,
    StreamTelemetry,
    TakeOff,
)
from swarmctl.link.exchange import Request, State
from swarmctl.link.facts import CommandLong, MavCmd, MessageId

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

_CUSTOM_MODE_ENABLED = 1.0
"""MAV_MODE_FLAG_CUSTOM_MODE_ENABLED."""


def mode_of(custom_mode: int) -> tuple[Mode, str]:
    """Mode and name of a HEARTBEAT's ``custom_mode``."""
    return _MODES.get(custom_mode, Mode.OTHER), MODE_NAMES.get(custom_mode, str(custom_mode))


def request_for(command: Command, home_alt_amsl_m: float | None) -> Request | str:
    """How to ask for a command.

    Args:
        command: The command.
        home_alt_amsl_m: Altitude of the vehicle's home, m; None while it is not known.

    Returns:
        The request; or, if the vehicle cannot be asked for this, why not.
    """
    name = type(command).__name__
    match command:
        case SetMode():
            number = _MODE_NUMBERS.get(command.mode)
            if number is None:
                return f"ArduCopter has no mode that is called {command.mode} here"
            step = CommandLong(MavCmd.DO_SET_MODE, (_CUSTOM_MODE_ENABLED, float(number)))
            return Request(name, (step,), _shows_mode(MODE_NAMES[number]), needs_state=True)
        case Arm():
            step = CommandLong(MavCmd.COMPONENT_ARM_DISARM, (1.0,))
            return Request(name, (step,), _shows_armed(True), needs_state=True)
        case Disarm():
            step = CommandLong(MavCmd.COMPONENT_ARM_DISARM, (0.0,))
            return Request(name, (step,), _shows_armed(False), needs_state=True)
        case TakeOff():
            if home_alt_amsl_m is None:
                return "its HOME_POSITION, which a take-off altitude counts from, is not known yet"
            climb_m = command.alt_amsl_m - home_alt_amsl_m
            if not climb_m > 0.0:
                return (
                    f"{command.alt_amsl_m:.1f} m AMSL is not above its home "
                    f"at {home_alt_amsl_m:.1f} m AMSL"
                )
            step = CommandLong(MavCmd.NAV_TAKEOFF, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, climb_m))
            return Request(name, (step,), _shows_airborne)
        case StreamTelemetry():
            return Request(name, _streams(command.position_hz))
        case RequestHome():
            return Request(name, (_ask_for(MessageId.HOME_POSITION),))
        case RequestVersion():
            return Request(name, (_ask_for(MessageId.AUTOPILOT_VERSION),))
        case _:
            return f"ArduCopter has no command for {name}"


def after_controller_stops(mode: Mode, armed: bool) -> str:
    """What the vehicle does by itself when no more setpoints come, as a sentence's predicate.

    Args:
        mode: Its mode at that moment.
        armed: Whether it is armed.

    Returns:
        For example ``"lands where it is and disarms"``.
    """
    if not armed:
        return "stays where it is with its motors off"
    match mode:
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


def _streams(position_hz: float) -> tuple[CommandLong, ...]:
    """Every stream is off by default, so each is asked for, the most needed first."""
    rates_hz = (
        (MessageId.GLOBAL_POSITION_INT, position_hz),
        (MessageId.SYSTEM_TIME, 1.0),
        (MessageId.HOME_POSITION, 0.2),
        (MessageId.SYS_STATUS, 1.0),
        (MessageId.GPS_RAW_INT, 1.0),
        (MessageId.EXTENDED_SYS_STATE, 2.0),
        (MessageId.ATTITUDE, 2.0),
    )
    return tuple(
        CommandLong(MavCmd.SET_MESSAGE_INTERVAL, (float(message), round(1e6 / rate_hz)))
        for message, rate_hz in rates_hz
    )


def _ask_for(message: MessageId) -> CommandLong:
    return CommandLong(MavCmd.REQUEST_MESSAGE, (float(message),))


def _shows_mode(mode_name: str) -> Callable[[State], bool]:
    return lambda state: isinstance(state, Heartbeat) and state.mode_name == mode_name


def _shows_armed(armed: bool) -> Callable[[State], bool]:
    return lambda state: isinstance(state, Heartbeat) and state.armed is armed


def _shows_airborne(state: State) -> bool:
    return isinstance(state, LandedState) and state.state in {"taking_off", "in_air"}
