"""The paper's own filter steps, as printed: NCRKF and OKF in the state with a range of its own.

State ``x = [s, s', s'']`` with ``s = [p; D_0]`` (the paper's x below Eq. (2)), (..., 3(d+1)):
position of the emitter relative to the reference UAV, its range, and their first and second
derivatives. Measurement ``y_j = r_j² - |m_j|² + (bias of the squares)``, linear in s.

Kept as printed, and named here because they are not right:

- R, W and V are sums over the companions, one by one (Eqs. (4)-(6)), though all share the
  reference UAV's position and receiver. A Monte Carlo finds large off-diagonal entries.
- R is the covariance of v alone. The residual ``y - H~ x^`` has that of ``v - ΔH x``, which is
  far larger: the filter believes itself some ten times better than it is.
- R, W and V need the true r_j and m_j; here, as everywhere, they are made of the measured ones.
- D_0 is estimated beside p, and nothing holds D_0 = |p|.

Taken as meant where the print is wrong: the sixth and ninth entries of x are the first and
second derivative of D_0; Table 1's Q is the acceleration block, added per step; P is made
symmetric at every step, without which the recursion diverges within 10 s.

The consistent filter of this system is :mod:`~swarmctl.estimation.kernels.ncrkf`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.units import Array

_SINGULAR = "The update is singular: P must be positive definite and the variances positive."


class Uncertainty(NamedTuple):
    """What is random in the linear measurement model, companion by companion, Eqs. (4)-(6).

    Attributes:
        R: Variance of v_j, (..., N), m⁴.
        W: Diagonal of E[Δh_jᵀ Δh_j], (..., N, d + 1), m².
        V: E[Δh_jᵀ v_j], (..., N, d + 1), m³.
    """

    R: Array
    W: Array
    V: Array


def rows(baselines: Array, rd: Array) -> Array:
    """Rows ``h_j = -2 [m_jᵀ, r_j]`` of H, below Eq. (2).

    Args:
        baselines: m_j = p_j - p_0, (..., N, d), m.
        rd: (..., N), m.

    Returns:
        (..., N, d + 1), m.
    """
    return -2.0 * np.concatenate([baselines, rd[..., None]], axis=-1)


def measurement(baselines: Array, rd: Array, variance: Array, sigma_p: float) -> Array:
    """``y_j = r_j² - |m_j|²`` less the bias of the squares, below Eq. (2).

    Args:
        baselines: Measured, (..., N, d), m.
        rd: Measured, (..., N), m.
        variance: Variance of the RDs, (N,), m².
        sigma_p: 1-sigma of every UAV's position per axis, m.

    Returns:
        (..., N), m².
    """
    bias = 2.0 * baselines.shape[-1] * sigma_p**2 - variance
    y: Array = rd * rd - np.vecdot(baselines, baselines) + bias
    return y


def uncertainty(baselines: Array, rd: Array, variance: Array, sigma_p: float) -> Uncertainty:
    """R_j, W_j and V_j, below Eq. (6).

    Args:
        baselines: (..., N, d), m.
        rd: (..., N), m.
        variance: Variance of the RDs, (N,), m².
        sigma_p: 1-sigma of every UAV's position per axis, m.
    """
    d = baselines.shape[-1]
    of_baseline = 2.0 * sigma_p**2
    R = 2.0 * variance * (2.0 * rd * rd + variance)
    R = R + 2.0 * of_baseline * (2.0 * np.vecdot(baselines, baselines) + d * of_baseline)
    W = np.empty((*variance.shape, d + 1))
    W[..., :d], W[..., d] = 4.0 * of_baseline, 4.0 * variance
    V = np.empty((*rd.shape, d + 1))
    V[..., :d] = 4.0 * of_baseline * baselines
    V[..., d] = -4.0 * variance * rd
    return Uncertainty(R, W, V)


def ncrkf_update(
    x: Array, P: Array, baselines: Array, rd: Array, variance: Array, sigma_p: float
) -> tuple[Array, Array]:
    """The NCRKF's measurement update, Eqs. (8) and (9), with an information of rank d + 1.

    With E the first d + 1 columns of the identity, S = EᵀPE and A = Σ_j (h_jᵀ h_j - W_j)/R_j,
    ``P⁺ = P - P E (I + A S)⁻¹ A EᵀP`` and ``P⁺E = P E (I + A S)⁻¹``: no inverse of a matrix of
    the state's size.

    Args:
        x: Predicted state, (..., 3(d + 1)).
        P: Its covariance, (..., 3(d + 1), 3(d + 1)).
        baselines: Measured m_j, (..., N, d), m.
        rd: Measured range differences, (..., N), m.
        variance: Variance of the RDs, (N,), m².
        sigma_p: 1-sigma of every UAV's position per axis, m.

    Returns:
        Updated x and P. As printed, P is not guarded: it may turn indefinite.

    Raises:
        EstimationError: The update is singular.
    """
    s = baselines.shape[-1] + 1
    R, W, V = uncertainty(baselines, rd, variance, sigma_p)
    H = rows(baselines, rd)
    per_R = 1.0 / R
    HM = H * per_R[..., None]
    W_sum = per_R @ W
    A = HM.mT @ H
    diagonal = np.arange(s)
    A[..., diagonal, diagonal] -= W_sum
    residual = measurement(baselines, rd, variance, sigma_p) - np.matvec(H, x[..., :s])
    score = np.vecmat(residual, HM) + W_sum * x[..., :s] - np.vecmat(per_R, V)
    PE = P[..., :s]
    try:
        gain = PE @ np.linalg.inv(np.eye(s) + A @ PE[..., :s, :])
    except np.linalg.LinAlgError:
        raise EstimationError(_SINGULAR) from None
    P = P - gain @ (A @ P[..., :s, :])
    return x + np.matvec(gain, score), 0.5 * (P + P.mT)


def okf_update(
    x: Array,
    P: Array,
    true_baselines: Array,
    true_rd: Array,
    baselines: Array,
    rd: Array,
    variance: Array,
    sigma_p: float,
) -> tuple[Array, Array]:
    """The paper's "optimal" Kalman filter (OKF): Eq. (2) with the true H.

    No filter can have it, and it is no bound either: the true H tells the true r_j. It comes
    out at a tenth to a half of the Cramér-Rao bound.

    Args:
        x: Predicted state, (..., 3(d + 1)).
        P: Its covariance, (..., 3(d + 1), 3(d + 1)).
        true_baselines: (..., N, d), m.
        true_rd: (..., N), m.
        baselines: Measured m_j, (..., N, d), m.
        rd: Measured, (..., N), m.
        variance: Variance of the RDs, (N,), m².
        sigma_p: 1-sigma of every UAV's position per axis, m.

    Returns:
        Updated x and P.

    Raises:
        EstimationError: The update is singular.
    """
    s = baselines.shape[-1] + 1
    H = rows(true_baselines, true_rd)
    R = uncertainty(true_baselines, true_rd, variance, sigma_p).R
    PH = P[..., :s] @ H.mT
    residual = measurement(baselines, rd, variance, sigma_p) - np.matvec(H, x[..., :s])
    try:
        gain = PH @ np.linalg.inv(H @ PH[..., :s, :] + R[..., None] * np.eye(R.shape[-1]))
    except np.linalg.LinAlgError:
        raise EstimationError(_SINGULAR) from None
    P = P - gain @ PH.mT
    return x + np.matvec(gain, residual), 0.5 * (P + P.mT)
