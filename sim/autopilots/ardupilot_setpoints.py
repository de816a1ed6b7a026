"""How the simulated ArduCopter takes SET_POSITION_TARGET_*: the task to fly, or a stop.

If one axis of a group is ignored, so is the whole group. Position, position with velocity,
velocity, and acceleration are flown; acceleration next to velocity is not used. Any other
combination, an unknown frame, or a number that cannot be flown stops the vehicle. If a position is
given above terrain, the vehicle keeps its present altitude.
"""

from __future__ import annotations

import math

from sim.autopilots.flight_tasks import FlyAcceleration, FlyTo, FlyVelocity, Hold, Task
from sim.autopilots.setpoints import BODY_FRAMES, SANE_SPEED_MPS, turned
from sim.mavlink import Message, dialect
from swarmctl.frames import LocalFrame
from swarmctl.units import Vector

POSITION_IGNORED = 0b111
VELOCITY_IGNORED = 0b111 << 3
ACCELERATION_IGNORED = 0b111 << 6

AMSL_FRAMES = frozenset({dialect.MAV_FRAME_GLOBAL, dialect.MAV_FRAME_GLOBAL_INT})
HOME_FRAMES = frozenset(
    {dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}
)
TERRAIN_FRAMES = frozenset(
    {dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT, dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT}
)
OFFSET_FRAMES = frozenset(
    {
        dialect.MAV_FRAME_LOCAL_OFFSET_NED,
        dialect.MAV_FRAME_BODY_NED,
        dialect.MAV_FRAME_BODY_OFFSET_NED,
    }
)


def global_setpoint(
    message: Message,
    frame: LocalFrame,
    home_alt_amsl_m: float,
    position_enu: Vector,
    now_s: float,
    timeout_s: float,
) -> Task:
    """The task a SET_POSITION_TARGET_GLOBAL_INT asks for.

    Args:
        message: The decoded message.
        frame: Frame of the simulated world.
        home_alt_amsl_m: Altitude of home, m.
        position_enu: Position of the vehicle, m.
        now_s: Simulation time, s.
        timeout_s: Velocity and acceleration count for this long, s.
    """
    position = None
    if not message.type_mask & POSITION_IGNORED:
        alt = message.alt
        if message.coordinate_frame in HOME_FRAMES:
            alt += home_alt_amsl_m
        elif message.coordinate_frame in TERRAIN_FRAMES:
            alt = frame.to_geodetic(*position_enu)[2]
        elif message.coordinate_frame not in AMSL_FRAMES:
            return Hold()
        lat, lon = message.lat_int * 1e-7, message.lon_int * 1e-7
        if abs(lat) > 90.0 or abs(lon) > 180.0 or not math.isfinite(alt):
            return Hold()
        position = frame.to_enu(math.radians(lat), math.radians(lon), alt)
    velocity = (message.vy, message.vx, -message.vz)
    acceleration = (message.afy, message.afx, -message.afz)
    return _task(message.type_mask, position, velocity, acceleration, now_s, timeout_s)


def local_setpoint(
    message: Message,
    origin_enu: Vector,
    position_enu: Vector,
    yaw_rad: float,
    now_s: float,
    timeout_s: float,
) -> Task:
    """The task a SET_POSITION_TARGET_LOCAL_NED asks for.

    Args:
        message: The decoded message.
        origin_enu: Origin of the vehicle's local frame, m.
        position_enu: Position of the vehicle, m.
        yaw_rad: Its heading, rad clockwise from north.
        now_s: Simulation time, s.
        timeout_s: Velocity and acceleration count for this long, s.
    """
    kind = message.coordinate_frame
    if kind != dialect.MAV_FRAME_LOCAL_NED and kind not in OFFSET_FRAMES:
        return Hold()
    turn = yaw_rad if kind in BODY_FRAMES else 0.0
    position = None
    if not message.type_mask & POSITION_IGNORED:
        east, north = turned(message.y, message.x, turn)
        start = position_enu if kind in OFFSET_FRAMES else origin_enu
        position = (start[0] + east, start[1] + north, start[2] - message.z)
        if not all(map(math.isfinite, position)):
            return Hold()
    velocity = (*turned(message.vy, message.vx, turn), -message.vz)
    acceleration = (*turned(message.afy, message.afx, turn), -message.afz)
    return _task(message.type_mask, position, velocity, acceleration, now_s, timeout_s)


def _task(
    type_mask: int,
    position: Vector | None,
    velocity: Vector,
    acceleration: Vector,
    now_s: float,
    timeout_s: float,
) -> Task:
    """The task for the groups that are not ignored."""
    without_acceleration = bool(type_mask & ACCELERATION_IGNORED)
    if type_mask & VELOCITY_IGNORED:
        if position is not None and without_acceleration:
            return FlyTo(position, None, now_s, timeout_s)
        if position is None and not without_acceleration and _sane(acceleration):
            return FlyAcceleration(acceleration, now_s, timeout_s)
        return Hold()
    if not _sane(velocity):
        return Hold()
    if position is None:
        return FlyVelocity(velocity, now_s, timeout_s)
    return FlyTo(position, velocity, now_s, timeout_s)


def _sane(vector: Vector) -> bool:
    return all(abs(component) < SANE_SPEED_MPS for component in vector)  # false for NaN
