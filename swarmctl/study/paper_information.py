r"""How much the measurements tell: the information matrices of the paper's Appendices A and B.

State ``x = [s, s', s'']`` with ``s = [p; D_0]`` and the linear rows of Eq. (2), as in
:mod:`~swarmctl.study.paper_filters`.

Appendix A
    For motion without noise, ``x_{k+1} = F_k x_k``, the measurement of epoch j is
    ``y_j = H_j Φ(j, k) x_k + v_j``, with ``Φ(k, k) = I`` and ``Φ(j, k) = Φ(j, k-1) F_{k-1}⁻¹``
    for j < k; with the same F at every step ``Φ(j, k) = F^-(k-j)``. R is block diagonal over
    the epochs, so the stacked form (41) is a sum over them, and its terms j < k all have
    ``F_{k-1}⁻¹`` as their last factor:

        J_k = Σ_{j<=k} Φ(j, k)ᵀ H_jᵀ R_j⁻¹ H_j Φ(j, k)
            = F_{k-1}⁻ᵀ J_{k-1} F_{k-1}⁻¹ + H_kᵀ R_k⁻¹ H_k                   (:func:`advance`)

    The first block column of Φ(j, k) is [I; 0; 0] for the F of Eq. (43): the leading block of
    J_k is the plain sum of the increments, however the emitter moves. That is Eq. (44).

Appendix B
    The increment of the "optimal" filter has the true H (:func:`optimal_increment`), that of
    the NCRKF the measured one, less W (:func:`robust_increment`, Eqs. (46), (47)). With the
    same R, made of *true* values, in both,

        H~ᵀ R⁻¹ H~ - W = Hᵀ R⁻¹ H + (Hᵀ R⁻¹ ΔH + ΔHᵀ R⁻¹ H) + (ΔHᵀ R⁻¹ ΔH - W)

    where both brackets have zero mean; white noise then leaves their average over k epochs to
    the law of large numbers. W summed companion by companion is exact here although all
    companions share the reference UAV: a diagonal R asks for no product of two companions.

Errata:
    - (13), (44): conditional. (13) takes D_0 as known, (44) the derivatives as well. Unknown,
      they cost information: the Schur complement (:func:`marginal`).
    - (44) is the leading block of J_k, not the number (42) makes of it by a trace.
    - (51) needs the 1/k of (13): the sums themselves drift apart, as sqrt(k).
    - (45) has the sign of V wrong, and is no density of y. Its second derivative is the
      curvature of a cost, not Fisher's information: the inverse is no error covariance, since
      R is not the covariance of the residual ``v - ΔH x``.
    - (48) is no bound either: the true H tells the true r_j.
"""

from __future__ import annotations

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import require_shape
from swarmctl.study.paper_filters import Uncertainty, rows
from swarmctl.units import Array


def optimal_increment(baselines: Array, rd: Array, weight: Uncertainty) -> Array:
    """What one epoch tells the filter that is given H: ``Hᵀ R⁻¹ H``, inside Eq. (44).

    Args:
        baselines: True m_j, (..., N, d), m.
        rd: True range differences, (..., N), m.
        weight: R, from :func:`~swarmctl.study.paper_filters.uncertainty`; W and V do not enter.

    Returns:
        On [p; D_0], (..., d + 1, d + 1), 1/m².
    """
    H = rows(baselines, rd)
    information: Array = (H / weight.R[..., None]).mT @ H
    return information


def robust_increment(baselines: Array, rd: Array, weight: Uncertainty) -> Array:
    """What one epoch tells the NCRKF: ``H~ᵀ R⁻¹ H~ - W``, inside Eq. (46).

    Args:
        baselines: Measured m_j, (..., N, d), m.
        rd: Measured range differences, (..., N), m.
        weight: R and W, from :func:`~swarmctl.study.paper_filters.uncertainty` of the true
            values, the premise of Appendix B, or of the measured ones, all a filter has.

    Returns:
        On [p; D_0], (..., d + 1, d + 1), 1/m²; not always positive definite.
    """
    information = optimal_increment(baselines, rd, weight)
    diagonal = np.arange(information.shape[-1])
    information[..., diagonal, diagonal] -= (weight.W / weight.R[..., None]).sum(-2)
    return information


def increment_covariance(
    baselines: Array, rd: Array, weight: Uncertainty, rd_covariance: Array, sigma_p: float
) -> Array:
    """Covariance of the entries of one epoch's :func:`robust_increment` about its mean.

    For Gaussian noise and a weight of true values, exact. With ``S_a,ij = 4 sigma_p²
    (1 + δ_ij)`` the covariance of column a of ΔH (``4 Cr_ij`` for the last), which all
    companions share through the reference UAV, and ``G = R⁻¹ H``, the bracket linear in ΔH has

        cov(ab, cd) = K_b,ac δ_bd + (a <-> b) + (c <-> d) + (both),    K_b = Gᵀ S_b G

    and the quadratic one, uncorrelated with it, by Isserlis' theorem
    ``q_ab (δ_ac δ_bd + δ_ad δ_bc)`` with ``q_ab = Σ_ij S_a,ij S_b,ij / R_i R_j``.

    Args:
        baselines: True m_j, (..., N, d), m.
        rd: True range differences, (..., N), m.
        weight: R and W, made of the true values.
        rd_covariance: Covariance Cr of the receivers' RD noise, (N, N), m².
        sigma_p: 1-sigma of every UAV's position per axis, m.

    Returns:
        (..., d + 1, d + 1, d + 1, d + 1), 1/m⁴.
    """
    n, d = baselines.shape[-2:]
    of_baselines = 4.0 * sigma_p**2 * (np.eye(n) + 1.0)
    S = np.concatenate([np.broadcast_to(of_baselines, (d, n, n)), 4.0 * rd_covariance[None]])
    G = rows(baselines, rd) / weight.R[..., None]
    same = np.eye(d + 1)
    K = np.einsum("...ia,bij,...jc->...bac", G, S, G)
    linear = np.einsum("...bac,bd->...abcd", K, same)
    linear = linear + linear.swapaxes(-4, -3)
    q = np.einsum("aij,bij,...i,...j->...ab", S, S, 1.0 / weight.R, 1.0 / weight.R)
    quadratic = np.einsum("...ab,ac,bd->...abcd", q, same, same)
    covariance: Array = linear + linear.swapaxes(-2, -1) + quadratic + quadratic.swapaxes(-2, -1)
    return covariance


def advance(information: Array, transition: Array, increment: Array) -> Array:
    """One step of the recursion of Appendix A: ``J_k`` of ``J_{k-1}``.

    Args:
        information: J of the state before the step, (..., n, n); zero before the first epoch.
        transition: F of the step, (..., n, n).
        increment: What the epoch at its end tells on the first s <= n states, (..., s, s).

    Returns:
        J of the state after the step, (..., n, n), symmetric.

    Raises:
        EstimationError: A shape is wrong or F is singular.
    """
    require_shape("information", information, None, None)
    n = information.shape[-1]
    require_shape("information", information, n, n)
    require_shape("transition", transition, n, n)
    require_shape("increment", increment, None, None)
    s = increment.shape[-1]
    if s > n:
        raise EstimationError(f"increment must be at most ({n}, {n}), not {increment.shape}.")
    require_shape("increment", increment, s, s)
    try:
        back: Array = np.linalg.inv(transition)
    except np.linalg.LinAlgError:
        raise EstimationError("transition must not be singular.") from None
    told = np.zeros((*increment.shape[:-2], n, n))
    told[..., :s, :s] = increment
    J = back.mT @ information @ back + told
    return 0.5 * (J + J.mT)


def marginal(information: Array, kept: int) -> Array:
    """Information on the first states with all the others unknown: the Schur complement.

    ``I_aa - I_ab I_bb⁺ I_ba``. With ``kept = d`` the position's, D_0 (and what follows it)
    unknown; Eqs. (13) and (44) print the block I_aa, which takes them as known.

    Args:
        information: (..., n, n), symmetric.
        kept: How many states to keep, 1 <= kept <= n.

    Returns:
        (..., kept, kept). Its inverse is the leading block of the inverse, where there is one;
        states nobody has measured cost nothing (hence the pseudo-inverse).

    Raises:
        EstimationError: A shape is wrong, or kept outside [1, n].
    """
    require_shape("information", information, None, None)
    n = information.shape[-1]
    require_shape("information", information, n, n)
    if not 1 <= kept <= n:
        raise EstimationError(f"kept must be within [1, {n}], not {kept}.")
    leading = information[..., :kept, :kept]
    across = information[..., :kept, kept:]
    if kept == n:
        return leading
    others = np.linalg.pinv(information[..., kept:, kept:], hermitian=True)
    complement: Array = leading - across @ others @ across.mT
    return complement
