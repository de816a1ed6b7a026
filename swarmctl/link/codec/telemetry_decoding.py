"""What a vehicle tells of itself: its mode, position, clock, battery, home and so on.

Each function takes a message's sender, its time of arrival and some of its fields as on the wire.
1e7-degrees, mm, cm/s and NED become rad, m, m/s and ENU here.
"""

from __future__ import annotations

import math
from typing import Literal

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
from swarmctl.link.codec.messages import Fault, HeartbeatMessage, PositionMessage

_RAD_PER_E7 = math.radians(1e-7)
_MAX_LAT_E7 = 900_000_000
_MAX_LON_E7 = 1_800_000_000
# Beyond this swarmctl.frames makes no promise, and no UAV flies.
_MAX_ALT_MM = 100_000_000
# 2000-01-01 and 2100-01-01: a vehicle without a fix may count from any other epoch.
_MIN_UTC_USEC = 946_684_800_000_000
_MAX_UTC_USEC = 4_102_444_800_000_000


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


def heartbeat(
    _sysid: int,
    _received_s: float,
    vehicle_type: int,
    autopilot: int,
    base_mode: int,
    custom_mode: int,
    system_status: int,
) -> HeartbeatMessage | None:
    """HEARTBEAT; None if the sender is no flight controller."""
    if vehicle_type == mavlink.MAV_TYPE_GCS or autopilot == mavlink.MAV_AUTOPILOT_INVALID:
        return None  # a ground station, a camera: no flight controller
    return HeartbeatMessage(
        _AUTOPILOTS.get(autopilot, "other"),
        vehicle_type in _MULTIROTORS,
        custom_mode,
        bool(base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
        system_status in _ON_FAILSAFE,
    )


def global_position_int(
    sysid: int,
    _received_s: float,
    boot_ms: int,
    lat_e7: int,
    lon_e7: int,
    alt_mm: int,
    vx_cmps: int,
    vy_cmps: int,
    vz_cmps: int,
) -> PositionMessage | Fault | None:
    """GLOBAL_POSITION_INT; None while it is unknown, a fault if it is no place on Earth."""
    if lat_e7 == 0 and lon_e7 == 0:  # what autopilots send before they know
        return None
    geodetic = _geodetic(lat_e7, lon_e7, alt_mm)
    if geodetic is None:
        return _implausible("GLOBAL_POSITION_INT", sysid, lat=lat_e7, lon=lon_e7, alt=alt_mm)
    return PositionMessage(
        boot_ms / 1000.0, *geodetic, (vy_cmps / 100.0, vx_cmps / 100.0, vz_cmps / -100.0)
    )


def home_position(
    sysid: int, received_s: float, lat_e7: int, lon_e7: int, alt_mm: int
) -> HomePosition | Fault | None:
    """HOME_POSITION; None while it is unknown, a fault if it is no place on Earth."""
    if lat_e7 == 0 and lon_e7 == 0:
        return None
    geodetic = _geodetic(lat_e7, lon_e7, alt_mm)
    if geodetic is None:
        return _implausible("HOME_POSITION", sysid, lat=lat_e7, lon=lon_e7, alt=alt_mm)
    lat_rad, lon_rad, alt_m = geodetic
    return HomePosition(
        received_s=received_s, sysid=sysid, lat_rad=lat_rad, lon_rad=lon_rad, alt_amsl_m=alt_m
    )


def attitude(
    sysid: int, received_s: float, boot_ms: int, roll: float, pitch: float, yaw: float
) -> VehicleAttitude | Fault:
    """ATTITUDE; a fault if an angle is not finite."""
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


def sys_status(
    sysid: int, received_s: float, health: int, voltage_mv: int, remaining_percent: int
) -> VehicleStatus:
    """SYS_STATUS."""
    # 65535 mV means not sent; ArduPilot without a battery monitor sends 0.
    return VehicleStatus(
        received_s=received_s,
        sysid=sysid,
        battery_v=voltage_mv / 1000.0 if 0 < voltage_mv < 0xFFFF else None,
        battery_fraction=remaining_percent / 100.0 if 0 <= remaining_percent <= 100 else None,
        prearm_ok=bool(health & mavlink.MAV_SYS_STATUS_PREARM_CHECK),
    )


def system_time(
    sysid: int, received_s: float, utc_usec: int, boot_ms: int
) -> VehicleClock | Fault | None:
    """SYSTEM_TIME; None while UTC is unknown, a fault if it is absurd."""
    if utc_usec == 0:  # not known yet
        return None
    if not _MIN_UTC_USEC <= utc_usec <= _MAX_UTC_USEC:
        return _implausible("SYSTEM_TIME", sysid, time_unix_usec=utc_usec)
    return VehicleClock(
        received_s=received_s, sysid=sysid, utc_s=utc_usec / 1e6, boot_s=boot_ms / 1000.0
    )


def gps_raw_int(sysid: int, received_s: float, fix_type: int, satellites: int) -> GpsFix:
    """GPS_RAW_INT."""
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


def extended_sys_state(sysid: int, received_s: float, landed_state: int) -> LandedState:
    """EXTENDED_SYS_STATE."""
    return LandedState(
        received_s=received_s, sysid=sysid, state=_LANDED_STATES.get(landed_state, "unknown")
    )


def autopilot_version(
    sysid: int, received_s: float, uid: int, flight_sw_version: int
) -> VehicleVersion:
    """AUTOPILOT_VERSION."""
    return VehicleVersion(
        received_s=received_s, sysid=sysid, uid=uid, flight_sw_version=flight_sw_version
    )


def statustext(sysid: int, received_s: float, severity: int, text: bytes) -> StatusText:
    """STATUSTEXT."""
    # A stranger's control characters must not reach the operator's terminal.
    decoded = text.partition(b"\0")[0].decode("utf-8", "replace")
    return StatusText(
        received_s=received_s,
        sysid=sysid,
        severity=severity,
        text="".join(c if c.isprintable() else "?" for c in decoded),
    )
