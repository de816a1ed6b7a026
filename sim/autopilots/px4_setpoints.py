"""How the simulated PX4 takes SET_POSITION_TARGET_*: axis by axis, or not at all."""

from __future__ import annotations

import math

from sim.autopilots.flight_tasks import FlyAcceleration, FlyAxes, Task
from sim.autopilots.setpoints import SANE_SPEED_MPS, turned
from sim.mavlink import Message, dialect
from swarmctl.frames import LocalFrame
from swarmctl.units import Vector

SANE_DISTANCE_M = 1e6
"""A local position component beyond this is not flown, m."""

FORCE_SET: int = dialect.POSITION_TARGET_TYPEMASK_FORCE_SET

Axes = tuple[float | None, float | None, float | None]

NONE: Axes = (None, None, None)


class RefusedError(Exception):
    """A setpoint is refused; the message is the STATUSTEXT that says so."""


def global_setpoint(
    message: Message, frame: LocalFrame, home_alt_amsl_m: float, now_s: float
) -> Task:
    """The task a SET_POSITION_TARGET_GLOBAL_INT asks for.

    Args:
        message: The decoded message.
        frame: Frame of the simulated world; its ground is flat, so above terrain is above home.
        home_alt_amsl_m: Altitude of home, m.
        now_s: Simulation time, s.

    Raises:
        RefusedError: Unknown frame, nothing to fly, or numbers that cannot be flown.
    """
    name, kind = "SET_POSITION_TARGET_GLOBAL_INT", message.coordinate_frame
    if kind not in {
        dialect.MAV_FRAME_GLOBAL_INT,
        dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
    }:
        raise RefusedError(f"{name} invalid frame {kind}")
    position = NONE
    if not message.type_mask & 0b111:
        lat, lon, alt = message.lat_int * 1e-7, message.lon_int * 1e-7, message.alt
        if abs(lat) > 90.0 or abs(lon) > 180.0 or not abs(alt) < SANE_DISTANCE_M:
            raise RefusedError(f"{name} invalid")
        if kind != dialect.MAV_FRAME_GLOBAL_INT:
            alt += home_alt_amsl_m
        position = frame.to_enu(math.radians(lat), math.radians(lon), alt)
    return _task(name, message, position, 0.0, now_s)


def local_setpoint(message: Message, origin_enu: Vector, yaw_rad: float, now_s: float) -> Task:
    """The task a SET_POSITION_TARGET_LOCAL_NED asks for.

    Args:
        message: The decoded message.
        origin_enu: Origin of the vehicle's local frame, m.
        yaw_rad: Heading of the vehicle, rad clockwise from north.
        now_s: Simulation time, s.

    Raises:
        RefusedError: Unknown frame, nothing to fly, or numbers that cannot be flown.
    """
    name, kind = "SET_POSITION_TARGET_LOCAL_NED", message.coordinate_frame
    if kind == dialect.MAV_FRAME_BODY_NED:  # no positions in it
        return _task(name, message, NONE, yaw_rad, now_s)
    if kind != dialect.MAV_FRAME_LOCAL_NED:
        raise RefusedError(f"{name} coordinate frame {kind} unsupported")
    x, y, z = _given(message.type_mask, (message.x, message.y, message.z), SANE_DISTANCE_M, name)
    east, north, up = origin_enu
    position = (
        None if y is None else east + y,
        None if x is None else north + x,
        None if z is None else up - z,
    )
    return _task(name, message, position, 0.0, now_s)


def _task(name: str, message: Message, position: Axes, turn_rad: float, now_s: float) -> Task:
    mask = message.type_mask
    velocity = _given(mask >> 3, (message.vx, message.vy, message.vz), SANE_SPEED_MPS, name)
    if any(axis is not None for axis in position + velocity):
        vx, vy, vz = (0.0 if axis is None else axis for axis in velocity)
        return FlyAxes(position, (*turned(vy, vx, turn_rad), -vz))
    acceleration = _given(mask >> 6, (message.afx, message.afy, message.afz), SANE_SPEED_MPS, name)
    if any(axis is not None for axis in acceleration) and not mask & FORCE_SET:
        ax, ay, az = (0.0 if axis is None else axis for axis in acceleration)
        return FlyAcceleration((*turned(ay, ax, turn_rad), -az), now_s, math.inf)
    raise RefusedError(f"{name} invalid")


def _given(mask: int, values: Vector, greatest: float, name: str) -> Axes:
    """The components that are neither NaN nor ignored by the lowest three bits of a mask."""
    x, y, z = (
        None if mask >> i & 1 or math.isnan(value) else value for i, value in enumerate(values)
    )
    if any(axis is not None and not abs(axis) < greatest for axis in (x, y, z)):
        raise RefusedError(f"{name} invalid")
    return x, y, z
