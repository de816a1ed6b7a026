"""Frames to facts in our terms: units and frames of what is received are converted here.

1e7-degrees, mm, cm/s and NED become rad, m, m/s and ENU. Decoding is a step of its own behind
:mod:`swarmctl.link.codec.framing`, because most of the work can be spared for a frame nobody needs.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from operator import itemgetter
from typing import Any, Literal

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.events import (
    GpsFix,
    HomePosition,
    LandedState,
    StatusText,
    VehicleAttitude,
    VehicleClock,
    VehicleStatus,
    VehicleVersion,
)
from swarmctl.link.codec.messages import (
    CommandAck,
    Fact,
    Fault,
    FenceAck,
    FenceCount,
    FenceItem,
    FenceRequest,
    Frame,
    HeartbeatFact,
    MessageId,
    ParameterFact,
    PositionFact,
    TimeSyncAnswer,
)

_RAD_PER_E7 = math.radians(1e-7)
_MAX_LAT_E7 = 900_000_000
_MAX_LON_E7 = 1_800_000_000
# Beyond this swarmctl.frames makes no promise, and no UAV flies.
_MAX_ALT_MM = 100_000_000
# 2000-01-01 and 2100-01-01: a vehicle without a fix may count from any other epoch.
_MIN_UTC_USEC = 946_684_800_000_000
_MAX_UTC_USEC = 4_102_444_800_000_000


def read(frame: Frame, received_s: float) -> Fact | Fault | None:
    """Decode a frame.

    A message whose meaning is all on the wire becomes its event at once; HEARTBEAT,
    GLOBAL_POSITION_INT, PARAM_VALUE and COMMAND_ACK need more than that and become facts.

    Args:
        frame: A frame from :func:`swarmctl.link.codec.framing.split`.
        received_s: Controller's monotonic time of arrival, s.

    Returns:
        The fact; a fault if a field is out of its range; None for a message nobody needs, for
        one that says that its value is not known yet, and for a HEARTBEAT of anything but a
        flight controller.
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
) -> Fact | Fault | None:
    """What a message says whose frame somebody else has read.

    Args:
        message: Any but PARAM_VALUE.
        fields: Its fields by their names, as on the wire; one that is not there is 0.
        sysid: System id of the sender.
        received_s: Controller's monotonic time of arrival, s.

    Returns:
        As :func:`read`.
    """
    build, names = _BUILDERS[message]
    return build(sysid, received_s, *(fields.get(name, 0) for name in names.split()))


def _implausible(message: str, sysid: int, **fields: object) -> Fault:
    named = ", ".join(f"{name} = {value}" for name, value in fields.items())
    return Fault("implausible", f"{message} of vehicle {sysid} says {named}")


def _geodetic(lat_e7: int, lon_e7: int, alt_mm: int) -> tuple[float, float, float] | None:
    if (
        -_MAX_LAT_E7 <= lat_e7 <= _MAX_LAT_E7
        and -_MAX_LON_E7 <= lon_e7 <= _MAX_LON_E7
        and -_MAX_ALT_MM <= alt_mm <= _MAX_ALT_MM
    ):
        return lat_e7 * _RAD_PER_E7, lon_e7 * _RAD_PER_E7, alt_mm / 1000.0
    return None


_AUTOPILOTS: dict[int, Literal["ardupilot", "px4"]] = {
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: "ardupilot",
    mavlink.MAV_AUTOPILOT_PX4: "px4",
}
_ON_FAILSAFE = frozenset((mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY))
_MULTIROTORS = frozenset(
    (
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_TYPE_COAXIAL,
        mavlink.MAV_TYPE_TRICOPTER,
        mavlink.MAV_TYPE_HEXAROTOR,
        mavlink.MAV_TYPE_OCTOROTOR,
        mavlink.MAV_TYPE_DECAROTOR,
        mavlink.MAV_TYPE_DODECAROTOR,
        mavlink.MAV_TYPE_GENERIC_MULTIROTOR,
    )
)


def _heartbeat(
    _sysid: int,
    _received_s: float,
    vehicle_type: int,
    autopilot: int,
    base_mode: int,
    custom_mode: int,
    system_status: int,
) -> HeartbeatFact | None:
    if vehicle_type == mavlink.MAV_TYPE_GCS or autopilot == mavlink.MAV_AUTOPILOT_INVALID:
        return None  # a ground station, a camera: no flight controller
    return HeartbeatFact(
        _AUTOPILOTS.get(autopilot, "other"),
        vehicle_type in _MULTIROTORS,
        custom_mode,
        bool(base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
        system_status in _ON_FAILSAFE,
    )


def _global_position_int(
    sysid: int,
    _received_s: float,
    boot_ms: int,
    lat_e7: int,
    lon_e7: int,
    alt_mm: int,
    vx_cmps: int,
    vy_cmps: int,
    vz_cmps: int,
) -> PositionFact | Fault | None:
    if lat_e7 == 0 and lon_e7 == 0:  # what autopilots send before they know
        return None
    geodetic = _geodetic(lat_e7, lon_e7, alt_mm)
    if geodetic is None:
        return _implausible("GLOBAL_POSITION_INT", sysid, lat=lat_e7, lon=lon_e7, alt=alt_mm)
    return PositionFact(
        boot_ms / 1000.0, *geodetic, (vy_cmps / 100.0, vx_cmps / 100.0, vz_cmps / -100.0)
    )


def _home_position(
    sysid: int, received_s: float, lat_e7: int, lon_e7: int, alt_mm: int
) -> HomePosition | Fault | None:
    if lat_e7 == 0 and lon_e7 == 0:
        return None
    geodetic = _geodetic(lat_e7, lon_e7, alt_mm)
    if geodetic is None:
        return _implausible("HOME_POSITION", sysid, lat=lat_e7, lon=lon_e7, alt=alt_mm)
    lat_rad, lon_rad, alt_m = geodetic
    return HomePosition(
        received_s=received_s, sysid=sysid, lat_rad=lat_rad, lon_rad=lon_rad, alt_amsl_m=alt_m
    )


def _attitude(
    sysid: int, received_s: float, boot_ms: int, roll: float, pitch: float, yaw: float
) -> VehicleAttitude | Fault:
    if not math.isfinite(roll + pitch + yaw):
        return _implausible("ATTITUDE", sysid, roll=roll, pitch=pitch, yaw=yaw)
    return VehicleAttitude(
        received_s=received_s,
        sysid=sysid,
        boot_s=boot_ms / 1000.0,
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=yaw,
    )


def _sys_status(
    sysid: int, received_s: float, health: int, voltage_mv: int, remaining_percent: int
) -> VehicleStatus:
    # 65535 mV means not sent; ArduPilot without a battery monitor sends 0.
    return VehicleStatus(
        received_s=received_s,
        sysid=sysid,
        battery_v=voltage_mv / 1000.0 if 0 < voltage_mv < 0xFFFF else None,
        battery_fraction=remaining_percent / 100.0 if 0 <= remaining_percent <= 100 else None,
        prearm_ok=bool(health & mavlink.MAV_SYS_STATUS_PREARM_CHECK),
    )


def _system_time(
    sysid: int, received_s: float, utc_usec: int, boot_ms: int
) -> VehicleClock | Fault | None:
    if utc_usec == 0:  # not known yet
        return None
    if not _MIN_UTC_USEC <= utc_usec <= _MAX_UTC_USEC:
        return _implausible("SYSTEM_TIME", sysid, time_unix_usec=utc_usec)
    return VehicleClock(
        received_s=received_s, sysid=sysid, utc_s=utc_usec / 1e6, boot_s=boot_ms / 1000.0
    )


def _gps_raw_int(sysid: int, received_s: float, fix_type: int, satellites: int) -> GpsFix:
    return GpsFix(
        received_s=received_s,
        sysid=sysid,
        fix_type=fix_type,
        satellites=0 if satellites == 0xFF else satellites,  # 255 is unknown
    )


_LANDED_STATES: dict[int, Literal["on_ground", "taking_off", "in_air", "landing"]] = {
    mavlink.MAV_LANDED_STATE_ON_GROUND: "on_ground",
    mavlink.MAV_LANDED_STATE_TAKEOFF: "taking_off",
    mavlink.MAV_LANDED_STATE_IN_AIR: "in_air",
    mavlink.MAV_LANDED_STATE_LANDING: "landing",
}


def _extended_sys_state(sysid: int, received_s: float, landed_state: int) -> LandedState:
    return LandedState(
        received_s=received_s, sysid=sysid, state=_LANDED_STATES.get(landed_state, "unknown")
    )


def _autopilot_version(
    sysid: int, received_s: float, uid: int, flight_sw_version: int
) -> VehicleVersion:
    return VehicleVersion(
        received_s=received_s, sysid=sysid, uid=uid, flight_sw_version=flight_sw_version
    )


def _statustext(sysid: int, received_s: float, severity: int, text: bytes) -> StatusText:
    # A stranger's control characters must not reach the operator's terminal.
    decoded = text.partition(b"\0")[0].decode("utf-8", "replace")
    return StatusText(
        received_s=received_s,
        sysid=sysid,
        severity=severity,
        text="".join(c if c.isprintable() else "?" for c in decoded),
    )


def _command_ack(
    _sysid: int, _received_s: float, command: int, result: int, target_system: int
) -> CommandAck:
    known = mavlink.enums["MAV_RESULT"].get(result)
    name = known.name.removeprefix("MAV_RESULT_") if known else f"MAV_RESULT {result}"
    return CommandAck(command, name, target_system)


def _timesync(_sysid: int, _received_s: float, tc1: int, ts1: int) -> TimeSyncAnswer | None:
    if tc1 == 0:  # somebody asks
        return None
    return TimeSyncAnswer(tc1 / 1e9, ts1)


def _param_value(_sysid: int, _received_s: float, raw: bytes, name: bytes, kind: int) -> Fact:
    decoded = name.partition(b"\0")[0].decode("ascii", "replace")
    return ParameterFact(decoded, raw, kind)


_FENCE = mavlink.MAV_MISSION_TYPE_FENCE


def _mission_request(
    _sysid: int, _received_s: float, target_system: int, seq: int, mission_type: int
) -> Fact | None:
    return FenceRequest(target_system, seq) if mission_type == _FENCE else None


def _mission_count(
    _sysid: int, _received_s: float, target_system: int, count: int, mission_type: int
) -> Fact | None:
    return FenceCount(target_system, count) if mission_type == _FENCE else None


def _mission_ack(
    _sysid: int, _received_s: float, target_system: int, result: int, mission_type: int
) -> Fact | None:
    if mission_type != _FENCE:
        return None
    known = mavlink.enums["MAV_MISSION_RESULT"].get(result)
    name = known.name.removeprefix("MAV_MISSION_") if known else f"MAV_MISSION_RESULT {result}"
    return FenceAck(target_system, name)


def _mission_item_int(
    _sysid: int,
    _received_s: float,
    target_system: int,
    seq: int,
    command: int,
    radius_m: float,
    lat_e7: int,
    lon_e7: int,
    mission_type: int,
) -> Fact | None:
    if mission_type != _FENCE:
        return None
    is_circle = command == mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
    lat_rad, lon_rad = lat_e7 * _RAD_PER_E7, lon_e7 * _RAD_PER_E7
    return FenceItem(target_system, seq, command, is_circle, radius_m, lat_rad, lon_rad)


_Build = Callable[..., Fact | Fault | None]
_Reader = tuple[struct.Struct, Callable[[tuple[Any, ...]], tuple[Any, ...]], _Build]


def _reader(message_id: MessageId, build: _Build, fields: str) -> _Reader:
    """Layout of a message, a getter of some of its fields by name, and who takes them."""
    message = mavlink.mavlink_map[message_id]
    places = [
        sum(message.lengths[: message.ordered_fieldnames.index(name)]) for name in fields.split()
    ]
    # itemgetter gives a tuple for several items; a slice makes it one for a single item, too.
    pick = itemgetter(*places) if len(places) > 1 else itemgetter(slice(places[0], places[0] + 1))
    return message.unpacker, pick, build


# The value's bytes and not its float: an integer's may be those of a signalling NaN, which no
# floating-point register carries unchanged.
_PARAM_VALUE = struct.Struct("<4s4x16sB")

_BUILDERS: dict[MessageId, tuple[_Build, str]] = {
    MessageId.HEARTBEAT: (_heartbeat, "type autopilot base_mode custom_mode system_status"),
    MessageId.GLOBAL_POSITION_INT: (_global_position_int, "time_boot_ms lat lon alt vx vy vz"),
    MessageId.HOME_POSITION: (_home_position, "latitude longitude altitude"),
    MessageId.ATTITUDE: (_attitude, "time_boot_ms roll pitch yaw"),
    MessageId.SYS_STATUS: (
        _sys_status,
        "onboard_control_sensors_health voltage_battery battery_remaining",
    ),
    MessageId.SYSTEM_TIME: (_system_time, "time_unix_usec time_boot_ms"),
    MessageId.GPS_RAW_INT: (_gps_raw_int, "fix_type satellites_visible"),
    MessageId.EXTENDED_SYS_STATE: (_extended_sys_state, "landed_state"),
    MessageId.AUTOPILOT_VERSION: (_autopilot_version, "uid flight_sw_version"),
    MessageId.STATUSTEXT: (_statustext, "severity text"),
    MessageId.COMMAND_ACK: (_command_ack, "command result target_system"),
    MessageId.TIMESYNC: (_timesync, "tc1 ts1"),
    MessageId.MISSION_REQUEST: (_mission_request, "target_system seq mission_type"),
    MessageId.MISSION_REQUEST_INT: (_mission_request, "target_system seq mission_type"),
    MessageId.MISSION_COUNT: (_mission_count, "target_system count mission_type"),
    MessageId.MISSION_ACK: (_mission_ack, "target_system type mission_type"),
    MessageId.MISSION_ITEM_INT: (
        _mission_item_int,
        "target_system seq command param1 x y mission_type",
    ),
}
"""Who takes which fields of a message."""

_READERS: dict[int, _Reader] = {
    MessageId.PARAM_VALUE: (_PARAM_VALUE, itemgetter(0, 1, 2), _param_value)
} | {
    message_id: _reader(message_id, build, fields)
    for message_id, (build, fields) in _BUILDERS.items()
}
