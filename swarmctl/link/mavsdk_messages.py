"""MAVLink messages as MAVSDK's MavlinkDirect plugin has them: a name and its fields in JSON.

A number that is not finite is ``null`` there, in both directions. Field names and units are
those of https://mavlink.io/en/messages/common.html.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any

import msgspec

from swarmctl.commands import GoTo
from swarmctl.link.codec import decoding
from swarmctl.link.codec.messages import (
    AUTOPILOT_COMPONENT,
    CommandLong,
    DataStream,
    Fault,
    Message,
    MessageId,
    ParameterMessage,
)

_GLOBAL_INT = 5
"""MAV_FRAME_GLOBAL_INT: altitudes AMSL."""
_POSITION_AND_VELOCITY = 3520
"""POSITION_TARGET_TYPEMASK: acceleration, yaw and yaw rate are ignored."""
_E7_PER_RAD = 1.0 / math.radians(1e-7)

MESSAGES = tuple(message.name for message in MessageId if not message.name.startswith("MISSION"))
"""Names of the messages that are read: all but those of a fence's upload."""


def read(name: str, fields: str, sysid: int, received_s: float) -> Message | Fault | None:
    """Decode a message.

    Args:
        name: One of :data:`MESSAGES`.
        fields: Its fields as JSON.
        sysid: System id of the sender.
        received_s: Monotonic time of arrival, s.

    Returns:
        As :func:`swarmctl.link.codec.decoding.read`.
    """
    try:
        values = msgspec.json.decode(fields, type=dict[str, Any])
        if name == MessageId.PARAM_VALUE.name:
            return _parameter(values)
        plain = {field: _plain(value) for field, value in values.items()}
        return decoding.from_fields(MessageId[name], plain, sysid, received_s)
    except (ValueError, TypeError, LookupError, OverflowError) as error:
        return Fault("implausible", f"{name} of vehicle {sysid} is not usable: {error}")


def _plain(value: object) -> object:
    """A field as the codec expects it: NaN for null, bytes for text."""
    if value is None:
        return math.nan
    return value.encode() if isinstance(value, str) else value


def _parameter(values: Mapping[str, Any]) -> ParameterMessage | None:
    value = values["param_value"]
    if value is None:  # the bytes of a NaN, or of an integer that looks like one
        return None
    return ParameterMessage(values["param_id"], struct.pack("<f", value), values["param_type"])


# --- Sent ------------------------------------------------------------------------------


def _fields(target: int, **fields: float | str) -> str:
    to = {"target_system": target, "target_component": AUTOPILOT_COMPONENT}
    return _encode(to | fields)


def _encode(fields: dict[str, Any]) -> str:
    return msgspec.json.encode(fields).decode()  # NaN becomes null


def command_long(target: int, command: CommandLong, confirmation: int) -> str:
    """Fields of COMMAND_LONG to the autopilot of system ``target``."""
    params = command.params + (0.0,) * (7 - len(command.params))
    return _fields(
        target,
        command=int(command.command),
        confirmation=confirmation,
        **{f"param{number}": param for number, param in enumerate(params, 1)},
    )


def request_data_stream(target: int, wanted: DataStream) -> str:
    """REQUEST_DATA_STREAM of the autopilot of system ``target``."""
    return _fields(
        target, req_stream_id=wanted.stream, req_message_rate=wanted.rate_hz, start_stop=1
    )


def param_request_read(target: int, name: str) -> str:
    """Fields of PARAM_REQUEST_READ of a parameter by its name."""
    return _fields(target, param_id=name, param_index=-1)


def param_set(target: int, name: str, raw: bytes, kind: int) -> str | None:
    """Fields of PARAM_SET; None where the value's bytes are a NaN's, which JSON cannot carry."""
    (carrier,) = struct.unpack("<f", raw)
    if not math.isfinite(carrier):
        return None
    return _fields(target, param_id=name, param_type=kind, param_value=carrier)


HEARTBEAT = _encode(
    {
        "type": 6,  # MAV_TYPE_GCS
        "autopilot": 8,  # MAV_AUTOPILOT_INVALID
        "base_mode": 0,
        "custom_mode": 0,
        "system_status": 4,  # MAV_STATE_ACTIVE
        "mavlink_version": 3,
    }
)
"""Fields of HEARTBEAT of a ground station."""


def timesync(asked_ns: int) -> str:
    """Fields of TIMESYNC that asks for the time since boot."""
    return _encode({"tc1": 0, "ts1": asked_ns})


def setpoint(goto: GoTo, now: float) -> str:
    """Fields of SET_POSITION_TARGET_GLOBAL_INT: altitude AMSL, position and velocity used."""
    east, north, up = goto.velocity_enu
    return _fields(
        goto.sysid,
        time_boot_ms=int(now * 1e3) & 0xFFFFFFFF,
        coordinate_frame=_GLOBAL_INT,
        type_mask=_POSITION_AND_VELOCITY,
        lat_int=round(goto.lat_rad * _E7_PER_RAD),
        lon_int=round(goto.lon_rad * _E7_PER_RAD),
        alt=goto.alt_amsl_m,
        vx=north,
        vy=east,
        vz=-up,
        **dict.fromkeys(("afx", "afy", "afz", "yaw", "yaw_rate"), 0.0),
    )
