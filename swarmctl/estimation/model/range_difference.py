"""Range differences: what the receivers measure, and how well.

``r_j = D_j - D_0`` with ``D_j = |e - p_j|``: the emitter's range from companion j less its
range from the reference UAV (the paper's Eq. (1), with x_j where it prints x_0). The unit
line of sight from UAV j is ``u_j = (e - p_j) / D_j``.

Every array may have leading batch axes; they broadcast.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from swarmctl.errors import EstimationError
from swarmctl.units import Array


def range_differences(emitter: Array, reference: Array, companions: Array) -> Array:
    """Range differences, Eq. (1).

    Args:
        emitter: Position of the emitter, (..., d), m.
        reference: Position of the reference UAV, (..., d), m.
        companions: Positions of the companions, (..., N, d), m.

    Returns:
        (..., N), m.
    """
    to_emitter = emitter - reference
    to_emitter_j = emitter[..., None, :] - companions
    range_0 = np.sqrt(np.vecdot(to_emitter, to_emitter))
    ranges: Array = np.sqrt(np.vecdot(to_emitter_j, to_emitter_j)) - range_0[..., None]
    return ranges


def jacobian(emitter: Array, reference: Array, companions: Array) -> Array:
    """Derivative of the range differences by the emitter's position: rows ``u_j - u_0``.

    Args:
        emitter: (..., d), m; not at a UAV.
        reference: (..., d), m.
        companions: (..., N, d), m.

    Returns:
        (..., N, d), no unit.
    """
    to_emitter = emitter - reference
    to_emitter_j = emitter[..., None, :] - companions
    u_0: Array = to_emitter / np.sqrt(np.vecdot(to_emitter, to_emitter))[..., None]
    u: Array = to_emitter_j / np.sqrt(np.vecdot(to_emitter_j, to_emitter_j))[..., None]
    return u - u_0[..., None, :]


def rd_covariance(sigma: ArrayLike, rho: ArrayLike) -> Array:
    """Covariance of the receivers' RD noise, which all share the reference receiver's part.

    With the share rho of each variance from the reference, ``Cr_ij = sigma_i sigma_j
    [(1 - rho) delta_ij + rho]``. Where the shares differ the off-diagonal share is
    sqrt(rho_i rho_j): one reference, heard with companion-dependent weight.

    Args:
        sigma: 1-sigma of each RD, (..., N), m, > 0.
        rho: Share of the variance that comes from the reference receiver, 0 <= rho < 1; one
            for all or (..., N).

    Returns:
        (..., N, N), m².

    Raises:
        EstimationError: A sigma is not positive, a rho outside [0, 1), or either not finite.
    """
    sigma = np.asarray(sigma, dtype=np.float64)
    rho = np.asarray(rho, dtype=np.float64)
    # Written so that NaN fails too.
    if sigma.size == 0 or sigma.ndim == 0 or not (sigma.min() > 0.0 and sigma.max() < np.inf):
        raise EstimationError(
            f"sigma must be (..., N), positive and finite; it is {sigma.tolist()}."
        )
    if not (rho.min() >= 0.0 and rho.max() < 1.0):
        raise EstimationError(f"rho must be at least 0 and less than 1; it is {rho.tolist()}.")
    common = np.sqrt(rho) * sigma
    own: Array = (1.0 - rho) * sigma * sigma
    covariance: Array = common[..., :, None] * common[..., None, :]
    return covariance + own[..., None] * np.eye(sigma.shape[-1])


def effective_covariance(rd_covariance: Array, sigma_p: float) -> Array:
    """Covariance of a measured RD about the RD computed at the *measured* UAV positions.

    ``C_ij = Cr_ij + sigma_p² (delta_ij + 1)``. A UAV measured at ``p_j + dp_j`` seems
    ``u_jᵀ dp_j`` nearer to the emitter, so to first order the measured RD exceeds the
    computed one by

        eps_j = dr_j + u_jᵀ dp_j - u_0ᵀ dp_0

    and, line-of-sight vectors having unit length, ``u_jᵀ u_j = u_0ᵀ u_0 = 1``. The estimate
    does not enter, nor does the geometry. The second-order part, (d - 1) sigma_p² / 2D, is
    0.05 mm at sigma_p = 0.5 m and 2.5 km.

    This is the covariance for an emitter estimated in an absolute frame, where the reference
    UAV's position error shifts the computed range D_0 along *its own* line of sight u_0. For
    the position ``p = e - p_0`` relative to the *true* reference, the paper's state, dp_0 acts
    through the measured baselines only, along u_j: the last term is ``u_iᵀ u_j`` instead of 1.
    To turn that estimate into a place on the map dp_0 would have to be added after all.

    Errors white from epoch to epoch are assumed.

    Args:
        rd_covariance: Covariance Cr of the RD noise, (..., N, N), m².
        sigma_p: 1-sigma of every UAV's position per axis, m.

    Returns:
        (..., N, N), m².
    """
    if sigma_p == 0.0:
        return rd_covariance
    variance = sigma_p * sigma_p
    return rd_covariance + variance * (np.eye(rd_covariance.shape[-1]) + 1.0)


def effective_relative_covariance(
    rd_covariance: Array, sigma_p: float, emitter: Array, baselines: Array
) -> Array:
    """As :func:`effective_covariance`, about the RD computed at the *measured* baselines.

    ``C_ij = Cr_ij + sigma_p² (delta_ij + u_iᵀ u_j)``, for the emitter's position relative to
    the *true* reference UAV: to first order ``eps_j = dr_j + u_jᵀ (dp_j - dp_0)``.

    Args:
        rd_covariance: Covariance Cr of the RD noise, (..., N, N), m².
        sigma_p: 1-sigma of every UAV's position per axis, m.
        emitter: p, relative to the reference UAV, (..., d), m; not at a companion.
        baselines: Measured m_j, (..., N, d), m.

    Returns:
        (..., N, N), m².
    """
    sight = emitter[..., None, :] - baselines
    u = sight / np.sqrt(np.vecdot(sight, sight))[..., None]
    variance = sigma_p * sigma_p
    covariance: Array = rd_covariance + variance * (np.eye(rd_covariance.shape[-1]) + u @ u.mT)
    return covariance
