"""The paper's "amount of target information" L_p, Eqs. (16)-(34): exact, and as approximated.

L_p is the determinant of the linear model's Fisher information on the emitter's position, 1/m⁴.
The model is ``y_j = r_j² - |m_j|² = -2 m_jᵀ p - 2 r_j D_0``, with m_j the companion's baseline,
r_j its range difference (RD), p the emitter relative to the reference UAV and D_0 = |p|; each
row has noise v_j of variance R_j. Angles count from the line of sight (LOS), so L_p does not
depend on the LOS angle, and only the exact forms depend on the range.

It is kept to compare with. Eq. (16) is not a faithful index of the track: at Table 1's noise it
puts the uniform circle above the paper's own optimum (29), whose track is the better one. What
misleads it is the range it takes as known; with D_0 unknown it orders the two rightly. The index
to design by is :func:`swarmctl.formation.information.fisher`.

Errata that run through all of it:

- From (16) on the print has the factor 4; the determinant of the 2 x 2 matrix (13) takes it
  squared, 16. It does not move an optimum.
- (13) takes D_0 as known, though the state has it as an unknown.
- (4) takes the v_j as independent, though all companions share p_0 and the reference receiver.

A design is (..., N, 2) of (theta rad, d m): angle from the LOS and distance from the reference
UAV. Leading axes are any number of designs; an index is (...).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from swarmctl.errors import FormationError
from swarmctl.estimation.model.range_difference import range_differences, rd_covariance
from swarmctl.formation.information import slots_in_los_frame
from swarmctl.formation.requirements import Noise
from swarmctl.units import Array


def exact_independent(design: Array, range_m: float, noise: Noise) -> Array:
    """Eq. (16): each companion's R_j alone, D_0 known. As printed but for the factor 16.

    Args:
        design: (..., N, 2) of (theta rad, d m).
        range_m: From the reference UAV to the emitter, m.
        noise: Noise of the range differences; rho has no part in it.

    Returns:
        (...), 1/m⁴.
    """
    baselines = slots_in_los_frame(design)
    return _independent(baselines, _variance(baselines, _rd(baselines, range_m), noise))


def exact_correlated(design: Array, range_m: float, noise: Noise) -> Array:
    """Eq. (16) with the full covariance of v, D_0 known: ``det(4 mᵀ R⁻¹ m)``.

    Args:
        design: (..., N, 2) of (theta rad, d m).
        range_m: From the reference UAV to the emitter, m.
        noise: Noise of the range differences.

    Returns:
        (...), 1/m⁴.
    """
    baselines = slots_in_los_frame(design)
    white = _whitened(baselines, measurement_covariance(design, range_m, noise))
    return 16.0 * _pair_sum(white[..., 0], white[..., 1])


def exact_correlated_unknown_range(design: Array, range_m: float, noise: Noise) -> Array:
    """Eq. (16) with the full covariance of v and D_0 unknown, as the paper's filter has it.

    The determinant of the Schur complement over D_0 of the information on [p; D_0], which is
    what (13) would be without its erratum. Zero for N < 3.

    Args:
        design: (..., N, 2) of (theta rad, d m).
        range_m: From the reference UAV to the emitter, m.
        noise: Noise of the range differences.

    Returns:
        (...), 1/m⁴.
    """
    baselines = slots_in_los_frame(design)
    rows = np.concatenate([baselines, _rd(baselines, range_m)[..., None]], axis=-1)
    white = _whitened(rows, measurement_covariance(design, range_m, noise))
    m, r = white[..., :2], white[..., 2:]
    # The Schur complement is what is left of m across r. Where no RD is other than zero, D_0
    # has no part in y and takes nothing away.
    length = np.linalg.norm(r, axis=-2, keepdims=True)
    unit = r / np.where(length > 0.0, length, 1.0)
    m = m - unit @ (unit.mT @ m)
    return 16.0 * _pair_sum(m[..., 0], m[..., 1])


def measurement_covariance(design: Array, range_m: float, noise: Noise) -> Array:
    """Covariance of v below Eq. (2), with what the companions share; its diagonal is R_j.

    ``R_ij = 4 r_i r_j Cr_ij + 2 Cr_ij² + Σ_axes (4 m_i m_j C_ij + 2 C_ij²)`` with the RDs'
    covariance Cr and the baselines' ``C_ij = sigma_p² (1 + delta_ij)``. Eq. (4) has its diagonal
    only.

    Args:
        design: (..., N, 2) of (theta rad, d m).
        range_m: From the reference UAV to the emitter, m.
        noise: Noise of the range differences.

    Returns:
        (..., N, N), m⁴.
    """
    baselines = slots_in_los_frame(design)
    rd = _rd(baselines, range_m)
    companions = design.shape[-2]
    Cr = rd_covariance(np.full(companions, noise.sigma_r_m), noise.rho)
    C = noise.sigma_p_m**2 * (1.0 + np.eye(companions))
    of_rd = 4.0 * rd[..., :, None] * rd[..., None, :] * Cr + 2.0 * Cr**2
    of_baselines = 4.0 * (baselines @ baselines.mT) * C + baselines.shape[-1] * 2.0 * C**2
    covariance: Array = of_rd + of_baselines
    return covariance


def far_field(design: Array, noise: Noise) -> Array:
    """Eq. (21), factor 16: (16) with ``r_j = -d_j cos theta_j`` of Eq. (20).

    (20) drops ``d_j² sin² theta_j / 2 D_0``. That is small beside d, but at cos theta = 0 it is
    all of r_j; it may be left out there only where sigma_p outweighs it.

    Args:
        design: (..., N, 2) of (theta rad, d m).
        noise: Noise of the range differences; rho has no part in it.

    Returns:
        (...), 1/m⁴.
    """
    baselines = slots_in_los_frame(design)
    return _independent(baselines, _variance(baselines, -baselines[..., 0], noise))


def far_field_exact_positions(design: Array, noise: Noise) -> Array:
    """Eq. (24), factor 16: (21) with R_j of (22), which leaves out 8 sigma_p² (d² + 2 sigma_p²).

    "sigma_p << 1", the paper's reason, has a unit. What has to hold is that 8 sigma_p² is small
    beside ``2 sigma_r² (2 cos² theta + (sigma_r / d)²)``; in Table 1 it is twice to a million
    times that.

    Args:
        design: (..., N, 2) of (theta rad, d m).
        noise: Noise of the range differences; only sigma_r has a part in it.

    Returns:
        (...), 1/m⁴.
    """
    return far_field(design, Noise(noise.sigma_r_m, 0.0, noise.rho))


def tangent_variance(design: Array, noise: Noise) -> Array:
    """Eq. (25), Case 1, |cos theta| >> sigma_r / d: N² / sigma_r⁴ x variance of tan theta.

    With the factor 16 of (16) it is N² / sigma_r⁴, where 1/4 of that is printed. It grows
    without bound towards cos theta = 0, where its premise fails: the optima (29) and (31) the
    paper draws from it lie there, and at (31) L_p is 0.

    Args:
        design: (..., N, 2) of (theta rad, d m); the distances have no part in it.
        noise: Noise of the range differences; only sigma_r has a part in it.

    Returns:
        (...), 1/m⁴.
    """
    t = np.tan(design[..., 0])
    spread: Array = design.shape[-2] ** 2 / noise.sigma_r_m**4 * t.var(axis=-1)
    return spread


def least_tangent_variance(design: Array, noise: Noise) -> Array:
    """Eq. (28), factor 16: the least value (25) has over the last companion's angle.

    It is at ``tan theta_N`` = mean of the other tangents, (26). This is what the paper takes for
    the worst case of (23); the LOS turns under all companions at once, see
    :func:`least_over_los`. Its form (30), for even N with the first N - 2 in pairs +-theta,
    prints N / (N-1)² before ``tan² theta_(N-1)`` where (N-2) / (N-1)² follows.

    Args:
        design: (..., N, 2) of (theta rad, d m), N at least 2; the last row is not looked at.
        noise: Noise of the range differences; only sigma_r has a part in it.

    Returns:
        (...), 1/m⁴.

    Raises:
        FormationError: N is 1.
    """
    companions = design.shape[-2]
    if companions < 2:
        raise FormationError("The least over the last companion needs another one: N is 1.")
    others = np.tan(design[..., :-1, 0]).var(axis=-1)
    least: Array = companions * (companions - 1) / noise.sigma_r_m**4 * others
    return least


def perpendicular_limit(design: Array, noise: Noise) -> Array:
    """Eq. (32), Case 2, |cos theta| << sigma_r / d: (24) with ``R_j = 2 sigma_r⁴``.

    Sums run over all N (N - 1 is printed); with the factor 16 it is 4 / sigma_r⁸ (1 / sigma_r⁸
    is printed).

    Args:
        design: (..., N, 2) of (theta rad, d m).
        noise: Noise of the range differences; only sigma_r has a part in it.

    Returns:
        (...), 1/m⁴.
    """
    x, y = np.moveaxis(slots_in_los_frame(design), -1, 0)
    determinant: Array = np.vecdot(x, x) * np.vecdot(y, y) - np.square(np.vecdot(x, y))
    return 4.0 / noise.sigma_r_m**8 * determinant


def perpendicular_limit_by_pairs(design: Array, noise: Noise) -> Array:
    """Eq. (34): (32) as a sum over pairs of ``d_i² d_j² sin²(theta_j - theta_i)``.

    Each pair once: the printed double sum has it twice and lacks the 1/2. Sums run over all N
    (N - 1 is printed), factor 4 / sigma_r⁸ as in :func:`perpendicular_limit`.

    Args:
        design: (..., N, 2) of (theta rad, d m).
        noise: Noise of the range differences; only sigma_r has a part in it.

    Returns:
        (...), 1/m⁴.
    """
    theta, d = design[..., 0], design[..., 1]
    between = np.sin(theta[..., None, :] - theta[..., :, None])
    squares = np.square(d[..., None, :] * d[..., :, None] * between)
    double_sum: Array = squares.sum(axis=(-2, -1))
    return 4.0 / noise.sigma_r_m**8 * 0.5 * double_sum


def least_over_los(
    index: Callable[[Array], Array], design: Array, sector_rad: float, steps: int = 121
) -> Array:
    """The inner min of Eq. (23): the least index over LOS angles, the formation standing still.

    The paper takes the min over one companion's angle, (26)-(28); it is the LOS that turns, and
    all angles change with it. The sector is looked at step by step: where the index is smooth
    the result is above the least by no more than h²/8 of its second derivative, h the step.

    Args:
        index: A function of designs (..., N, 2), vectorised: ``lambda d: far_field(d, noise)``.
        design: (..., N, 2) of (theta rad, d m), theta from the middle of the sector.
        sector_rad: Half width of the sector, rad.
        steps: LOS angles looked at, evenly spaced with both edges; odd has the middle as well.

    Returns:
        (...), in the index's unit.
    """
    turned = np.repeat(design[None], steps, axis=0)
    los = np.linspace(-sector_rad, sector_rad, steps)
    turned[..., 0] -= los.reshape(-1, *[1] * (design.ndim - 1))
    least: Array = index(turned).min(axis=0)
    return least


def _rd(baselines: Array, range_m: float) -> Array:
    emitter = np.array([range_m, 0.0])
    return range_differences(emitter, np.zeros(2), baselines)


def _variance(baselines: Array, rd: Array, noise: Noise) -> Array:
    """R_j below Eq. (13), (..., N), m⁴.

    (21) and (22) print it divided by d_j², and the baselines by d_j.
    """
    var_r, var_p = noise.sigma_r_m**2, noise.sigma_p_m**2
    of_rd = 2.0 * var_r * (2.0 * rd * rd + var_r)
    variance: Array = of_rd + 8.0 * var_p * (np.vecdot(baselines, baselines) + 2.0 * var_p)
    return variance


def _independent(baselines: Array, variance: Array) -> Array:
    scaled = baselines / np.sqrt(variance)[..., None]
    return 16.0 * _pair_sum(scaled[..., 0], scaled[..., 1])


def _whitened(rows: Array, covariance: Array) -> Array:
    white: Array = np.linalg.solve(np.linalg.cholesky(covariance), rows)
    return white


def _pair_sum(x: Array, y: Array) -> Array:
    """``Σx² Σy² - (Σxy)²`` as the sum over pairs of ``(x_i y_j - x_j y_i)²`` (Lagrange).

    Never negative, and no difference of large numbers where all companions are on one line.
    """
    cross = x[..., :, None] * y[..., None, :]
    double_sum: Array = np.square(cross - cross.mT).sum(axis=(-2, -1))
    return 0.5 * double_sum
