"""Commands that every flight stack takes in the same form."""

from __future__ import annotations

import math
from collections.abc import Callable

from swarmctl.commands import Arm, Command, Disarm, RequestHome, RequestVersion, StreamTelemetry
from swarmctl.events import Heartbeat, LandedState
from swarmctl.link.codec.messages import CommandLong, DataStream, MavCmd, MessageId
from swarmctl.link.command_request import Request, State

_EXTENDED_STATUS, _POSITION, _EXTRA1, _EXTRA3 = 2, 6, 10, 12
"""MAV_DATA_STREAMs."""

CUSTOM_MODE_ENABLED = 1.0
"""MAV_MODE_FLAG_CUSTOM_MODE_ENABLED."""


def common_request(command: Command, reduced: tuple[int, ...] = ()) -> Request | None:
    """The request for a command that is the same everywhere; None if it is not.

    Each inquiry has an older form too, for a vehicle that does not take the newer one. What the
    vehicle then streams counts, whichever form brought it about.

    Args:
        command: The command.
        reduced: Ids of messages that come fast, unasked and unneeded: with the telemetry, they
            are asked for at 1 Hz, which a vehicle may refuse.
    """
    match command:
        case Arm():
            step = CommandLong(MavCmd.COMPONENT_ARM_DISARM, (1.0,))
            return Request(command.kind, (step,), _shows_armed(True), needs_state=True)
        case Disarm():
            step = CommandLong(MavCmd.COMPONENT_ARM_DISARM, (0.0,))
            return Request(command.kind, (step,), _shows_armed(False), needs_state=True)
        case StreamTelemetry():
            slowed = tuple(_interval(message, 1.0) for message in reduced)
            wanted = _wanted(command.position_hz)
            steps = tuple(_interval(message, rate_hz) for message, rate_hz, _ in wanted)
            streams = tuple(
                None if stream is None else DataStream(stream, math.ceil(rate_hz))
                for _, rate_hz, stream in wanted
            )
            return Request(command.kind, steps, optional=slowed, instead=streams)
        case RequestHome():
            home = CommandLong(MavCmd.GET_HOME_POSITION, ())
            return Request(command.kind, (_ask_for(MessageId.HOME_POSITION),), instead=(home,))
        case RequestVersion():
            version = CommandLong(MavCmd.REQUEST_AUTOPILOT_CAPABILITIES, (1.0,))
            return Request(
                command.kind, (_ask_for(MessageId.AUTOPILOT_VERSION),), instead=(version,)
            )
        case _:
            return None


def not_above_home(alt_amsl_m: float, home_alt_amsl_m: float) -> str:
    """Why a vehicle cannot be asked to take off to an altitude, m."""
    return f"{alt_amsl_m:.1f} m AMSL is not above its home at {home_alt_amsl_m:.1f} m AMSL"


def shows_mode(mode_name: str) -> Callable[[State], bool]:
    """Whether a heartbeat shows the mode of this name."""
    return lambda state: isinstance(state, Heartbeat) and state.mode_name == mode_name


def shows_airborne(state: State) -> bool:
    """Whether a landed state shows that the vehicle has left the ground."""
    return isinstance(state, LandedState) and state.state in {"taking_off", "in_air"}


def _shows_armed(armed: bool) -> Callable[[State], bool]:
    return lambda state: isinstance(state, Heartbeat) and state.armed is armed


def _wanted(position_hz: float) -> tuple[tuple[MessageId, float, int | None], ...]:
    """The messages that the controller needs, the most needed first, with rate (Hz) and stream.

    The streams are ArduPilot's. Home and landed state are in no stream: home is asked for by
    itself, and a flight can do without the landed state.
    """
    return (
        (MessageId.GLOBAL_POSITION_INT, position_hz, _POSITION),
        (MessageId.SYSTEM_TIME, 1.0, _EXTRA3),
        (MessageId.HOME_POSITION, 0.2, None),
        (MessageId.SYS_STATUS, 1.0, _EXTENDED_STATUS),
        (MessageId.GPS_RAW_INT, 1.0, _EXTENDED_STATUS),
        (MessageId.EXTENDED_SYS_STATE, 2.0, None),
        (MessageId.ATTITUDE, 2.0, _EXTRA1),
    )


def _interval(message_id: int, rate_hz: float) -> CommandLong:
    return CommandLong(
        MavCmd.SET_MESSAGE_INTERVAL, (float(message_id), float(round(1e6 / rate_hz)))
    )


def _ask_for(message: MessageId) -> CommandLong:
    return CommandLong(MavCmd.REQUEST_MESSAGE, (float(message),))
