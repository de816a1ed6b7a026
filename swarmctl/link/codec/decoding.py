"""Frames to messages in our terms: which fields of which message are read, and by whom.

:mod:`swarmctl.link.codec.telemetry_decoding` and :mod:`swarmctl.link.codec.answer_decoding` give
the fields their meaning. Decoding is a step of its own behind
:mod:`swarmctl.link.codec.framing`, because a frame that nobody needs is not worth the work.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from operator import itemgetter
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.link.codec import answer_decoding as answers
from swarmctl.link.codec import telemetry_decoding as telemetry
from swarmctl.link.codec.messages import Fault, Frame, Message, MessageId


def read(frame: Frame, received_s: float) -> Message | Fault | None:
    """Decode a frame.

    A message becomes its event at once if its meaning is all on the wire. HEARTBEAT,
    GLOBAL_POSITION_INT, PARAM_VALUE and COMMAND_ACK mean something only together with what is
    known of the vehicle: they stay messages.

    Args:
        frame: A frame from :func:`swarmctl.link.codec.framing.split`.
        received_s: Controller's monotonic time of arrival, s.

    Returns:
        The message; a fault if a field is out of its range; None if nobody needs the message, if
        it says that its value is not known yet, or if it is a HEARTBEAT of anything but a flight
        controller.
    """
    reader = _READERS.get(frame.message_id)
    if reader is None:
        if frame.message_id in mavlink.mavlink_map:
            return None
        return Fault("unknown_message", f"Message {frame.message_id} is unknown")
    layout, pick, build = reader
    payload = frame.payload
    if len(payload) < layout.size:
        payload = payload.ljust(layout.size, b"\0")
    return build(frame.sysid, received_s, *pick(layout.unpack_from(payload)))


def from_fields(
    message: MessageId, fields: Mapping[str, Any], sysid: int, received_s: float
) -> Message | Fault | None:
    """Decode a message whose frame MAVSDK has read.

    Args:
        message: Any but PARAM_VALUE.
        fields: Its fields by their names, as on the wire; a missing field is 0.
        sysid: System id of the sender.
        received_s: Controller's monotonic time of arrival, s.

    Returns:
        As :func:`read`.
    """
    build, names = _BUILDERS[message]
    return build(sysid, received_s, *(fields.get(name, 0) for name in names.split()))


_Build = Callable[..., Message | Fault | None]
_Reader = tuple[struct.Struct, Callable[[tuple[Any, ...]], tuple[Any, ...]], _Build]


def _reader(message_id: MessageId, build: _Build, fields: str) -> _Reader:
    """Layout of a message, a getter of the named fields, and the function that takes them."""
    message = mavlink.mavlink_map[message_id]
    places = [
        sum(message.lengths[: message.ordered_fieldnames.index(name)]) for name in fields.split()
    ]
    # itemgetter gives a tuple for several items only; a slice gives one for a single item, too.
    pick = itemgetter(*places) if len(places) > 1 else itemgetter(slice(places[0], places[0] + 1))
    return message.unpacker, pick, build


# The value's bytes and not its float: an integer's bytes may be a signalling NaN, which no
# floating-point register carries unchanged.
_PARAM_VALUE = struct.Struct("<4s4x16sB")

_BUILDERS: dict[MessageId, tuple[_Build, str]] = {
    MessageId.HEARTBEAT: (
        telemetry.heartbeat,
        "type autopilot base_mode custom_mode system_status",
    ),
    MessageId.GLOBAL_POSITION_INT: (
        telemetry.global_position_int,
        "time_boot_ms lat lon alt vx vy vz",
    ),
    MessageId.HOME_POSITION: (telemetry.home_position, "latitude longitude altitude"),
    MessageId.ATTITUDE: (telemetry.attitude, "time_boot_ms roll pitch yaw"),
    MessageId.SYS_STATUS: (
        telemetry.sys_status,
        "onboard_control_sensors_health voltage_battery battery_remaining",
    ),
    MessageId.SYSTEM_TIME: (telemetry.system_time, "time_unix_usec time_boot_ms"),
    MessageId.GPS_RAW_INT: (telemetry.gps_raw_int, "fix_type satellites_visible"),
    MessageId.EXTENDED_SYS_STATE: (telemetry.extended_sys_state, "landed_state"),
    MessageId.AUTOPILOT_VERSION: (telemetry.autopilot_version, "uid flight_sw_version"),
    MessageId.STATUSTEXT: (telemetry.statustext, "severity text"),
    MessageId.COMMAND_ACK: (answers.command_ack, "command result target_system"),
    MessageId.TIMESYNC: (answers.timesync, "tc1 ts1"),
    MessageId.MISSION_REQUEST: (answers.mission_request, "target_system seq mission_type"),
    MessageId.MISSION_REQUEST_INT: (answers.mission_request, "target_system seq mission_type"),
    MessageId.MISSION_COUNT: (answers.mission_count, "target_system count mission_type"),
    MessageId.MISSION_ACK: (answers.mission_ack, "target_system type mission_type"),
    MessageId.MISSION_ITEM_INT: (
        answers.mission_item_int,
        "target_system seq command param1 x y mission_type",
    ),
}
"""The function that takes each message, and the names of the fields it takes."""

_READERS: dict[int, _Reader] = {
    MessageId.PARAM_VALUE: (_PARAM_VALUE, itemgetter(0, 1, 2), answers.param_value)
} | {
    message_id: _reader(message_id, build, fields)
    for message_id, (build, fields) in _BUILDERS.items()
}
