"""The Fisher information of range differences on the emitter's position.

Frame of this module: the reference UAV at the origin, x along the line of sight (LOS) to the
emitter, y across it (counter-clockwise), z up. A design is (..., N, 2) of (theta rad, d m):
angle from the LOS and distance from the reference UAV. Leading axes are any number of designs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from swarmctl.errors import FormationError
from swarmctl.estimation.model.range_difference import effective_covariance, jacobian, rd_covariance
from swarmctl.formation.requirements import Noise
from swarmctl.units import Array


class Accuracy(NamedTuple):
    """1-sigma of the emitter's position, m.

    Attributes:
        along_m: Along the line of sight, (...).
        cross_m: Across it, (...).
    """

    along_m: Array
    cross_m: Array


def slots_in_los_frame(design: Array) -> Array:
    """Slots (..., N, 2): d cos theta along the LOS and d sin theta across it, m."""
    theta, d = design[..., 0], design[..., 1]
    return np.stack([d * np.cos(theta), d * np.sin(theta)], axis=-1)


def noise_covariance(companions: int, noise: Noise) -> Array:
    """Covariance of the RDs about those at the measured positions, (N, N), m²."""
    Cr = rd_covariance(np.full(companions, noise.sigma_r_m), noise.rho)
    return effective_covariance(Cr, noise.sigma_p_m)


def fisher(
    design: Array,
    range_m: float,
    noise: Noise,
    *,
    heights_m: Array | None = None,
    drop_m: float = 0.0,
) -> Array:
    """Fisher information of one epoch's RDs on the emitter's horizontal position.

    Exact geometry (finite range), full covariance. The emitter's height is known.

    Args:
        design: (..., N, 2) of (theta rad, horizontal distance m).
        range_m: Horizontal distance to the emitter, m.
        noise: Noise of the range differences.
        heights_m: Heights of the slots above the reference UAV, (..., N), m; 0 if left out.
        drop_m: Height of the reference UAV above the emitter, m.

    Returns:
        (..., 2, 2), along and across the LOS, 1/m².

    Raises:
        FormationError: The design has another shape, or a UAV is at the emitter.
    """
    if design.ndim < 2 or design.shape[-2] < 1 or design.shape[-1] != 2:
        raise FormationError(f"A design must be (..., N, 2) with N >= 1, not {design.shape}.")
    flat = slots_in_los_frame(design)
    height = np.zeros(flat.shape[:-1]) if heights_m is None else heights_m
    slots = np.concatenate([flat, np.broadcast_to(height, flat.shape[:-1])[..., None]], axis=-1)
    emitter = np.array([range_m, 0.0, -drop_m])
    if (np.square(slots - emitter).sum(-1) < 1e-6).any() or np.vecdot(emitter, emitter) < 1e-6:
        raise FormationError(
            f"A UAV is at the emitter, {range_m:g} m along the line of sight from the reference."
        )
    H = jacobian(emitter, np.zeros(3), slots)[..., :2]
    # One small inverse for any number of designs.
    weight = np.linalg.inv(noise_covariance(design.shape[-2], noise))
    information: Array = H.mT @ (weight @ H)
    return information


def predicted_accuracy(
    design: Array, range_m: float, noise: Noise, *, time_s: float, rate_hz: float
) -> Accuracy:
    """1-sigma of an emitter at rest from the RDs of some time, without a prior.

    Args:
        design: (..., N, 2) of (theta rad, distance m).
        range_m: Distance to the emitter, m.
        noise: Noise of the range differences; white.
        time_s: Duration of the measurements, s.
        rate_hz: Rate of the measurements, 1/s.

    Returns:
        Infinite where the design does not observe the position.

    Raises:
        FormationError: As :func:`fisher`; or the time or the rate is not above 0.
    """
    if not (time_s > 0.0 and rate_hz > 0.0):
        raise FormationError(f"Time and rate must be above 0, not {time_s:g} s and {rate_hz:g} Hz.")
    information = fisher(design, range_m, noise) * (time_s * rate_hz)
    a, b, c = information[..., 0, 0], information[..., 0, 1], information[..., 1, 1]
    determinant = a * c - b * b
    observed = determinant > 1e-12 * a * c
    inverse = np.where(observed, determinant, np.nan)
    along, cross = np.sqrt(c / inverse), np.sqrt(a / inverse)
    return Accuracy(np.where(observed, along, np.inf), np.where(observed, cross, np.inf))
