"""What the simulated autopilots read alike in SET_POSITION_TARGET_*: heading and turn rate."""

from __future__ import annotations

import math

from sim.mavlink import Message, dialect

YAW_IGNORED = 1 << 10
YAW_RATE_IGNORED = 1 << 11

SANE_SPEED_MPS = 1000.0
"""A component of a velocity (m/s) or an acceleration (m/s²) beyond this is not flown."""

BODY_FRAMES = frozenset({dialect.MAV_FRAME_BODY_NED, dialect.MAV_FRAME_BODY_OFFSET_NED})


def setpoint_yaw(message: Message, yaw_rad: float) -> float | None:
    """Heading that a setpoint asks for, rad clockwise from north; None if it asks for none.

    Args:
        message: The decoded message.
        yaw_rad: Heading of the vehicle, rad; body frames are relative to it.
    """
    if message.type_mask & YAW_IGNORED or not math.isfinite(message.yaw):
        return None
    return float(message.yaw) + (yaw_rad if message.coordinate_frame in BODY_FRAMES else 0.0)


def setpoint_yaw_rate(message: Message) -> float:
    """Turn rate that a setpoint asks for, rad/s clockwise; 0 if it asks for none."""
    if message.type_mask & YAW_RATE_IGNORED or not math.isfinite(message.yaw_rate):
        return 0.0
    return float(message.yaw_rate)


def turned(right: float, forward: float, yaw_rad: float) -> tuple[float, float]:
    """East and north components of a vector given right and forward of a heading."""
    sin, cos = math.sin(yaw_rad), math.cos(yaw_rad)
    return right * cos + forward * sin, forward * cos - right * sin
