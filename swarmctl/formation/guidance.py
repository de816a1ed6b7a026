"""How the formation is steered: the LOS it is drawn against and the reference UAV's velocity."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swarmctl.units import Array, Vector2


def wrap_angle(angle_rad: float) -> float:
    """The same angle in (-pi, pi]."""
    return math.pi - (math.pi - angle_rad) % (2.0 * math.pi)


@dataclass(frozen=True)
class LineOfSight:
    """The LOS the formation is drawn against.

    Attributes:
        angle_rad: LOS angle lambda, from East.
        rate_rads: Its rate of change, rad/s; slots move at this times their distance.
    """

    angle_rad: float
    rate_rads: float


def follow_line_of_sight(
    los: LineOfSight,
    bearing_rad: float,
    bearing_rate_rads: float,
    max_correction_rads: float,
    dt: float,
    tau_s: float = 3.0,
) -> LineOfSight:
    """Turn the formation's LOS towards the bearing of the estimate.

    The bearing's own rate, known from the motion of reference and estimate, is followed at
    once; what remains is a first-order lag of ``tau_s`` that swallows the estimate's jitter,
    limited in rate so that a first estimate far from the prior does not whip the outer slots
    around faster than their vehicles can fly.

    Args:
        los: LOS of the last control period.
        bearing_rad: Bearing reference-to-estimate now, rad from East.
        bearing_rate_rads: Its geometric rate, rad/s.
        max_correction_rads: Limit of the correction, rad/s.
        dt: Control period, s.
        tau_s: Time constant of the correction, s.
    """
    correction = wrap_angle(bearing_rad - los.angle_rad) / tau_s
    correction = max(-max_correction_rads, min(max_correction_rads, correction))
    rate = bearing_rate_rads + correction
    return LineOfSight(wrap_angle(los.angle_rad + rate * dt), rate)


def orbit_speed(max_speed_mps: float, radius_m: float, d_m: float) -> float:
    """Reference speed on an orbit at which the outermost follower just flies its top speed.

    A slot ``d`` behind the reference turns on a circle of radius + d:
    v = v_max · radius / (radius + d).
    """
    return max_speed_mps * radius_m / (radius_m + d_m)


def pace(
    offset: Vector2, relative: Vector2, drift: Vector2, slots: Array, speeds_mps: Array
) -> float:
    """Share of its velocity that the reference UAV may fly for everyone to keep up.

    The formation turns with the line of sight, at ``omega = offset x relative / |offset|²``, so a
    slot ``s`` moves at ``drift + share (relative + omega x s)``, which each vehicle must be able
    to fly.

    Args:
        offset: Reference position less emitter estimate, east and north, m.
        relative: Wanted velocity of the reference relative to the emitter, m/s.
        drift: Velocity of the emitter, m/s.
        slots: (n, 2) offsets from the reference UAV, m; zero for the reference itself.
        speeds_mps: (n,) greatest speed of each vehicle, m/s.

    Returns:
        Share of ``relative``, in [0, 1]; 0 if one cannot even keep up with the emitter.
    """
    squared = max(offset[0] ** 2 + offset[1] ** 2, 1.0)
    omega = (offset[0] * relative[1] - offset[1] * relative[0]) / squared
    full = np.array(relative) + omega * np.column_stack((-slots[:, 1], slots[:, 0]))
    a = (full * full).sum(axis=1)
    b = full @ np.array(drift)
    c = drift[0] ** 2 + drift[1] ** 2 - speeds_mps**2
    if (c > 0.0).any():
        return 0.0
    return float(min(1.0, np.min(-c / np.maximum(b + np.sqrt(b * b - a * c), 1e-9))))


def approach_and_orbit(
    offset: Vector2,
    emitter_velocity: Vector2,
    radius_m: float,
    cruise_mps: float,
    orbit_mps: float,
    gain: float = 0.1,
) -> Vector2:
    """Velocity field of the reference UAV: along the LOS to the stand-off circle, then round it.

    The radial speed is proportional to the distance from the circle, at most the cruise speed;
    what it does not use goes into the tangential one, counter-clockwise, so that approach and
    orbit join without a corner. The emitter's own velocity is added: the circle moves with it.

    Args:
        offset: Reference position less emitter estimate, east and north, m.
        emitter_velocity: Estimated emitter velocity, m/s.
        radius_m: Horizontal radius of the orbit, m.
        cruise_mps: Speed of the approach, m/s.
        orbit_mps: Speed on the orbit, m/s.
        gain: Radial speed per metre off the circle, 1/s.

    Returns:
        Velocity east, north, m/s.
    """
    distance = math.hypot(*offset)
    out = (offset[0] / distance, offset[1] / distance) if distance > 0.0 else (1.0, 0.0)
    radial = max(-cruise_mps, min(cruise_mps, gain * (radius_m - distance)))
    tangential = orbit_mps * (1.0 - (radial / cruise_mps) ** 2)
    return (
        radial * out[0] - tangential * out[1] + emitter_velocity[0],
        radial * out[1] + tangential * out[0] + emitter_velocity[1],
    )


def go_to(
    offset: Vector2, speed_mps: float, acceleration_mps2: float, gain: float = 0.5
) -> Vector2:
    """Velocity towards a fixed point that arrives without overshoot.

    Proportional near the point, and never faster than one can brake from.

    Args:
        offset: Goal less position, east and north, m.
        speed_mps: Greatest speed, m/s.
        acceleration_mps2: Braking acceleration to count on, m/s².
        gain: Speed per metre near the goal, 1/s.
    """
    distance = math.hypot(*offset)
    if distance == 0.0:
        return (0.0, 0.0)
    speed = min(speed_mps, gain * distance, math.sqrt(acceleration_mps2 * distance))
    return (offset[0] / distance * speed, offset[1] / distance * speed)
