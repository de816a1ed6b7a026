"""SET_POSITION_TARGET_* as ArduCopter takes them: what to fly, or to stop.

A group of which any axis is ignored is ignored as a whole. Position, position and velocity,
and velocity are flown; acceleration next to them is not used; whatever else is asked for, an
unknown frame or a number nobody can fly makes the vehicle stop. (ArduCopter also flies a bare
acceleration; this autopilot stops.)
"""

from __future__ import annotations

import math

from sim.guidance import FlyTo, FlyVelocity, Hold, Task
from sim.mavlink import Message, dialect
from swarmctl.frames import LocalFrame, Vector

POSITION_IGNORED = 0b111
VELOCITY_IGNORED = 0b111 << 3
ACCELERATION_IGNORED = 0b111 << 6
YAW_IGNORED = 1 << 10

SANE_SPEED_MPS = 1000.0
"""A velocity component beyond this is not flown."""

AMSL_FRAMES = frozenset({dialect.MAV_FRAME_GLOBAL, dialect.MAV_FRAME_GLOBAL_INT})
HOME_FRAMES = frozenset(
    {dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}
)
OFFSET_FRAMES = frozenset(
    {
        dialect.MAV_FRAME_LOCAL_OFFSET_NED,
        dialect.MAV_FRAME_BODY_NED,
        dialect.MAV_FRAME_BODY_OFFSET_NED,
    }
)
BODY_FRAMES = frozenset({dialect.MAV_FRAME_BODY_NED, dialect.MAV_FRAME_BODY_OFFSET_NED})


def global_setpoint(
    message: Message, frame: LocalFrame, home_alt_amsl_m: float, now_s: float
) -> Task:
    """The task a SET_POSITION_TARGET_GLOBAL_INT asks for.

    Args:
        message: The decoded message.
        frame: Frame of the simulated world.
        home_alt_amsl_m: Altitude of home, m.
        now_s: Simulation time, s.
    """
    position = None
    if not message.type_mask & POSITION_IGNORED:
        alt = message.alt
        if message.coordinate_frame in HOME_FRAMES:
            alt += home_alt_amsl_m
        elif message.coordinate_frame not in AMSL_FRAMES:
            return Hold()
        lat, lon = message.lat_int * 1e-7, message.lon_int * 1e-7
        if abs(lat) > 90.0 or abs(lon) > 180.0 or not math.isfinite(alt):
            return Hold()
        position = frame.to_enu(math.radians(lat), math.radians(lon), alt)
    return _task(message.type_mask, position, (message.vy, message.vx, -message.vz), now_s)


def local_setpoint(
    message: Message, origin_enu: Vector, position_enu: Vector, yaw_rad: float, now_s: float
) -> Task:
    """The task a SET_POSITION_TARGET_LOCAL_NED asks for.

    Args:
        message: The decoded message.
        origin_enu: Origin of the vehicle's local frame, m.
        position_enu: Position of the vehicle, m.
        yaw_rad: Its heading, rad clockwise from north.
        now_s: Simulation time, s.
    """
    kind = message.coordinate_frame
    if kind != dialect.MAV_FRAME_LOCAL_NED and kind not in OFFSET_FRAMES:
        return Hold()
    turn = yaw_rad if kind in BODY_FRAMES else 0.0
    position = None
    if not message.type_mask & POSITION_IGNORED:
        east, north = _turned(message.y, message.x, turn)
        start = position_enu if kind in OFFSET_FRAMES else origin_enu
        position = (start[0] + east, start[1] + north, start[2] - message.z)
        if not all(map(math.isfinite, position)):
            return Hold()
    east, north = _turned(message.vy, message.vx, turn)
    return _task(message.type_mask, position, (east, north, -message.vz), now_s)


def setpoint_yaw(message: Message, yaw_rad: float) -> float | None:
    """Heading a setpoint asks for, rad clockwise from north; None where it leaves it open.

    Args:
        message: The decoded message.
        yaw_rad: Heading of the vehicle, from which body frames count.
    """
    if message.type_mask & YAW_IGNORED or not math.isfinite(message.yaw):
        return None
    return float(message.yaw) + (yaw_rad if message.coordinate_frame in BODY_FRAMES else 0.0)


def _turned(right: float, forward: float, yaw_rad: float) -> tuple[float, float]:
    """East and north of a vector to the right and forward of a heading."""
    sin, cos = math.sin(yaw_rad), math.cos(yaw_rad)
    return right * cos + forward * sin, forward * cos - right * sin


def _task(type_mask: int, position: Vector | None, velocity: Vector, now_s: float) -> Task:
    """The task for the groups that are not ignored."""
    if type_mask & VELOCITY_IGNORED:
        if position is None or not _ignores_acceleration(type_mask):
            return Hold()
        return FlyTo(position, None, now_s)
    if not all(abs(component) < SANE_SPEED_MPS for component in velocity):  # false for NaN
        return Hold()
    if position is None:
        return FlyVelocity(velocity, now_s)
    return FlyTo(position, velocity, now_s)


def _ignores_acceleration(type_mask: int) -> bool:
    return bool(type_mask & ACCELERATION_IGNORED)
