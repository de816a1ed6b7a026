"""MAVLink messages as MAVSDK's MavlinkDirect plugin has them: a name and its fields in JSON.

A number that is not finite is ``null`` there, in both directions. Field names and units are
those of https://mavlink.io/en/messages/common.html.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any, Literal

import msgspec

from swarmctl.events import (
    GoTo,
    GpsFix,
    HomePosition,
    LandedState,
    StatusText,
    VehicleAttitude,
    VehicleClock,
    VehicleStatus,
    VehicleVersion,
)
from swarmctl.link.facts import (
    CommandAck,
    CommandLong,
    DataStream,
    Fact,
    Fault,
    HeartbeatFact,
    ParameterFact,
    PositionFact,
    TimeSyncAnswer,
)

AUTOPILOT_COMPONENT = 1
"""MAV_COMP_ID_AUTOPILOT1."""

_GLOBAL_INT = 5
"""MAV_FRAME_GLOBAL_INT: altitudes AMSL."""
_POSITION_AND_VELOCITY = 3520
"""POSITION_TARGET_TYPEMASK: acceleration, yaw and yaw rate are ignored."""
_RAD_PER_E7 = math.radians(1e-7)
_E7_PER_RAD = 1.0 / _RAD_PER_E7
_MAX_LAT_E7 = 900_000_000
_MAX_LON_E7 = 1_800_000_000
_MAX_ALT_MM = 100_000_000
_MIN_UTC_USEC = 946_684_800_000_000
_MAX_UTC_USEC = 4_102_444_800_000_000
_ARMED = 0x80
_PREARM_OK = 0x10000000
_INVALID = 8
_ON_FAILSAFE = frozenset((5, 6))
_MULTIROTORS = frozenset((2, 3, 13, 14, 15, 29, 35, 43))
_AUTOPILOTS: dict[int, Literal["ardupilot", "px4"]] = {3: "ardupilot", 12: "px4"}
_LANDED: dict[int, Literal["on_ground", "in_air", "taking_off", "landing"]] = {
    1: "on_ground",
    2: "in_air",
    3: "taking_off",
    4: "landing",
}
_RESULTS = (
    "ACCEPTED",
    "TEMPORARILY_REJECTED",
    "DENIED",
    "UNSUPPORTED",
    "FAILED",
    "IN_PROGRESS",
    "CANCELLED",
)


# --- Received --------------------------------------------------------------------------


class _Heartbeat(msgspec.Struct):
    type: int
    autopilot: int
    base_mode: int
    custom_mode: int
    system_status: int

    def fact(self, _sysid: int, _received_s: float) -> Fact | None:
        if self.autopilot == _INVALID:  # a ground station, a camera: no flight controller
            return None
        return HeartbeatFact(
            autopilot=_AUTOPILOTS.get(self.autopilot, "other"),
            is_multirotor=self.type in _MULTIROTORS,
            custom_mode=self.custom_mode,
            armed=bool(self.base_mode & _ARMED),
            failsafe=self.system_status in _ON_FAILSAFE,
        )


class _GlobalPosition(msgspec.Struct):
    time_boot_ms: int
    lat: int
    lon: int
    alt: int
    vx: int
    vy: int
    vz: int

    def fact(self, _sysid: int, _received_s: float) -> Fact | None:
        if self.lat == 0 and self.lon == 0:  # what autopilots send before they know
            return None
        lat, lon, alt = _geodetic(self.lat, self.lon, self.alt)
        return PositionFact(
            boot_s=self.time_boot_ms / 1e3,
            lat_rad=lat,
            lon_rad=lon,
            alt_amsl_m=alt,
            velocity_enu=(self.vy / 100.0, self.vx / 100.0, self.vz / -100.0),
        )


class _Home(msgspec.Struct):
    latitude: int
    longitude: int
    altitude: int

    def fact(self, sysid: int, received_s: float) -> Fact | None:
        if self.latitude == 0 and self.longitude == 0:
            return None
        lat, lon, alt = _geodetic(self.latitude, self.longitude, self.altitude)
        return HomePosition(
            received_s=received_s, sysid=sysid, lat_rad=lat, lon_rad=lon, alt_amsl_m=alt
        )


class _Attitude(msgspec.Struct):
    time_boot_ms: int
    roll: float
    pitch: float
    yaw: float

    def fact(self, sysid: int, received_s: float) -> Fact:
        return VehicleAttitude(
            received_s=received_s,
            sysid=sysid,
            boot_s=self.time_boot_ms / 1e3,
            roll_rad=self.roll,
            pitch_rad=self.pitch,
            yaw_rad=self.yaw,
        )


class _SysStatus(msgspec.Struct):
    onboard_control_sensors_health: int
    voltage_battery: int
    battery_remaining: int

    def fact(self, sysid: int, received_s: float) -> Fact:
        # 65535 mV means not sent; ArduPilot without a battery monitor sends 0.
        voltage, percent = self.voltage_battery, self.battery_remaining
        return VehicleStatus(
            received_s=received_s,
            sysid=sysid,
            battery_v=voltage / 1e3 if 0 < voltage < 0xFFFF else None,
            battery_fraction=percent / 100.0 if 0 <= percent <= 100 else None,
            prearm_ok=bool(self.onboard_control_sensors_health & _PREARM_OK),
        )


class _SystemTime(msgspec.Struct):
    time_unix_usec: int
    time_boot_ms: int

    def fact(self, sysid: int, received_s: float) -> Fact | None:
        if self.time_unix_usec == 0:  # not known yet
            return None
        if not _MIN_UTC_USEC <= self.time_unix_usec <= _MAX_UTC_USEC:
            raise ValueError(f"time_unix_usec = {self.time_unix_usec}")
        return VehicleClock(
            received_s=received_s,
            sysid=sysid,
            utc_s=self.time_unix_usec / 1e6,
            boot_s=self.time_boot_ms / 1e3,
        )


class _GpsRaw(msgspec.Struct):
    fix_type: int
    satellites_visible: int

    def fact(self, sysid: int, received_s: float) -> Fact:
        satellites = self.satellites_visible if self.satellites_visible != 0xFF else 0
        return GpsFix(
            received_s=received_s, sysid=sysid, fix_type=self.fix_type, satellites=satellites
        )


class _ExtendedState(msgspec.Struct):
    landed_state: int

    def fact(self, sysid: int, received_s: float) -> Fact:
        return LandedState(
            received_s=received_s, sysid=sysid, state=_LANDED.get(self.landed_state, "unknown")
        )


class _Version(msgspec.Struct):
    uid: int
    flight_sw_version: int

    def fact(self, sysid: int, received_s: float) -> Fact:
        return VehicleVersion(
            received_s=received_s,
            sysid=sysid,
            uid=self.uid,
            flight_sw_version=self.flight_sw_version,
        )


class _StatusText(msgspec.Struct):
    severity: int
    text: str

    def fact(self, sysid: int, received_s: float) -> Fact:
        # A stranger's control characters must not reach the operator's terminal.
        text = "".join(c if c.isprintable() else "?" for c in self.text)
        return StatusText(received_s=received_s, sysid=sysid, severity=self.severity, text=text)


class _Ack(msgspec.Struct):
    command: int
    result: int
    target_system: int = 0

    def fact(self, _sysid: int, _received_s: float) -> Fact:
        known = 0 <= self.result < len(_RESULTS)
        result = _RESULTS[self.result] if known else f"MAV_RESULT {self.result}"
        return CommandAck(self.command, result, self.target_system)


class _TimeSync(msgspec.Struct):
    tc1: int
    ts1: int

    def fact(self, _sysid: int, _received_s: float) -> Fact | None:
        return TimeSyncAnswer(self.tc1 / 1e9, self.ts1) if self.tc1 else None  # 0: a question


class _Parameter(msgspec.Struct):
    param_id: str
    param_type: int
    param_value: float | None

    def fact(self, _sysid: int, _received_s: float) -> Fact | None:
        if self.param_value is None:  # the bytes of a NaN, or of an integer that looks like one
            return None
        return ParameterFact(self.param_id, struct.pack("<f", self.param_value), self.param_type)


_DECODERS: dict[str, Callable[[str | bytes], Any]] = {
    name: msgspec.json.Decoder(kind).decode
    for name, kind in (
        ("HEARTBEAT", _Heartbeat),
        ("GLOBAL_POSITION_INT", _GlobalPosition),
        ("HOME_POSITION", _Home),
        ("ATTITUDE", _Attitude),
        ("SYS_STATUS", _SysStatus),
        ("SYSTEM_TIME", _SystemTime),
        ("GPS_RAW_INT", _GpsRaw),
        ("EXTENDED_SYS_STATE", _ExtendedState),
        ("AUTOPILOT_VERSION", _Version),
        ("STATUSTEXT", _StatusText),
        ("COMMAND_ACK", _Ack),
        ("TIMESYNC", _TimeSync),
        ("PARAM_VALUE", _Parameter),
    )
}

MESSAGES = tuple(_DECODERS)
"""Names of the messages that are read."""


def read(name: str, fields: str, sysid: int, received_s: float) -> Fact | Fault | None:
    """What a message says.

    Args:
        name: One of :data:`MESSAGES`.
        fields: Its fields as JSON.
        sysid: System id of the sender.
        received_s: Monotonic time of arrival, s.

    Returns:
        The fact; None if it says nothing of use; a fault if its fields cannot be true.
    """
    try:
        fact: Fact | None = _DECODERS[name](fields).fact(sysid, received_s)
    except (ValueError, OverflowError) as error:  # msgspec's ValidationError is a ValueError
        return Fault("implausible", f"{name} of vehicle {sysid} is not usable: {error}")
    return fact


def _geodetic(lat_e7: int, lon_e7: int, alt_mm: int) -> tuple[float, float, float]:
    if abs(lat_e7) > _MAX_LAT_E7 or abs(lon_e7) > _MAX_LON_E7 or abs(alt_mm) > _MAX_ALT_MM:
        raise ValueError(f"lat = {lat_e7}, lon = {lon_e7}, alt = {alt_mm}")
    return lat_e7 * _RAD_PER_E7, lon_e7 * _RAD_PER_E7, alt_mm / 1e3


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
        "autopilot": _INVALID,
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


def setpoint(goto: GoTo, now: float) -> str | None:
    """Fields of SET_POSITION_TARGET_GLOBAL_INT: altitude AMSL, position and velocity used.

    Returns:
        The fields; None if one is not finite or no place on Earth: such a setpoint must never
        leave.
    """
    east, north, up = goto.velocity_enu
    numbers = (goto.lat_rad, goto.lon_rad, goto.alt_amsl_m, east, north, up)
    if not all(map(math.isfinite, numbers)):
        return None
    lat_e7, lon_e7 = (round(angle * _E7_PER_RAD) for angle in numbers[:2])
    if abs(lat_e7) > _MAX_LAT_E7 or abs(lon_e7) > _MAX_LON_E7:
        return None
    return _fields(
        goto.sysid,
        time_boot_ms=int(now * 1e3) & 0xFFFFFFFF,
        coordinate_frame=_GLOBAL_INT,
        type_mask=_POSITION_AND_VELOCITY,
        lat_int=lat_e7,
        lon_int=lon_e7,
        alt=goto.alt_amsl_m,
        vx=north,
        vy=east,
        vz=-up,
        **dict.fromkeys(("afx", "afy", "afz", "yaw", "yaw_rate"), 0.0),
    )
