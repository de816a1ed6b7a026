r"""Appendix B by Monte Carlo: does the NCRKF's information become the "optimal" filter's?

The geometry of Table 1 is held still at its start; only the noise is drawn anew each epoch.
``A_k`` is the average over k epochs of the NCRKF's increment ``H~ᵀ R⁻¹ H~ - W``, ``I_o`` the
increment with the true H, the same each epoch. Eq. (51), with the 1/k of (13): A_k -> I_o.

Weight of true values (the premise of Appendix B)
    Epochs are independent and the increment has the mean I_o, so
    ``E|A_k - I_o|² = tr Γ / k`` at *every* k, with Γ the covariance of one epoch's increment:
    the RMS falls as 1/sqrt(k), and its constant is known beforehand.

Weight of measured values (all a filter has)
    R~ holds the same noise as H~, the ratio has a bias, and A_k converges to something else:
    the floor. Each companion has a term of its own, so it is an integral over d + 1 noises,
    which Gauss-Hermite quadrature gives exactly. It is a few c/q² of the information (c the
    noise variance of a row's largest entry q): 1e-5 in Table 1, where it takes 1e5 epochs to
    show.

Two norms. Frobenius' is that of the strong directions. In the weak one, where position along
the line of sight and D_0 trade against each other, the information is thousands of times
smaller and the noise in H~ the same. ``scaled`` looks at ``I_o^-½ A_k I_o^-½ - I``, in which
every direction counts alike: the same slope, a far larger constant.

What (51) does not say
    It is about the expectation of a curvature. V does not enter (it takes the bias from the
    estimate: ``bias_m``), nor the residual's part ``ΔH s``, by far the larger one.
    ``claimed_m`` is the 1-sigma that I_o promises for one epoch, ``attainable_m`` the
    Cramér-Rao bound of the range differences, ``error_m`` the real error of the least squares
    solution of all epochs (the NCRKF of Eqs. (8), (9) with the true weight, F = I, Q = 0 and
    no prior), times sqrt(k). That I_r -> I_o makes the filter promise I_o, not reach it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.polynomial.hermite_e import hermegauss
from numpy.typing import NDArray

from swarmctl.errors import UsageError
from swarmctl.estimation.model.range_difference import (
    effective_relative_covariance,
    jacobian,
    range_differences,
)
from swarmctl.study import paper_filters
from swarmctl.study.engagement import Engagement, fly, measure
from swarmctl.study.paper_information import (
    increment_covariance,
    marginal,
    optimal_increment,
    robust_increment,
)
from swarmctl.units import Array

_PER_DECADE = 6
_DRAWS = 100_000
"""Epochs of all runs together that are drawn at once: a few tens of megabytes."""
_NODES = 9
"""Nodes of the quadrature per axis."""


@dataclass(frozen=True)
class Convergence:
    """Relative difference of A_k and I_o in one norm, against the number of epochs.

    Attributes:
        predicted: With the weight of true values, ``sqrt(tr Γ / k) / |I_o|``, (K,).
        true_weight: Measured, RMS over the runs, (K,).
        measured_weight: The same with R and W made of measured values, (K,).
        floor: Limit of the latter.
        slope: Slope of log true_weight over log k; -1/2 is right.
        measured_slope: Slope of log measured_weight over log k.
    """

    predicted: Array
    true_weight: Array
    measured_weight: Array
    floor: float
    slope: float
    measured_slope: float


@dataclass(frozen=True)
class InformationStudy:
    """What :func:`run_information` finds.

    Attributes:
        runs: Noise sequences.
        epochs: Numbers of epochs k, evenly spaced in log k, (K,).
        frobenius: In Frobenius' norm.
        scaled: In Frobenius' norm of ``I_o^-½ A_k I_o^-½``.
        claimed_m: RMS position error I_o promises after one epoch, D_0 unknown.
        attainable_m: The Cramér-Rao bound of it.
        error_m: Real RMS position error of the NCRKF's least squares after the last epoch,
            times the square root of their number.
        bias_m: Length of the mean of that error over the runs, not multiplied by anything;
            chance alone leaves error_m / sqrt(runs * epochs).
        nees: Mean of its squared error normalised by its own information; d + 1 is right.
    """

    runs: int
    epochs: NDArray[np.int64]
    frobenius: Convergence
    scaled: Convergence
    claimed_m: float
    attainable_m: float
    error_m: float
    bias_m: float
    nees: float


class _Still(NamedTuple):
    """The geometry that stands still, and the weight made of its true values."""

    baselines: Array
    rd: Array
    variance: Array
    sigma_p: float
    weight: paper_filters.Uncertainty


class _Sums(NamedTuple):
    """Sums over the epochs, for each run; changed in place."""

    true_weight: Array
    measured_weight: Array
    score: Array


def run_information(
    *, runs: int, epochs: int, seed: int, formation: Array, engagement: Engagement | None = None
) -> InformationStudy:
    """Averaged information of the NCRKF against that of the "optimal" filter, Eq. (51).

    Args:
        runs: Noise sequences, >= 1.
        epochs: Epochs of each run, >= 2.
        seed: The seed of the noise.
        formation: Angle from the line of sight and distance from the reference UAV of each
            companion, (N, 2), rad and m.
        engagement: The parameters; Table 1 if left out.

    Raises:
        UsageError: runs or epochs is too small, the formation has not the shape (N, 2), or its
            information is singular: fewer than three companions, or all of them on one line.
    """
    if runs < 1 or epochs < 2:
        raise UsageError(f"At least 1 run and 2 epochs are needed, not {runs} and {epochs}.")
    engagement = engagement or Engagement()
    moment = next(fly(engagement, formation, engagement.emitter))
    n, d = moment.companions.shape
    p = moment.emitter[:d] - moment.reference
    baselines = moment.companions - moment.reference
    rd = range_differences(moment.emitter[:d], moment.reference, moment.companions)
    Cr = engagement.rd_covariance(n)
    variance, sigma_p = np.diag(Cr), engagement.sigma_p_m
    weight = paper_filters.uncertainty(baselines, rd, variance, sigma_p)
    still = _Still(baselines, rd, variance, sigma_p, weight)

    optimal = optimal_increment(baselines, rd, weight)
    eigenvalues, vectors = np.linalg.eigh(optimal)
    if eigenvalues[0] <= 1e-12 * eigenvalues[-1]:
        raise UsageError("The formation does not observe position and range: its I_o is singular.")

    rng = np.random.default_rng(seed)
    at = _log_spaced(epochs)
    zero = np.zeros((runs, d + 1, d + 1))
    sums = _Sums(zero, zero.copy(), zero[..., 0].copy())
    true_weight, measured_weight = np.empty((2, len(at), runs, d + 1, d + 1))
    done = 0
    for index, k in enumerate(at):
        while done < k:
            block = min(k - done, max(1, _DRAWS // runs))
            scan = measure(engagement, moment, rng, runs * block)
            measured = scan.companions - scan.reference[..., None, :]
            _add(sums, measured.reshape(runs, block, n, d), scan.rd.reshape(runs, block, n), still)
            done += block
        true_weight[index] = sums.true_weight / k - optimal
        measured_weight[index] = sums.measured_weight / k - optimal

    bias = _mean_with_measured_weight(still) - optimal
    spread = increment_covariance(baselines, rd, weight, Cr, sigma_p)
    frobenius, scaled = (
        _convergence(at, base, optimal, spread, true_weight, measured_weight, bias)
        for base in (np.eye(d + 1), vectors / np.sqrt(eigenvalues))
    )

    solution = np.linalg.solve(sums.true_weight, sums.score[..., None])[..., 0]
    error = solution - np.append(p, np.linalg.norm(p))
    nees = np.vecdot(error, np.matvec(sums.true_weight, error))
    J = jacobian(moment.emitter[:d], moment.reference, moment.companions)
    C = effective_relative_covariance(Cr, sigma_p, p, baselines)
    return InformationStudy(
        runs,
        at,
        frobenius,
        scaled,
        claimed_m=_rms(marginal(optimal, d)),
        attainable_m=_rms(J.T @ np.linalg.solve(C, J)),
        error_m=float(np.sqrt(epochs * np.square(error[:, :d]).sum(-1).mean())),
        bias_m=float(np.linalg.norm(error[:, :d].mean(0))),
        nees=float(nees.mean()),
    )


def write_information(studies: Mapping[str, InformationStudy], seed: int, out: Path) -> None:
    """Write ``information.json``, one entry for each formation, into a folder."""
    document = {"seed": seed, "formations": studies}
    text = msgspec.json.encode(document, enc_hook=lambda array: array.tolist())
    (out / "information.json").write_bytes(msgspec.json.format(text, indent=1) + b"\n")


def _add(sums: _Sums, baselines: Array, rd: Array, still: _Still) -> None:
    """Add the information and the score of measurements (runs, block, N, ...)."""
    variance, sigma_p, weight = still.variance, still.sigma_p, still.weight
    sums.true_weight[:] += robust_increment(baselines, rd, weight).sum(1)
    own = paper_filters.uncertainty(baselines, rd, variance, sigma_p)
    sums.measured_weight[:] += robust_increment(baselines, rd, own).sum(1)
    # H~ᵀ R⁻¹ y - V, by Eq. (9) what the least squares solution has on its right-hand side.
    y = paper_filters.measurement(baselines, rd, variance, sigma_p)
    score = np.vecmat(y / weight.R, paper_filters.rows(baselines, rd))
    sums.score[:] += (score - (own.V / weight.R[:, None]).sum(-2)).sum(1)


def _mean_with_measured_weight(still: _Still) -> Array:
    """Mean of the increment with R and W of measured values, (d + 1, d + 1).

    The increment is a sum over the companions, so the same nodes serve all of them.
    """
    d = still.baselines.shape[-1]
    nodes, weights = hermegauss(_NODES)
    z = np.stack(np.meshgrid(*(nodes,) * (d + 1), indexing="ij"), -1).reshape(-1, 1, d + 1)
    share = np.prod(np.meshgrid(*(weights / weights.sum(),) * (d + 1), indexing="ij"), 0).ravel()
    baselines = still.baselines + np.sqrt(2.0) * still.sigma_p * z[..., :d]
    rd = still.rd + np.sqrt(still.variance) * z[..., d]
    own = paper_filters.uncertainty(baselines, rd, still.variance, still.sigma_p)
    mean: Array = np.tensordot(share, robust_increment(baselines, rd, own), 1)
    return mean


def _convergence(
    at: NDArray[np.int64],
    base: Array,
    optimal: Array,
    spread: Array,
    true_weight: Array,
    measured_weight: Array,
    bias: Array,
) -> Convergence:
    """Differences (K, runs, s, s) with the columns of ``base`` as axes, summed up."""
    size = np.linalg.norm(base.T @ optimal @ base)
    gram = base @ base.T
    total = np.einsum("abcd,ac,bd->", spread, gram, gram)
    true, measured = (
        np.sqrt(np.square(base.T @ difference @ base).sum((-2, -1)).mean(-1)) / size
        for difference in (true_weight, measured_weight)
    )
    return Convergence(
        predicted=np.sqrt(total / at) / size,
        true_weight=true,
        measured_weight=measured,
        floor=float(np.linalg.norm(base.T @ bias @ base) / size),
        slope=_slope(at, true),
        measured_slope=_slope(at, measured),
    )


def _slope(at: NDArray[np.int64], line: Array) -> float:
    return float(np.polyfit(np.log(at), np.log(line), 1)[0])


def _log_spaced(last: int) -> NDArray[np.int64]:
    count = round(_PER_DECADE * np.log10(last)) + 2
    at: NDArray[np.int64] = np.unique(np.geomspace(1, last, count).round().astype(np.int64))
    return at


def _rms(information: Array) -> float:
    return float(np.sqrt(np.trace(np.linalg.inv(information))))
