"""What a vehicle answers: acknowledgements, time, parameters and its geofence.

Each function takes a message's sender, its time of arrival and some of its fields as on the wire.
"""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.link.codec.messages import (
    CommandAck,
    FenceAck,
    FenceCount,
    FenceItem,
    FenceRequest,
    Message,
    ParameterMessage,
    TimeSyncAnswer,
)

_RAD_PER_E7 = math.radians(1e-7)


def command_ack(
    _sysid: int, _received_s: float, command: int, result: int, target_system: int
) -> CommandAck:
    """COMMAND_ACK."""
    known = mavlink.enums["MAV_RESULT"].get(result)
    name = known.name.removeprefix("MAV_RESULT_") if known else f"MAV_RESULT {result}"
    return CommandAck(command, name, target_system)


def timesync(_sysid: int, _received_s: float, tc1: int, ts1: int) -> TimeSyncAnswer | None:
    """TIMESYNC; None for a question."""
    if tc1 == 0:  # somebody asks
        return None
    return TimeSyncAnswer(tc1 / 1e9, ts1)


def param_value(_sysid: int, _received_s: float, raw: bytes, name: bytes, kind: int) -> Message:
    """PARAM_VALUE."""
    decoded = name.partition(b"\0")[0].decode("ascii", "replace")
    return ParameterMessage(decoded, raw, kind)


_FENCE = mavlink.MAV_MISSION_TYPE_FENCE


def mission_request(
    _sysid: int, _received_s: float, target_system: int, seq: int, mission_type: int
) -> Message | None:
    """MISSION_REQUEST and MISSION_REQUEST_INT; None unless they concern the fence."""
    return FenceRequest(target_system, seq) if mission_type == _FENCE else None


def mission_count(
    _sysid: int, _received_s: float, target_system: int, count: int, mission_type: int
) -> Message | None:
    """MISSION_COUNT; None unless it concerns the fence."""
    return FenceCount(target_system, count) if mission_type == _FENCE else None


def mission_ack(
    _sysid: int, _received_s: float, target_system: int, result: int, mission_type: int
) -> Message | None:
    """MISSION_ACK; None unless it concerns the fence."""
    if mission_type != _FENCE:
        return None
    known = mavlink.enums["MAV_MISSION_RESULT"].get(result)
    name = known.name.removeprefix("MAV_MISSION_") if known else f"MAV_MISSION_RESULT {result}"
    return FenceAck(target_system, name)


def mission_item_int(
    _sysid: int,
    _received_s: float,
    target_system: int,
    seq: int,
    command: int,
    radius_m: float,
    lat_e7: int,
    lon_e7: int,
    mission_type: int,
) -> Message | None:
    """MISSION_ITEM_INT; None unless it concerns the fence."""
    if mission_type != _FENCE:
        return None
    is_circle = command == mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
    lat_rad, lon_rad = lat_e7 * _RAD_PER_E7, lon_e7 * _RAD_PER_E7
    return FenceItem(target_system, seq, command, is_circle, radius_m, lat_rad, lon_rad)
