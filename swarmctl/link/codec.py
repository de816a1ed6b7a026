"""MAVLink frames to facts in our terms, and commands to frames; the only user of pymavlink.

Nothing is kept between datagrams, so a truncated one cannot spoil the next. Units and frames
are converted here and nowhere else: 1e7-degrees, mm, cm/s and NED become rad, m, m/s and ENU.

Receiving takes two steps, because most of the work can be spared for a frame nobody needs:
:func:`split` finds the frames of a datagram and checks them, :func:`read` decodes one. Both
work from pymavlink's tables (checksum seeds, field layouts) and its checksum, but not through
its stream parser, which costs three times as much and keeps its state across datagrams.
Sending goes through pymavlink's own ``pack``.

MAVLink 1 and 2 are read and written (https://mavlink.io/en/guide/serialization.html),
dialect ``ardupilotmega``, of which ``common`` is a part.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable
from operator import itemgetter
from typing import Any, Literal, assert_never

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.events import (
    GoTo,
    GpsFix,
    HomePosition,
    LandedState,
    StatusText,
    UploadFence,
    VehicleAttitude,
    VehicleClock,
    VehicleStatus,
    VehicleVersion,
)
from swarmctl.link.facts import (
    AskForItem,
    AskForPlan,
    CommandAck,
    CommandLong,
    EndPlan,
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
    PlanPacket,
    PositionFact,
    SendItem,
    StartPlan,
    TimeSyncAnswer,
)
from swarmctl.link.signing import Signing

AUTOPILOT_COMPONENT = 1
"""MAV_COMP_ID_AUTOPILOT1."""
OUR_COMPONENT = 190
"""MAV_COMP_ID_MISSIONPLANNER: the component id of ground stations."""

_RAD_PER_E7 = math.radians(1e-7)
_E7_PER_RAD = 1.0 / _RAD_PER_E7
_MAX_LAT_E7 = 900_000_000
_MAX_LON_E7 = 1_800_000_000
# Beyond this swarmctl.frames makes no promise, and no UAV flies.
_MAX_ALT_MM = 100_000_000
# 2000-01-01 and 2100-01-01: a vehicle without a fix may count from any other epoch.
_MIN_UTC_USEC = 946_684_800_000_000
_MAX_UTC_USEC = 4_102_444_800_000_000

_HEADER_V2 = struct.Struct("<xBBxBBBHB")
_HEADER_V1 = struct.Struct("<xBBBBB")
_MARKER = re.compile(rb"[\xfd\xfe]")
_SIGNED = mavlink.MAVLINK_IFLAG_SIGNED
_CRC_EXTRA = {
    message_id: bytes((message.crc_extra,)) for message_id, message in mavlink.mavlink_map.items()
}
_SIZES = {"char": 1, "float": 4, "double": 8} | {
    f"{sign}int{bits}_t": bits // 8 for sign in ("", "u") for bits in (8, 16, 32, 64)
}
_TARGET_PLACES: dict[int, int] = {
    message_id: sum(
        _SIZES[dict(zip(message.fieldnames, message.fieldtypes, strict=True))[name]]
        * max(1, message.array_lengths[place])
        for place, name in enumerate(
            message.ordered_fieldnames[: message.ordered_fieldnames.index("target_system")]
        )
    )
    for message_id, message in mavlink.mavlink_map.items()
    if "target_system" in message.fieldnames
}
# A datagram made of nothing but start markers would otherwise cost a checksum per byte.
_MAX_RESYNCS = 32

_SET_POSITION_AND_VELOCITY = (
    mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
)


# --- Receiving -------------------------------------------------------------------------


def split(datagram: bytes) -> tuple[list[Frame], list[Fault]]:
    """Find and check the frames of one datagram.

    After a fault the search goes on at the next start marker, so whole frames behind a corrupt
    one are taken. A stretch of unusable bytes counts as one fault, named after its beginning.
    """
    if not datagram:
        return [], [Fault("not_mavlink", "It is empty")]
    frames: list[Frame] = []
    faults: list[Fault] = []
    position = 0
    resyncs = 0
    at_boundary = True
    while position < len(datagram):
        found = _frame_at(datagram, position, at_boundary)
        if isinstance(found, Frame):
            frames.append(found)
            position += len(found.raw)
            at_boundary = True
            continue
        if at_boundary:
            faults.append(found)
            at_boundary = False
        resyncs += 1
        marker = _MARKER.search(datagram, position + 1)
        if marker is None or resyncs > _MAX_RESYNCS:
            break
        position = marker.start()
    return frames, faults


def end_of_whole_frames(data: bytes) -> int:
    """Where in a stream's bytes the first frame begins whose end has not come yet.

    Bytes that cannot be a frame are passed over, as :func:`split` does. A start marker among
    them waits for the frame it seems to announce, 280 bytes at most, before it is passed over.

    Returns:
        Its index; the number of bytes if no frame is under way.
    """
    position = 0
    at_boundary = True
    while position < len(data):
        found = _frame_at(data, position, at_boundary)
        if isinstance(found, Frame):
            position += len(found.raw)
            at_boundary = True
            continue
        if found.kind == "truncated":
            return position
        at_boundary = False
        marker = _MARKER.search(data, position + 1)
        if marker is None:
            break
        position = marker.start()
    return len(data)


def _frame_at(data: bytes, start: int, at_boundary: bool) -> Frame | Fault:
    """The frame that begins at ``start``.

    A message unknown to the dialect has no checksum seed. Its frame is taken, because its
    sequence number counts, if it lies between frame boundaries.
    """
    marker = data[start]
    left = len(data) - start
    tail = 2
    if marker == mavlink.PROTOCOL_MARKER_V2:
        if left < 12:
            return Fault("truncated", f"Only {left} bytes of a frame's header are there")
        length, flags, seq, sysid, compid, id_low, id_high = _HEADER_V2.unpack_from(data, start)
        message_id = id_low | id_high << 16
        body = start + 10
        if flags:
            if flags != _SIGNED:
                return Fault("unsupported_flags", f"Incompatibility flags {flags:#04x} are unknown")
            tail += mavlink.MAVLINK_SIGNATURE_BLOCK_LEN
    elif marker == mavlink.PROTOCOL_MARKER_V1:
        if left < 8:
            return Fault("truncated", f"Only {left} bytes of a frame's header are there")
        length, seq, sysid, compid, message_id = _HEADER_V1.unpack_from(data, start)
        body = start + 6
    else:
        return Fault("not_mavlink", f"It has {marker:#04x} where a frame should start")
    body_end = body + length
    end = body_end + tail
    if end > len(data):
        return Fault("truncated", f"A frame of {end - start} bytes ends after {left}")
    crc_extra = _CRC_EXTRA.get(message_id)
    if crc_extra is None:
        if not at_boundary or (end < len(data) and _MARKER.match(data, end) is None):
            return Fault("unknown_message", f"What may be message {message_id} is unknown")
    elif (
        mavlink.x25crc(data[start + 1 : body_end] + crc_extra).crc
        != data[body_end] | data[body_end + 1] << 8
    ):
        return Fault("bad_crc", f"A frame with message id {message_id} has a wrong checksum")
    return Frame(data[start:end], sysid, compid, seq, message_id, data[body:body_end])


def read(frame: Frame, received_s: float) -> Fact | Fault | None:
    """Decode a frame.

    A message whose meaning is all on the wire becomes its event at once; HEARTBEAT,
    GLOBAL_POSITION_INT, PARAM_VALUE and COMMAND_ACK need more than that and become facts.

    Args:
        frame: A frame from :func:`split`.
        received_s: Controller's monotonic time of arrival, s.

    Returns:
        The fact; a fault if a field is out of its range; None for a message nobody needs, for
        one that says that its value is not known yet, and for a HEARTBEAT of anything but a
        flight controller.
    """
    reader = _READERS.get(frame.message_id)
    if reader is None:
        if frame.message_id in _CRC_EXTRA:
            return None
        return Fault("unknown_message", f"Message {frame.message_id} is unknown")
    layout, pick, build = reader
    payload = frame.payload
    if len(payload) < layout.size:
        payload = payload.ljust(layout.size, b"\0")
    return build(frame.sysid, received_s, *pick(layout.unpack_from(payload)))


def target_of(frame: Frame) -> int:
    """System id a frame is addressed to; 0 for everybody."""
    place = _TARGET_PLACES.get(frame.message_id)
    if place is None or place >= len(frame.payload):  # MAVLink 2 cuts trailing zeros
        return 0
    return frame.payload[place]


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

_READERS: dict[int, _Reader] = {
    MessageId.PARAM_VALUE: (_PARAM_VALUE, itemgetter(0, 1, 2), _param_value)
} | {
    message_id: _reader(message_id, build, fields)
    for message_id, build, fields in (
        (MessageId.HEARTBEAT, _heartbeat, "type autopilot base_mode custom_mode system_status"),
        (
            MessageId.GLOBAL_POSITION_INT,
            _global_position_int,
            "time_boot_ms lat lon alt vx vy vz",
        ),
        (MessageId.HOME_POSITION, _home_position, "latitude longitude altitude"),
        (MessageId.ATTITUDE, _attitude, "time_boot_ms roll pitch yaw"),
        (
            MessageId.SYS_STATUS,
            _sys_status,
            "onboard_control_sensors_health voltage_battery battery_remaining",
        ),
        (MessageId.SYSTEM_TIME, _system_time, "time_unix_usec time_boot_ms"),
        (MessageId.GPS_RAW_INT, _gps_raw_int, "fix_type satellites_visible"),
        (MessageId.EXTENDED_SYS_STATE, _extended_sys_state, "landed_state"),
        (MessageId.AUTOPILOT_VERSION, _autopilot_version, "uid flight_sw_version"),
        (MessageId.STATUSTEXT, _statustext, "severity text"),
        (MessageId.COMMAND_ACK, _command_ack, "command result target_system"),
        (MessageId.TIMESYNC, _timesync, "tc1 ts1"),
        (MessageId.MISSION_REQUEST, _mission_request, "target_system seq mission_type"),
        (MessageId.MISSION_REQUEST_INT, _mission_request, "target_system seq mission_type"),
        (MessageId.MISSION_COUNT, _mission_count, "target_system count mission_type"),
        (MessageId.MISSION_ACK, _mission_ack, "target_system type mission_type"),
        (
            MessageId.MISSION_ITEM_INT,
            _mission_item_int,
            "target_system seq command param1 x y mission_type",
        ),
    )
}


# --- Sending ---------------------------------------------------------------------------


def _fence_item(fence: UploadFence) -> object:
    return mavlink.MAVLink_mission_item_int_message(
        fence.sysid,
        AUTOPILOT_COMPONENT,
        seq=0,
        frame=mavlink.MAV_FRAME_GLOBAL,
        command=mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
        current=0,
        autocontinue=1,
        param1=fence.radius_m,
        param2=0.0,
        param3=0.0,
        param4=0.0,
        x=round(fence.lat_rad * _E7_PER_RAD),
        y=round(fence.lon_rad * _E7_PER_RAD),
        z=0.0,
        mission_type=_FENCE,
    )


class Encoder:
    """Our side of one address: frames with consecutive sequence numbers.

    Args:
        sysid: Our system id.
        signing: Signs every frame; None for unsigned frames.
        link_id: Number of the address, 0..255, in the signatures.

    Attributes:
        mavlink_1: Whether MAVLink 1 is written: nothing else was heard at that address. Signed
            frames are always MAVLink 2.
    """

    def __init__(self, sysid: int, signing: Signing | None = None, link_id: int = 0) -> None:
        self._mav = mavlink.MAVLink(None, srcSystem=sysid, srcComponent=OUR_COMPONENT)
        self._signing = signing
        self._has_heard = False
        self.mavlink_1 = False
        if signing is not None:
            self._mav.signing.secret_key = signing.key
            self._mav.signing.link_id = link_id
            self._mav.signing.sign_outgoing = True

    def hear(self, frame: Frame) -> None:
        """Take note of the version an autopilot at that address speaks."""
        is_1 = frame.raw[0] == mavlink.PROTOCOL_MARKER_V1
        self.mavlink_1 = is_1 and (self.mavlink_1 or not self._has_heard)
        self._has_heard = True

    def heartbeat(self) -> bytes:
        """HEARTBEAT of a ground station."""
        return self._pack(
            mavlink.MAVLink_heartbeat_message(
                type=mavlink.MAV_TYPE_GCS,
                autopilot=mavlink.MAV_AUTOPILOT_INVALID,
                base_mode=0,
                custom_mode=0,
                system_status=mavlink.MAV_STATE_ACTIVE,
                mavlink_version=3,
            )
        )

    def timesync(self, asked_ns: int) -> bytes:
        """TIMESYNC that asks every vehicle at the address for its time since boot."""
        return self._pack(mavlink.MAVLink_timesync_message(0, asked_ns))

    def command_long(self, target: int, command: CommandLong, confirmation: int) -> bytes:
        """COMMAND_LONG to the autopilot of system ``target``; confirmation counts repeats."""
        params = command.params + (0.0,) * (7 - len(command.params))
        return self._pack(
            mavlink.MAVLink_command_long_message(
                target, AUTOPILOT_COMPONENT, command.command, confirmation, *params
            )
        )

    def param_request_read(self, target: int, name: str) -> bytes:
        """PARAM_REQUEST_READ of a parameter by its name."""
        return self._pack(
            mavlink.MAVLink_param_request_read_message(
                target, AUTOPILOT_COMPONENT, name.encode("ascii"), -1
            )
        )

    def param_set(self, target: int, name: str, raw: bytes, kind: int) -> bytes:
        """PARAM_SET of a parameter; ``raw`` holds the value's four bytes."""
        (carrier,) = struct.unpack("<f", raw)
        return self._pack(
            mavlink.MAVLink_param_set_message(
                target, AUTOPILOT_COMPONENT, name.encode("ascii"), carrier, kind
            )
        )

    def plan(self, target: int, packet: PlanPacket) -> bytes:
        """A message of the upload of a fence, or of its reading back."""
        to = (target, AUTOPILOT_COMPONENT)
        message: object
        match packet:
            case StartPlan():
                message = mavlink.MAVLink_mission_count_message(*to, 1, _FENCE)
            case SendItem(fence=fence):
                message = _fence_item(fence)
            case AskForPlan():
                message = mavlink.MAVLink_mission_request_list_message(*to, _FENCE)
            case AskForItem():
                message = mavlink.MAVLink_mission_request_int_message(*to, 0, _FENCE)
            case EndPlan():
                accepted = mavlink.MAV_MISSION_ACCEPTED
                message = mavlink.MAVLink_mission_ack_message(*to, accepted, _FENCE)
            case _:
                assert_never(packet)
        return self._pack(message)

    def setpoint(self, goto: GoTo, now: float) -> bytes | None:
        """SET_POSITION_TARGET_GLOBAL_INT: altitude AMSL, position and velocity used.

        The frame is MAV_FRAME_GLOBAL_INT (5), the only one with altitudes AMSL that every
        autopilot takes: PX4 refuses MAV_FRAME_GLOBAL (0) and _RELATIVE_ALT (3).

        Returns:
            The frame; None if a field is not finite or does not fit into its wire field, for
            such a setpoint must never leave.
        """
        velocity_east, velocity_north, velocity_up = goto.velocity_enu
        if not math.isfinite(goto.alt_amsl_m + velocity_east + velocity_north + velocity_up):
            return None
        try:
            return self._pack(
                mavlink.MAVLink_set_position_target_global_int_message(
                    int(now * 1000.0) & 0xFFFFFFFF,
                    goto.sysid,
                    AUTOPILOT_COMPONENT,
                    mavlink.MAV_FRAME_GLOBAL_INT,
                    _SET_POSITION_AND_VELOCITY,
                    round(goto.lat_rad * _E7_PER_RAD),
                    round(goto.lon_rad * _E7_PER_RAD),
                    goto.alt_amsl_m,
                    velocity_north,
                    velocity_east,
                    -velocity_up,
                    *(0.0, 0.0, 0.0, 0.0, 0.0),
                )
            )
        except (ValueError, OverflowError, struct.error):
            return None

    def _pack(self, message: Any) -> bytes:  # noqa: ANN401 - untyped package
        if self._signing is not None:
            self._mav.signing.timestamp = self._signing.next_timestamp()
            frame: bytes = message.pack(self._mav)
        else:
            frame = message.pack(self._mav, force_mavlink1=self.mavlink_1)
        self._mav.seq = (self._mav.seq + 1) & 0xFF
        return frame
