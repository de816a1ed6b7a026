"""The consistent non-conservative robust Kalman filter (NCRKF): one measurement update.

The update is linear in ``s = [p; D_0]``, the position ``p = e - p_0`` relative to the reference and
its length D_0 (the paper's Eq. (2)). Nothing is linearised about the estimate, so a poor start
cannot throw the filter off. ``docs/explanation/estimation.md`` derives it and says where it leaves
the paper. What the code below relies on:

* All is expressed at the *measured* UAV positions. Their error is part of the RDs' covariance C
  (:func:`~swarmctl.estimation.model.range_difference.effective_covariance`), so W and V have one
  entry each, at D_0.
* Rows are divided by ``2 D_j``. Row j's residual at the true s has covariance
  ``R_ij = C_ij + C_ij² / (2 D_i D_j)``, in m², and the weight is M = R⁻¹.
* D_0 is rebuilt from the prior of e at each update, to second order, and dropped afterwards.
* The left factor Hbar carries ``r_bar = r~ - R S⁻¹ nu`` for the measured r~; ``K C``
  replaces C in W and V, with ``K = I - R S⁻¹``.
* With ``A = Hbarᵀ M H~ - W`` and the score ``g = Hbarᵀ M nu + W s - V``, the update is
  ``P⁺ = (P⁻¹ + A)⁻¹``, ``x⁺ = x + P⁺ g``. It is evaluated in coordinates ``s = s^ + L z`` with
  ``L Lᵀ = cov(s)``, where ``G = I + Lᵀ A L`` is (d + 1) x (d + 1) for any N. The state uses A as it
  is; the covariance uses its symmetric part, which may be indefinite: see ``_FLOOR``.

The spread across the line of sight must stay below about a third of the range, and a height that
only D_0 tells of must be known to a quarter of the receivers' height above the emitter.
"""

from __future__ import annotations

from typing import NamedTuple, NoReturn

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import as_covariance, as_finite
from swarmctl.estimation.model.range_difference import effective_covariance
from swarmctl.units import Array, Mask

_FLOOR = 0.5
"""Least eigenvalue of G an update may have: in no direction does it leave more than twice the
prior's variance. In a direction below it state and covariance stay the prior's."""

_NEAREST_SQUARED = 1e-6
"""Added to squared ranges, m²: a UAV at the very estimate is a millimetre away, not zero."""


class Update(NamedTuple):
    """Result of a measurement update.

    Attributes:
        x: Updated state, (..., n).
        P: Its covariance, (..., n, n), symmetric and positive definite.
        nis: Normalised innovation squared, (...): chi-squared with N degrees of freedom if
            the filter is consistent.
        guarded: Whether the guard of P⁺ fired, (...) of bool.
    """

    x: Array
    P: Array
    nis: Array
    guarded: Mask


class RangePrior(NamedTuple):
    """Prior of the range D_0, matched to second order, beside that of the position.

    Attributes:
        mean: E[D_0], (...), m.
        row: Last row of L, (..., d + 1), m: with the root of the position covariance above it
            (and zeros in the last column), ``L Lᵀ`` is the covariance of [p; D_0].
    """

    mean: Array
    row: Array


def match_range(line_of_sight: Array, distance: Array, root: Array) -> RangePrior:
    """Mean and covariance of the range to an uncertain point (item 3 above).

    Args:
        line_of_sight: Mean of p, (..., d), m.
        distance: Its length, (...), m, > 0.
        root: Lower Cholesky factor of the covariance of p, (..., d, d), m.
    """
    u = line_of_sight / distance[..., None]
    along = np.vecmat(u, root)
    across = root - u[..., :, None] * along[..., None, :]
    # Here and below: numpy multiplies stacks of small matrices two to three times as fast if
    # both lie in order in memory, hence the copies of transposes.
    gram = across.mT.copy() @ across  # its square has the trace of P_t squared
    mean: Array = np.sqrt(distance * distance + (across * across).sum((-2, -1)))
    own = np.sqrt(0.5 * (gram * gram).sum((-2, -1))) / mean
    return RangePrior(mean, np.concatenate([along, own[..., None]], axis=-1))


def residual_covariance(C: Array, ranges: Array) -> Array:
    """R_ij = C_ij + C_ij² / (2 D_i D_j), the covariance of eta (item 2 above).

    Args:
        C: Effective RD covariance, (..., N, N), m².
        ranges: D_j by which the rows are divided, (..., N), m.
    """
    products: Array = ranges[..., :, None] * ranges[..., None, :]
    return C + 0.5 * C * C / products


def compensation(M: Array, KC: Array, ranges: Array) -> Array:
    """The matrix B of the bias of the score's D_0 entry, ``E[Hbarᵀ M eta] = -Σ_ij B_ij D_j``.

    With ``D_j = D_0 + r_j`` this is ``-(W_DD D_0 - V_D)``: ``W_DD = Σ_ij B_ij`` and
    ``V_D = -Σ_ij B_ij r_j``; all other entries of W and V are zero.

    Args:
        M: Weight, (..., N, N), 1/m².
        KC: Covariance of the noise of the conditioned RD with that of the RD, (..., N, N), m².
        ranges: D_j by which the rows are divided, (..., N), m.

    Returns:
        ``B_ij = M_ij (K C)_ij / (D_i D_j)``, (..., N, N), 1/m².
    """
    products: Array = ranges[..., :, None] * ranges[..., None, :]
    return M * KC / products


def update(
    x: Array,
    P: Array,
    reference: Array,
    companions: Array,
    rd: Array,
    rd_covariance: Array,
    sigma_p: float,
) -> Update:
    """One measurement update of the consistent NCRKF; see the module's docstring.

    ``x`` and ``P`` carry the batch axes; the others broadcast against them.

    Args:
        x: Predicted state, (..., n): the emitter's position e in d = 2 or 3 axes first, m;
            then its velocity and what else the motion model has.
        P: Its covariance, (..., n, n), positive definite. A known height is a small
            variance, not zero.
        reference: Measured position of the reference UAV, (..., d), m.
        companions: Measured positions of the companions, (..., N, d), N >= 1, m.
        rd: Measured range differences, (..., N), m.
        rd_covariance: Covariance of the receivers' RD noise, (..., N, N), m², as from
            :func:`~swarmctl.estimation.model.range_difference.rd_covariance`.
        sigma_p: 1-sigma of the measured UAV positions per axis, m.

    Raises:
        EstimationError: An argument has the wrong shape or is not finite, P or the RD
            covariance is not positive definite, or sigma_p is negative.
    """
    _require_shapes(x, P, reference, companions, rd, rd_covariance, sigma_p)
    # Bad numbers are looked for only once they have spoilt the result: checking seven arrays
    # beforehand would cost a tenth of the update.
    with np.errstate(all="ignore"):
        try:
            result = _update(x, P, reference, companions, rd, rd_covariance, sigma_p)
        except np.linalg.LinAlgError:
            _explain(x, P, reference, companions, rd, rd_covariance)
        if not np.isfinite(result.x.sum() + result.P.sum()):
            _explain(x, P, reference, companions, rd, rd_covariance)
    return result


def _update(
    x: Array,
    P: Array,
    reference: Array,
    companions: Array,
    rd: Array,
    rd_covariance: Array,
    sigma_p: float,
) -> Update:
    d = reference.shape[-1]
    emitter = x[..., :d]
    line_of_sight = emitter - reference
    from_companions = emitter[..., None, :] - companions
    range_0_squared = np.vecdot(line_of_sight, line_of_sight) + _NEAREST_SQUARED
    ranges_squared = np.vecdot(from_companions, from_companions) + _NEAREST_SQUARED
    range_0: Array = np.sqrt(range_0_squared)
    ranges: Array = np.sqrt(ranges_squared)
    scale = -1.0 / ranges
    predicted_rd = ranges - range_0[..., None]

    root: Array = np.linalg.cholesky(P)
    prior = match_range(line_of_sight, range_0, root[..., :d, :d])
    mean = prior.mean[..., None]
    row = prior.row[..., None, :]

    # H L with the predicted RD in the last column of H. S must not depend on this step's
    # noise either: it shapes the weighting.
    HL = (predicted_rd * scale)[..., None] * row
    baselines = (companions - reference[..., None, :]) * scale[..., None]
    HL[..., :d] += baselines @ root[..., :d, :d]

    C = effective_covariance(rd_covariance, sigma_p)
    R = residual_covariance(C, ranges)
    M: Array = np.linalg.inv(R)
    # y - H~ s^ with the squares multiplied out: the baselines cancel.
    bias = C.diagonal(axis1=-2, axis2=-1)
    nu = rd * (rd + 2.0 * mean) + (range_0_squared[..., None] - ranges_squared - bias)
    nu /= 2.0 * ranges
    RS = R @ np.linalg.inv(R + HL @ HL.mT.copy())
    innovation = np.matvec(RS, nu)
    nis = np.vecdot(nu, np.matvec(M, innovation))

    conditioned_rd = rd - innovation
    B = compensation(M, C - RS @ C, ranges)
    identity = np.eye(d + 1)
    H_measured = HL + ((rd - predicted_rd) * scale)[..., None] * row
    MH = M @ (HL + ((conditioned_rd - predicted_rd) * scale)[..., None] * row)
    W = B.sum((-2, -1))[..., None, None]
    bias_of_score = np.matvec(B, mean + conditioned_rd).sum(-1)[..., None]
    G = MH.mT.copy() @ H_measured - W * (row.mT * row) + identity
    score = np.vecmat(nu, MH) + bias_of_score * prior.row

    symmetric = 0.5 * (G + G.mT)
    try:
        # Every eigenvalue above the floor: the common case, at a third of their price.
        np.linalg.cholesky(symmetric - _FLOOR * identity)
        inverse_root: Array = np.linalg.inv(np.linalg.cholesky(symmetric)).mT.copy()
        guarded: Mask = np.zeros(nis.shape, dtype=np.bool_)
    except np.linalg.LinAlgError:
        eigenvalues, vectors = np.linalg.eigh(symmetric)
        low = eigenvalues < _FLOOR
        guarded = np.logical_or.reduce(low, axis=-1)
        eigenvalues = np.where(low, 1.0, eigenvalues)
        mended = (vectors * eigenvalues[..., None, :]) @ vectors.mT
        G = np.where(guarded[..., None, None], mended, G)
        score = score - np.matvec((vectors * low[..., None, :]) @ vectors.mT, score)
        inverse_root = vectors / np.sqrt(eigenvalues)[..., None, :]

    step = np.linalg.solve(G, score[..., None])[..., :d, 0]
    # P = [root_e, root_rest][...]ᵀ: the measurement shrinks the first d columns only.
    shrunk = root[..., :d] @ inverse_root[..., :d, :]
    # A product with its own transpose is symmetric to the last bit.
    posterior_root = np.concatenate([shrunk, root[..., d:]], axis=-1)
    return Update(
        x + np.matvec(root[..., :d], step), posterior_root @ posterior_root.mT, nis, guarded
    )


def _require_shapes(
    x: Array,
    P: Array,
    reference: Array,
    companions: Array,
    rd: Array,
    rd_covariance: Array,
    sigma_p: float,
) -> None:
    d = reference.shape[-1] if reference.ndim else 0
    n = rd.shape[-1] if rd.ndim else 0
    if d not in {2, 3}:
        raise EstimationError(f"reference must be (..., 2) or (..., 3), not {reference.shape}.")
    if n == 0:
        raise EstimationError(f"rd must be (..., N) with N >= 1, not {rd.shape}.")
    if x.ndim == 0 or x.shape[-1] < d:
        raise EstimationError(f"x must be (..., n), n >= {d} as reference is, not {x.shape}.")
    if P.shape != (*x.shape, x.shape[-1]):
        raise EstimationError(f"P must be {(*x.shape, *x.shape[-1:])} as x is, not {P.shape}.")
    if companions.shape[-2:] != (n, d):
        raise EstimationError(f"companions must be (..., {n}, {d}), not {companions.shape}.")
    if rd_covariance.shape[-2:] != (n, n):
        raise EstimationError(f"rd_covariance must be (..., {n}, {n}), not {rd_covariance.shape}.")
    if not 0.0 <= sigma_p < np.inf:
        raise EstimationError(f"sigma_p must be a finite number >= 0, not {sigma_p!r}.")


def _explain(
    x: Array, P: Array, reference: Array, companions: Array, rd: Array, rd_covariance: Array
) -> NoReturn:
    for name, array in {
        "x": x,
        "reference": reference,
        "companions": companions,
        "rd": rd,
    }.items():
        as_finite(name, array)
    as_covariance("P", P, None, None)
    as_covariance("rd_covariance", rd_covariance, None, None)
    raise EstimationError("The update has no finite result: its numbers exceed float64.")
