"""The messages a simulated autopilot can send, built from its state."""

from __future__ import annotations

import math
from collections.abc import Callable

from sim.guidance import Descend, TakeOff
from sim.mavlink import Message, dialect
from sim.onboard import GPS_FIX_S, Onboard
from swarmctl.frames import Vector

FLIGHT_SW_VERSION = 4 << 24 | 7 << 16 | dialect.FIRMWARE_VERSION_TYPE_OFFICIAL
"""ArduCopter 4.7.0."""
HARDWARE_UID = 0x53494D00
"""Added to the system id it makes the vehicle's hardware uid."""
CELLS = 4
FULL_CELL_V, EMPTY_CELL_V = 4.2, 3.5

_SENSORS = (
    dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | dialect.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | dialect.MAV_SYS_STATUS_SENSOR_3D_MAG
    | dialect.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | dialect.MAV_SYS_STATUS_SENSOR_GPS
    | dialect.MAV_SYS_STATUS_SENSOR_BATTERY
    | dialect.MAV_SYS_STATUS_AHRS
)


def heartbeat(onboard: Onboard) -> Message:
    """HEARTBEAT."""
    armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED if onboard.armed else 0
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_QUADROTOR,
        dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
        onboard.mode.base_mode | armed,
        onboard.mode.number,
        dialect.MAV_STATE_STANDBY if onboard.landed else dialect.MAV_STATE_ACTIVE,
        3,
    )


def sys_status(onboard: Onboard) -> Message:
    """SYS_STATUS."""
    present = _SENSORS | dialect.MAV_SYS_STATUS_PREARM_CHECK
    cell_v = EMPTY_CELL_V + (FULL_CELL_V - EMPTY_CELL_V) * onboard.charge
    return dialect.MAVLink_sys_status_message(
        present,
        present,
        present if onboard.prearm_ok else _SENSORS,
        100,
        round(1000.0 * CELLS * cell_v),
        1500 if onboard.armed else 50,
        round(100.0 * onboard.charge),
        0,
        0,
        0,
        0,
        0,
        0,
    )


def system_time(onboard: Onboard) -> Message:
    """SYSTEM_TIME; UTC is unknown before the GPS fix."""
    utc_s = onboard.utc_start_s + onboard.now_s if onboard.boot_s >= GPS_FIX_S else 0.0
    return dialect.MAVLink_system_time_message(round(utc_s * 1e6), _boot_ms(onboard))


def gps_raw_int(onboard: Onboard) -> Message:
    """GPS_RAW_INT."""
    if onboard.boot_s < GPS_FIX_S:
        return dialect.MAVLink_gps_raw_int_message(
            0, dialect.GPS_FIX_TYPE_NO_FIX, 0, 0, 0, 65535, 65535, 65535, 65535, 0
        )
    lat_e7, lon_e7, alt_mm = _geodetic_int(onboard, _reported(onboard))
    east, north, _ = onboard.truth.velocity_enu
    return dialect.MAVLink_gps_raw_int_message(
        round((onboard.utc_start_s + onboard.now_s) * 1e6),
        dialect.GPS_FIX_TYPE_3D_FIX,
        lat_e7,
        lon_e7,
        alt_mm,
        80,
        120,
        round(100.0 * math.hypot(east, north)),
        _centidegrees(math.atan2(east, north)),
        12,
    )


def attitude(onboard: Onboard) -> Message:
    """ATTITUDE: the airframe leans so that its rotors pull where the thrust is needed."""
    roll, pitch = lean(onboard.truth.thrust_enu, onboard.yaw_rad)
    yaw = math.remainder(onboard.yaw_rad, 2.0 * math.pi)
    return dialect.MAVLink_attitude_message(_boot_ms(onboard), roll, pitch, yaw, 0.0, 0.0, 0.0)


def lean(thrust_enu: Vector, yaw_rad: float) -> tuple[float, float]:
    """Roll and pitch (rad) that point the rotors along a thrust vector.

    In the heading's frame (forward, right, up) the rotors pull along
    ``(-cos(roll) sin(pitch), sin(roll), cos(roll) cos(pitch))``.
    """
    east, north, up = thrust_enu
    sin, cos = math.sin(yaw_rad), math.cos(yaw_rad)
    forward, right = east * sin + north * cos, east * cos - north * sin
    return math.atan2(right, math.hypot(forward, up)), math.atan2(-forward, up)


def global_position_int(onboard: Onboard) -> Message:
    """GLOBAL_POSITION_INT; zeros before there is a position."""
    if onboard.home_enu is None:
        return dialect.MAVLink_global_position_int_message(
            _boot_ms(onboard), 0, 0, 0, 0, 0, 0, 0, _centidegrees(onboard.yaw_rad)
        )
    reported = _reported(onboard)
    lat_e7, lon_e7, alt_mm = _geodetic_int(onboard, reported)
    east, north, up = onboard.truth.velocity_enu
    return dialect.MAVLink_global_position_int_message(
        _boot_ms(onboard),
        lat_e7,
        lon_e7,
        alt_mm,
        round(1000.0 * (reported[2] - onboard.home_enu[2])),
        round(100.0 * north),
        round(100.0 * east),
        round(-100.0 * up),
        _centidegrees(onboard.yaw_rad),
    )


def home_position(onboard: Onboard) -> Message | None:
    """HOME_POSITION; None before it is set."""
    if onboard.home_enu is None or onboard.origin_enu is None:
        return None
    x, y, z = (a - b for a, b in zip(onboard.home_enu, onboard.origin_enu, strict=True))
    lat_e7, lon_e7, alt_mm = _geodetic_int(onboard, onboard.home_enu)
    level = (1.0, 0.0, 0.0, 0.0)
    return dialect.MAVLink_home_position_message(
        lat_e7, lon_e7, alt_mm, y, x, -z, level, 0.0, 0.0, 0.0
    )


def extended_sys_state(onboard: Onboard) -> Message:
    """EXTENDED_SYS_STATE."""
    if onboard.landed:
        landed_state = dialect.MAV_LANDED_STATE_ON_GROUND
    elif isinstance(onboard.task, TakeOff):
        landed_state = dialect.MAV_LANDED_STATE_TAKEOFF
    elif isinstance(onboard.task, Descend) and onboard.task.landing:
        landed_state = dialect.MAV_LANDED_STATE_LANDING
    else:
        landed_state = dialect.MAV_LANDED_STATE_IN_AIR
    return dialect.MAVLink_extended_sys_state_message(
        dialect.MAV_VTOL_STATE_UNDEFINED, landed_state
    )


def autopilot_version(onboard: Onboard) -> Message:
    """AUTOPILOT_VERSION."""
    nothing = (0,) * 8
    return dialect.MAVLink_autopilot_version_message(
        dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        | dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT,
        FLIGHT_SW_VERSION,
        0,
        0,
        0,
        nothing,
        nothing,
        nothing,
        0,
        0,
        HARDWARE_UID + onboard.config.sysid,
    )


MESSAGES: dict[int, Callable[[Onboard], Message | None]] = {
    dialect.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    dialect.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
    dialect.MAVLINK_MSG_ID_SYSTEM_TIME: system_time,
    dialect.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw_int,
    dialect.MAVLINK_MSG_ID_ATTITUDE: attitude,
    dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position_int,
    dialect.MAVLINK_MSG_ID_HOME_POSITION: home_position,
    dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state,
    dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
}
"""What can be asked for, by message id."""


def _boot_ms(onboard: Onboard) -> int:
    return round(1000.0 * onboard.boot_s)


def _centidegrees(angle_rad: float) -> int:
    return round(100.0 * math.degrees(angle_rad)) % 36000


def _reported(onboard: Onboard) -> Vector:
    (x, y, z), (ex, ey, ez) = onboard.truth.position_enu, onboard.navigation.report_enu()
    return (x + ex, y + ey, z + ez)


def _geodetic_int(onboard: Onboard, position_enu: Vector) -> tuple[int, int, int]:
    """Latitude and longitude in 1e-7 degrees and altitude in mm."""
    lat, lon, alt = onboard.frame.to_geodetic(*position_enu)
    return (
        round(math.degrees(lat) * 1e7),
        round(math.degrees(lon) * 1e7),
        round(1000.0 * alt),
    )
