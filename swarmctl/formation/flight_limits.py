"""The limits that no command may break: stand-off, geofence, separation, d_max and ceiling.

:func:`keep_outside` and :func:`keep_inside` bend a planned velocity before it breaks a circle;
:func:`violations` judges the planned positions before a command leaves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swarmctl.units import Array, Vector2


def keep_outside(
    offset: Vector2, velocity: Vector2, radius_m: float, braking_mps2: float
) -> Vector2:
    """Bend a velocity so that a circle is never entered.

    The inward speed may be at most what ``braking_mps2`` can stop before the circle; inside the
    circle it is at least slowly outward. Speed taken from the radial part goes into the
    tangential one, so that a vehicle slides round the circle instead of stopping before it.

    Args:
        offset: Position less the circle's centre, east and north, m.
        velocity: Wanted velocity relative to the centre, m/s.
        radius_m: Radius of the circle, m.
        braking_mps2: Deceleration to count on, m/s².

    Returns:
        Velocity relative to the centre, m/s.
    """
    distance = math.hypot(*offset)
    out = (offset[0] / distance, offset[1] / distance) if distance > 0.0 else (1.0, 0.0)
    outward = velocity[0] * out[0] + velocity[1] * out[1]
    gap = distance - radius_m
    least = -math.sqrt(braking_mps2 * gap) if gap > 0.0 else min(2.0, -0.5 * gap)
    if outward >= least:
        return velocity
    along = (-out[1], out[0])
    tangential = velocity[0] * along[0] + velocity[1] * along[1]
    speed = math.hypot(*velocity)
    slide = math.copysign(math.sqrt(max(0.0, speed * speed - least * least)), tangential)
    return (least * out[0] + slide * along[0], least * out[1] + slide * along[1])


def keep_inside(
    offset: Vector2, velocity: Vector2, radius_m: float, braking_mps2: float
) -> Vector2:
    """Take the outward speed that a circle (the geofence) does not allow out of a velocity.

    Args and returns as :func:`keep_outside`; nothing is turned into tangential speed.
    """
    distance = math.hypot(*offset)
    if distance == 0.0:
        return velocity
    out = (offset[0] / distance, offset[1] / distance)
    outward = velocity[0] * out[0] + velocity[1] * out[1]
    most = most_outward(radius_m - distance, braking_mps2)
    if outward <= most:
        return velocity
    cut = outward - most
    return (velocity[0] - cut * out[0], velocity[1] - cut * out[1])


def most_outward(gap_m: float, braking_mps2: float) -> float:
    """Greatest speed towards a limit ``gap_m`` ahead, m/s; negative, back inside, beyond it."""
    return math.sqrt(braking_mps2 * gap_m) if gap_m > 0.0 else max(-2.0, 0.5 * gap_m)


def limit(vector: Vector2, most: float) -> Vector2:
    """The vector, shortened to length ``most`` if it is longer."""
    length = math.hypot(*vector)
    if length <= most:
        return vector
    return (vector[0] * most / length, vector[1] * most / length)


@dataclass(frozen=True)
class FlightLimits:
    """The limits that a planned formation is judged by.

    Attributes:
        separation_m: Least 3-D distance between two UAVs.
        d_max_m: Greatest 3-D distance of a companion from the reference; None while it does not
            apply, before the formation is formed and on the way home.
        stand_off_m: Least 3-D distance from the estimated emitter.
        fence_radius_m: Greatest horizontal distance from the origin.
        ceiling_m: Greatest up coordinate at the origin, m.
    """

    separation_m: float
    d_max_m: float | None
    stand_off_m: float
    fence_radius_m: float
    ceiling_m: float


def violations(positions: Array, reference: int, emitter: Array, limits: FlightLimits) -> list[str]:
    """Everything a set of planned positions would break, as sentences' middles.

    Args:
        positions: (n, 3) planned ENU positions of all UAVs, m.
        reference: Row of the reference UAV.
        emitter: (3,) estimated emitter position, m.
        limits: The limits.

    Returns:
        One text per broken limit; empty when the plan is good.
    """
    found = []
    delta = positions[:, None, :] - positions[None, :, :]
    distance = np.sqrt((delta * delta).sum(axis=2))
    if limits.d_max_m is not None:
        farthest = float(distance[reference].max())
        if farthest > limits.d_max_m:
            found.append(f"a range to the reference of {farthest:.1f} m > {limits.d_max_m:g} m")
    np.fill_diagonal(distance, np.inf)
    nearest = float(distance.min())
    if nearest < limits.separation_m:
        found.append(f"a separation of {nearest:.1f} m < {limits.separation_m:g} m")
    to_emitter = float(np.sqrt(((positions - emitter) ** 2).sum(axis=1)).min())
    if to_emitter < limits.stand_off_m:
        found.append(f"a stand-off of {to_emitter:.1f} m < {limits.stand_off_m:.1f} m")
    from_origin = float(np.hypot(positions[:, 0], positions[:, 1]).max())
    if from_origin > limits.fence_radius_m:
        found.append(
            f"a distance from the origin of {from_origin:.0f} m > {limits.fence_radius_m:g} m"
        )
    highest = float(positions[:, 2].max())
    if highest > limits.ceiling_m:
        found.append(f"a height of {highest:.1f} m > {limits.ceiling_m:.1f} m")
    return found
