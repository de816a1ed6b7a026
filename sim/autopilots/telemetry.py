"""The telemetry messages of a simulated autopilot, built from its state."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from sim.autopilots.onboard_state import OnboardState
from sim.autopilots.takeoff_and_landing import Descend, TakeOff
from sim.mavlink import Message, dialect
from swarmctl.units import Vector

EKF_CONSTANT_POSITION = (
    dialect.ESTIMATOR_ATTITUDE
    | dialect.ESTIMATOR_VELOCITY_HORIZ
    | dialect.ESTIMATOR_VELOCITY_VERT
    | dialect.ESTIMATOR_POS_VERT_ABS
    | dialect.ESTIMATOR_CONST_POS_MODE
)
EKF_POSITION = (
    dialect.ESTIMATOR_ATTITUDE
    | dialect.ESTIMATOR_VELOCITY_HORIZ
    | dialect.ESTIMATOR_VELOCITY_VERT
    | dialect.ESTIMATOR_POS_HORIZ_REL
    | dialect.ESTIMATOR_POS_HORIZ_ABS
    | dialect.ESTIMATOR_POS_VERT_ABS
    | dialect.ESTIMATOR_PRED_POS_HORIZ_REL
    | dialect.ESTIMATOR_PRED_POS_HORIZ_ABS
)

_SENSORS = (
    dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | dialect.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | dialect.MAV_SYS_STATUS_SENSOR_3D_MAG
    | dialect.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | dialect.MAV_SYS_STATUS_SENSOR_GPS
    | dialect.MAV_SYS_STATUS_SENSOR_BATTERY
    | dialect.MAV_SYS_STATUS_AHRS
)


def heartbeat(onboard: OnboardState) -> Message:
    """HEARTBEAT."""
    armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED if onboard.armed else 0
    if onboard.failsafe:
        state = dialect.MAV_STATE_CRITICAL
    else:
        state = dialect.MAV_STATE_STANDBY if onboard.landed else dialect.MAV_STATE_ACTIVE
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_QUADROTOR,
        onboard.traits.autopilot,
        onboard.mode.base_mode | armed,
        onboard.mode.number,
        state,
        3,
    )


def sys_status(onboard: OnboardState) -> Message:
    """SYS_STATUS."""
    present = _SENSORS | dialect.MAV_SYS_STATUS_PREARM_CHECK
    health = present if onboard.prearm_ok else _SENSORS
    if not onboard.gps_fix:
        health &= ~dialect.MAV_SYS_STATUS_SENSOR_GPS
    return dialect.MAVLink_sys_status_message(
        present,
        present,
        health | onboard.traits.always_healthy,
        100,
        round(1000.0 * onboard.battery.voltage_v),
        1500 if onboard.armed else 50,
        round(100.0 * onboard.battery.charge),
        0,
        0,
        0,
        0,
        0,
        0,
    )


def system_time(onboard: OnboardState) -> Message:
    """SYSTEM_TIME; UTC is unknown before the GPS fix."""
    # Once set, the clock goes on without GPS.
    known = onboard.up_s >= onboard.boot_sequence.gps_fix_s
    utc_s = onboard.clock.utc_s(onboard.now_s) if known else 0.0
    return dialect.MAVLink_system_time_message(round(utc_s * 1e6), _boot_ms(onboard))


def gps_raw_int(onboard: OnboardState) -> Message:
    """GPS_RAW_INT."""
    if not onboard.gps_fix:
        return dialect.MAVLink_gps_raw_int_message(
            0, dialect.GPS_FIX_TYPE_NO_FIX, 0, 0, 0, 65535, 65535, 65535, 65535, 0
        )
    lat_e7, lon_e7, alt_mm = _geodetic_int(onboard, _reported(onboard))
    east, north, _ = onboard.truth.velocity_enu
    return dialect.MAVLink_gps_raw_int_message(
        round(onboard.clock.utc_s(onboard.now_s) * 1e6),
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


def attitude(onboard: OnboardState) -> Message:
    """ATTITUDE: the airframe leans towards the thrust."""
    roll, pitch = lean(onboard.truth.thrust_enu, onboard.yaw_rad)
    yaw = math.remainder(onboard.yaw_rad, 2.0 * math.pi)
    return dialect.MAVLink_attitude_message(_boot_ms(onboard), roll, pitch, yaw, 0.0, 0.0, 0.0)


def lean(thrust_enu: Vector, yaw_rad: float) -> tuple[float, float]:
    """Roll and pitch (rad) that point the rotors along a thrust vector (m/s²).

    In the heading's frame (forward, right, up) the rotors pull along
    ``(-cos(roll) sin(pitch), sin(roll), cos(roll) cos(pitch))``.
    """
    east, north, up = thrust_enu
    sin, cos = math.sin(yaw_rad), math.cos(yaw_rad)
    forward, right = east * sin + north * cos, east * cos - north * sin
    return math.atan2(right, math.hypot(forward, up)), math.atan2(-forward, up)


def global_position_int(onboard: OnboardState) -> Message:
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


def home_position(onboard: OnboardState) -> Message | None:
    """HOME_POSITION; None before it is set."""
    if onboard.home_enu is None or onboard.origin_enu is None:
        return None
    x, y, z = (a - b for a, b in zip(onboard.home_enu, onboard.origin_enu, strict=True))
    lat_e7, lon_e7, alt_mm = _geodetic_int(onboard, onboard.home_enu)
    level = (1.0, 0.0, 0.0, 0.0)
    return dialect.MAVLink_home_position_message(
        lat_e7, lon_e7, alt_mm, y, x, -z, level, 0.0, 0.0, 0.0
    )


def extended_sys_state(onboard: OnboardState) -> Message:
    """EXTENDED_SYS_STATE."""
    if onboard.landed:
        landed_state = dialect.MAV_LANDED_STATE_ON_GROUND
    elif isinstance(onboard.doing, TakeOff):
        landed_state = dialect.MAV_LANDED_STATE_TAKEOFF
    elif isinstance(onboard.doing, Descend) and onboard.doing.landing:
        landed_state = dialect.MAV_LANDED_STATE_LANDING
    else:
        landed_state = dialect.MAV_LANDED_STATE_IN_AIR
    return dialect.MAVLink_extended_sys_state_message(
        dialect.MAV_VTOL_STATE_UNDEFINED, landed_state
    )


def autopilot_version(onboard: OnboardState) -> Message:
    """AUTOPILOT_VERSION."""
    nothing = (0,) * 8
    traits = onboard.traits
    return dialect.MAVLink_autopilot_version_message(
        traits.capabilities,
        traits.flight_sw_version,
        0,
        0,
        0,
        nothing,
        nothing,
        nothing,
        0,
        0,
        traits.uid_base + onboard.config.sysid,
    )


def local_position_ned(onboard: OnboardState) -> Message | None:
    """LOCAL_POSITION_NED; None before there is a position."""
    if onboard.origin_enu is None:
        return None
    (x, y, z), (ox, oy, oz) = onboard.position_enu, onboard.origin_enu
    east, north, up = onboard.truth.velocity_enu
    return dialect.MAVLink_local_position_ned_message(
        _boot_ms(onboard), y - oy, x - ox, oz - z, north, east, -up
    )


def attitude_quaternion(onboard: OnboardState) -> Message:
    """ATTITUDE_QUATERNION: the attitude of ATTITUDE as a rotation from body to NED."""
    roll, pitch = lean(onboard.truth.thrust_enu, onboard.yaw_rad)
    sr, cr = math.sin(roll / 2.0), math.cos(roll / 2.0)
    sp, cp = math.sin(pitch / 2.0), math.cos(pitch / 2.0)
    sy, cy = math.sin(onboard.yaw_rad / 2.0), math.cos(onboard.yaw_rad / 2.0)
    return dialect.MAVLink_attitude_quaternion_message(
        _boot_ms(onboard),
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        0.0,
        0.0,
        0.0,
    )


def vfr_hud(onboard: OnboardState) -> Message:
    """VFR_HUD."""
    east, north, up = onboard.truth.velocity_enu
    speed = math.hypot(east, north)
    alt = 0.0 if onboard.home_enu is None else _geodetic_int(onboard, onboard.position_enu)[2]
    heading = round(math.degrees(onboard.yaw_rad)) % 360
    return dialect.MAVLink_vfr_hud_message(
        speed, speed, heading, 0 if onboard.landed else 40, alt * 1e-3, up
    )


def battery_status(onboard: OnboardState) -> Message:
    """BATTERY_STATUS."""
    unused = 65535
    return dialect.MAVLink_battery_status_message(
        0,
        dialect.MAV_BATTERY_FUNCTION_ALL,
        dialect.MAV_BATTERY_TYPE_LIPO,
        32767,
        [round(1000.0 * onboard.battery.voltage_v)] + [unused] * 9,
        1500 if onboard.armed else 50,
        round(onboard.battery.used_mah),
        -1,
        round(100.0 * onboard.battery.charge),
    )


def ekf_status_report(onboard: OnboardState) -> Message:
    """EKF_STATUS_REPORT."""
    flags = EKF_POSITION if onboard.position_ok else EKF_CONSTANT_POSITION
    return dialect.MAVLink_ekf_status_report_message(flags, 0.1, 0.1, 0.1, 0.1, 0.0)


def gps_global_origin(onboard: OnboardState) -> Message | None:
    """GPS_GLOBAL_ORIGIN; None before it is set."""
    if onboard.origin_enu is None:
        return None
    lat_e7, lon_e7, alt_mm = _geodetic_int(onboard, onboard.origin_enu)
    return dialect.MAVLink_gps_global_origin_message(lat_e7, lon_e7, alt_mm)


def timesync_request(onboard: OnboardState) -> Message:
    """TIMESYNC that asks the other side for its time."""
    return dialect.MAVLink_timesync_message(0, round(onboard.boot_s * 1e9))


def mission_current(onboard: OnboardState) -> Message:
    """MISSION_CURRENT."""
    return dialect.MAVLink_mission_current_message(onboard.mission_seq)


Builders = Mapping[int, Callable[[OnboardState], Message | None]]
"""What builds each message, by message id; it gives None while there is nothing to tell."""

COMMON: dict[int, Callable[[OnboardState], Message | None]] = {
    dialect.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    dialect.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
    dialect.MAVLINK_MSG_ID_SYSTEM_TIME: system_time,
    dialect.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw_int,
    dialect.MAVLINK_MSG_ID_ATTITUDE: attitude,
    dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: attitude_quaternion,
    dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: local_position_ned,
    dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position_int,
    dialect.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: gps_global_origin,
    dialect.MAVLINK_MSG_ID_MISSION_CURRENT: mission_current,
    dialect.MAVLINK_MSG_ID_VFR_HUD: vfr_hud,
    dialect.MAVLINK_MSG_ID_TIMESYNC: timesync_request,
    dialect.MAVLINK_MSG_ID_BATTERY_STATUS: battery_status,
    dialect.MAVLINK_MSG_ID_HOME_POSITION: home_position,
    dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state,
    dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
}
"""What every autopilot can send, by message id."""

ARDUPILOT = COMMON | {dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT: ekf_status_report}
"""What ArduCopter can send, by message id."""


def _boot_ms(onboard: OnboardState) -> int:
    return round(1000.0 * onboard.boot_s)


def _centidegrees(angle_rad: float) -> int:
    return round(100.0 * math.degrees(angle_rad)) % 36000


def _reported(onboard: OnboardState) -> Vector:
    (x, y, z), (ex, ey, ez) = onboard.truth.position_enu, onboard.navigation.report_enu()
    return (x + ex, y + ey, z + ez)


def _geodetic_int(onboard: OnboardState, position_enu: Vector) -> tuple[int, int, int]:
    """Latitude and longitude in 1e-7 degrees and altitude in mm."""
    lat, lon, alt = onboard.frame.to_geodetic(*position_enu)
    return (
        round(math.degrees(lat) * 1e7),
        round(math.degrees(lon) * 1e7),
        round(1000.0 * alt),
    )
