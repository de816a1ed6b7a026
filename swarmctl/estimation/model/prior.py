"""Where a track begins: what is known beforehand, and where to start looking.

A prior is a normal distribution of the emitter's position and velocity. It may be as wide as a
mission's area: the starts of :func:`starts` find every mode of what prior and first
measurements tell together, and the swarm's motion picks among them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.units import Array

_BEARINGS = 24
_GROWTH = 1.5
"""Ratio of neighbouring ranges of the grid: wave curvature, which tells the range, is linear in
its inverse, and an iteration corrects a third of it."""
_OUTSIDE = 12.0
"""Squared sigmas of the prior beyond which the grid does not look."""
_WIDE = 0.2
"""A prior with a sigma above this share of the range needs more than one start."""


class Prior(NamedTuple):
    """What is known before the first measurement.

    Attributes:
        mean: Position and velocity, (2d,), SI.
        covariance: (2d, 2d), positive definite.
    """

    mean: Array
    covariance: Array


def sector(
    origin: Array,
    bearing_rad: float,
    half_width_rad: float,
    nearest_m: float,
    farthest_m: float,
    speed_mps: float,
    height: tuple[float, float] | None = None,
) -> Prior:
    """The normal distribution with the mean and covariance of a uniform sector.

    Uniform in bearing and in range; a half-width of pi is all around.

    Args:
        origin: Apex, (2,) east and north, m.
        bearing_rad: Bearing of its middle, from east, counter-clockwise.
        half_width_rad: To either side, (0, pi].
        nearest_m: Range, >= 0.
        farthest_m: Range, above ``nearest_m``.
        speed_mps: 1-sigma of the emitter's velocity per axis, > 0.
        height: Mean and 1-sigma, m, for three axes; None for two.

    Raises:
        EstimationError: A number is outside its interval.
    """
    if not (0.0 < half_width_rad <= math.pi and math.isfinite(bearing_rad)):
        raise EstimationError(f"half_width_rad must be in (0, pi], not {half_width_rad!r}.")
    if not 0.0 <= nearest_m < farthest_m < math.inf:
        raise EstimationError(
            f"A sector reaches from nearest_m >= 0 to a larger farthest_m, not from "
            f"{nearest_m!r} to {farthest_m!r}."
        )
    if not 0.0 < speed_mps < math.inf:
        raise EstimationError(f"speed_mps must be a finite number > 0, not {speed_mps!r}.")
    # Moments of the range, and of cos and sin of the angle from the middle.
    first = 0.5 * (nearest_m + farthest_m)
    second = (nearest_m**2 + nearest_m * farthest_m + farthest_m**2) / 3.0
    cosine = math.sin(half_width_rad) / half_width_rad
    double = math.sin(2.0 * half_width_rad) / (2.0 * half_width_rad)
    along = second * 0.5 * (1.0 + double) - (first * cosine) ** 2
    across = second * 0.5 * (1.0 - double)
    c, s = math.cos(bearing_rad), math.sin(bearing_rad)
    turn = np.array([[c, -s], [s, c]])
    flat = turn @ np.diag([along, across]) @ turn.T
    place = np.asarray(origin, dtype=np.float64) + first * cosine * turn[:, 0]
    d = 2 if height is None else 3
    mean = np.zeros(2 * d)
    covariance = np.diag(np.full(2 * d, speed_mps**2))
    mean[:2], covariance[:2, :2] = place, flat
    if height is not None:
        mean[2], covariance[2, 2] = height[0], height[1] ** 2
    return Prior(mean, covariance)


def is_wide(prior: Prior, receivers: Array) -> bool:
    """Whether one start may not find the most probable mode.

    Args:
        prior: The emitter's prior.
        receivers: Positions, (R, d), m.
    """
    d = receivers.shape[-1]
    spread = math.sqrt(float(np.linalg.eigvalsh(prior.covariance[:d, :d])[-1]))
    away = np.sqrt(((prior.mean[:d] - receivers) ** 2).sum(-1)).min()
    return bool(spread > _WIDE * away)


def starts(prior: Prior, receivers: Array) -> Array:
    """A grid over the prior, polar about the swarm, a third axis by the prior.

    Args:
        prior: The emitter's prior.
        receivers: Positions, (R, d), m.

    Returns:
        (S, 2d): the prior's mean first.
    """
    d = receivers.shape[-1]
    P = prior.covariance[:d, :d]
    centre = receivers.mean(0)
    aperture = float(np.sqrt(((receivers - centre) ** 2).sum(-1)).max())
    reach = float(np.linalg.norm(prior.mean[:d] - centre))
    reach += math.sqrt(_OUTSIDE * float(np.linalg.eigvalsh(P)[-1]))
    least = max(0.5 * aperture, 1e-3 * reach)
    ranges = least * _GROWTH ** np.arange(max(1, math.ceil(math.log(reach / least, _GROWTH))))
    angles = 2.0 * math.pi / _BEARINGS * np.arange(_BEARINGS)
    flat = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    grid = (centre[:2] + ranges[:, None, None] * flat).reshape(-1, 2)
    position = np.empty((len(grid), d))
    position[:, :2] = grid
    if d == 3:
        slope = np.linalg.solve(P[:2, :2], P[:2, 2])
        position[:, 2] = prior.mean[2] + (grid - prior.mean[:2]) @ slope
    off = position - prior.mean[:d]
    inside = np.vecdot(off, np.linalg.solve(P, off.T).T) <= _OUTSIDE
    # Velocity: what the prior expects of an emitter at that place.
    slope = np.linalg.solve(P, prior.covariance[:d, d:])
    velocity = prior.mean[d:] + off @ slope
    found = np.concatenate([position, velocity], axis=-1)[inside]
    return np.concatenate([prior.mean[None], found])
