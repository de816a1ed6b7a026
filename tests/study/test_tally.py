"""What is kept of the runs: sums that add, and honest intervals made of them."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest
from scipy import stats

from swarmctl.study.tally import (
    NORMAL_95,
    BoundTally,
    Tally,
    mean_of,
    poisson_rate,
    root_ratio,
    share,
)
from swarmctl.units import CHI2_95_2DOF, Array

RISK = 1e-4
"""Probability that correct code misses a statistical bound."""


def claims(rng: np.random.Generator, *shape: int) -> tuple[Array, Array]:
    """Errors (..., 4) and covariances (..., 4, 4) that fit them."""
    root = rng.standard_normal((*shape, 4, 4)) * [[3.0], [2.0], [0.5], [0.5]]
    P = root @ root.mT + 0.1 * np.eye(4)
    return np.matvec(np.linalg.cholesky(P), rng.standard_normal((*shape, 4))), P


def tally_of(error: Array, P: Array, guarded: Array | None = None) -> Tally:
    if guarded is None:
        guarded = np.zeros(len(error), dtype=int)
    return Tally.of(error, np.linalg.diagonal(P), P[..., 0, 1], guarded)


def test_the_statistics_are_those_numpy_computes_from_the_runs() -> None:
    epochs, runs = 5, 40
    error, P = claims(np.random.default_rng(1), epochs, runs)
    error[..., 0] += 1.0
    error *= 1.3
    guarded = np.arange(float(epochs))
    tally = tally_of(error, P, guarded)
    nees = np.array(
        [
            [
                error[k, i, :2] @ np.linalg.inv(P[k, i, :2, :2]) @ error[k, i, :2]
                for i in range(runs)
            ]
            for k in range(epochs)
        ]
    )
    squared = error[..., 0] ** 2 + error[..., 1] ** 2
    expected = {
        "mean_error": error.mean(1),
        "standard_deviation": error.std(1),
        "claimed": np.sqrt(np.linalg.diagonal(P).mean(1)),
        "rmse": np.sqrt(squared.mean(1)),
        "velocity_rmse": np.sqrt((error[..., 2] ** 2 + error[..., 3] ** 2).mean(1)),
        "mean_nees": nees.mean(1),
        "coverage": (nees < stats.chi2.ppf(0.95, 2)).mean(1),
        "lost": ((nees > 30.0) | (squared > 500.0**2)).sum(1),
        "finite": np.full(epochs, runs),
        "proper": np.full(epochs, runs),
        "guarded": guarded,
    }
    for name, values in expected.items():
        np.testing.assert_allclose(getattr(tally, name), values, rtol=1e-9, err_msg=name)
    assert tally.runs == runs

    z = stats.norm.ppf(0.975)
    for interval, sample, root in (
        (tally.nees_interval, nees, False),
        (tally.rmse_interval, squared, True),
    ):
        half = z * sample.std(1, ddof=1) / math.sqrt(runs)
        ends = np.stack([sample.mean(1) - half, sample.mean(1) + half], axis=-1)
        np.testing.assert_allclose(interval, np.sqrt(ends) if root else ends, rtol=1e-6)


def test_where_no_run_has_numbers_there_are_no_statistics() -> None:
    """And no warning: they are NaN."""
    error, P = claims(np.random.default_rng(5), 1, 4)
    tally = tally_of(error * np.nan, P)
    for name in ("mean_error", "standard_deviation", "rmse", "rmse_interval", "mean_nees"):
        assert np.isnan(getattr(tally, name)).all()
    assert tally.lost == 4


def test_two_halves_added_are_the_whole() -> None:
    error, P = claims(np.random.default_rng(2), 3, 50)
    error[1, 4] = np.nan
    P[2, 30] = -P[2, 30]
    whole = tally_of(error, P, np.array([1, 2, 3]))
    parts = tally_of(error[:, :20], P[:, :20], np.array([1, 0, 3]))
    parts += tally_of(error[:, 20:], P[:, 20:], np.array([0, 2, 0]))
    for field in fields(Tally):
        np.testing.assert_allclose(
            getattr(parts, field.name), getattr(whole, field.name), rtol=1e-12, err_msg=field.name
        )


@pytest.mark.parametrize("wrong", [math.nan, math.inf, 1e200])
@pytest.mark.parametrize("where", ["error", "variance"])
def test_a_run_without_numbers_is_counted_and_nothing_of_it_is_added(
    wrong: float, where: str
) -> None:
    """The statistics are those of the other runs; what is a share of all runs has it missing."""
    error, P = claims(np.random.default_rng(3), 2, 10)
    others = tally_of(error[:, 1:], P[:, 1:])
    if where == "error":
        error[:, 0, 3] = wrong
    else:
        P[:, 0, 2, 2] = wrong
    tally = tally_of(error, P)
    assert tally.runs == 10
    np.testing.assert_array_equal(tally.finite, 9)
    np.testing.assert_array_equal(tally.lost, others.lost + 1)
    for name in ("mean_error", "standard_deviation", "claimed", "rmse", "rmse_interval"):
        np.testing.assert_allclose(getattr(tally, name), getattr(others, name), rtol=1e-12)
    for name in ("mean_nees", "nees_interval"):
        np.testing.assert_allclose(getattr(tally, name), getattr(others, name), rtol=1e-12)
    np.testing.assert_allclose(tally.coverage, others.coverage * 9 / 10, rtol=1e-12)


@pytest.mark.parametrize(
    ("east", "north", "cross"),
    [(-1.0, -1.0, 0.5), (1.0, 1.0, 2.0), (1.0, -1.0, 0.0)],
)
def test_an_indefinite_covariance_has_no_nees_and_its_track_is_lost(
    east: float, north: float, cross: float
) -> None:
    """Its error is one all the same."""
    error, P = claims(np.random.default_rng(4), 1, 10)
    others = tally_of(error[:, 1:], P[:, 1:])
    P[0, 0, :2, :2] = [[east, cross], [cross, north]]
    tally = tally_of(error, P)
    assert tally.proper == 9
    assert tally.finite == 10
    np.testing.assert_allclose(tally.mean_nees, others.mean_nees, rtol=1e-12)
    np.testing.assert_allclose(tally.nees_interval, others.nees_interval, rtol=1e-12)
    np.testing.assert_allclose(tally.coverage, others.coverage * 9 / 10, rtol=1e-12)
    assert tally.lost == others.lost + 1
    np.testing.assert_allclose(tally.mean_error[0], error[0].mean(0), rtol=1e-12)


def test_a_track_is_lost_by_its_error_or_by_its_nees() -> None:
    """500 m, or a NEES of 30: a little less of both is no loss."""
    P = np.broadcast_to(np.diag([1e6, 1e6, 1.0, 1.0]), (1, 2, 4, 4))
    far, tight = np.zeros((1, 2, 4)), np.zeros((1, 2, 4))
    far[0, :, 1] = [499.0, 501.0]
    assert tally_of(far, P).lost == 1
    tight[0, :, 0] = np.sqrt([29.9, 30.1])
    assert tally_of(tight, 1e-6 * P).lost == 1


def test_the_95_percent_intervals_cover_in_95_percent_of_repetitions() -> None:
    """As many Monte Carlo studies as epochs, each of 400 runs with an honest covariance.

    The mean of n skew numbers is not quite normal: Edgeworth's term takes at most 2.2 / n of
    the coverage (Hall, "The Bootstrap and Edgeworth Expansion", 1992, section 2.3, for
    chi-squared numbers with one degree of freedom, worse than any sum here).
    """
    repetitions, runs = 1000, 400
    rng = np.random.default_rng(5)
    root = np.linalg.cholesky(np.array([[9.0, 4.0], [4.0, 4.0]]))
    P = np.eye(4)
    P[:2, :2] = root @ root.T
    error = rng.standard_normal((repetitions, runs, 4))
    error[..., :2] = error[..., :2] @ root.T
    tally = tally_of(error, np.broadcast_to(P, (repetitions, runs, 4, 4)))
    low = stats.binom.ppf(RISK / 4, repetitions, 0.95 - 2.2 / runs)
    high = stats.binom.isf(RISK / 4, repetitions, 0.95)
    for interval, true in ((tally.nees_interval, 2.0), (tally.rmse_interval, math.sqrt(13.0))):
        covered = np.count_nonzero((interval[:, 0] < true) & (true < interval[:, 1]))
        assert low <= covered <= high, (low, covered, high)
    draws = repetitions * runs
    inside = float(tally.coverage.sum()) * runs
    assert stats.binom.ppf(RISK / 4, draws, 0.95) <= inside
    assert inside <= stats.binom.isf(RISK / 4, draws, 0.95)


def test_the_quantiles_are_those_of_the_distributions() -> None:
    assert pytest.approx(stats.norm.ppf(0.975), abs=1e-6) == NORMAL_95
    assert pytest.approx(stats.chi2.ppf(0.95, 2), abs=1e-6) == CHI2_95_2DOF


def test_bounds_are_averaged_as_variances() -> None:
    """One of 1 m per axis beside three of 3 m."""
    bound = BoundTally(1, np.full((2, 4), 1.0))
    bound += BoundTally(3, np.full((2, 4), 3 * 9.0))
    assert bound.count == 4
    np.testing.assert_allclose(bound.standard_deviation, math.sqrt(7.0))
    np.testing.assert_allclose(bound.rmse, math.sqrt(14.0))


def test_the_ratio_of_two_rmses_of_the_same_runs_has_the_interval_of_their_difference() -> None:
    """Errors that have most in common make a ratio sharper than either; seen in 400 studies."""
    rng, runs = np.random.default_rng(7), 200
    covered = 0
    for _ in range(400):
        common = rng.standard_normal(runs)
        squares, others = (
            (common + 0.1 * rng.standard_normal(runs)) ** 2 * scale for scale in (1.44, 1.0)
        )
        figure = root_ratio(squares, others)
        covered += figure.low <= 1.2 <= figure.high
        assert figure.high - figure.low < 0.5 * (mean_of(others).high - mean_of(others).low)
    low, high = stats.binom.interval(1.0 - RISK, 400, 0.95)
    assert low - 8 <= covered <= high  # a mean of 200 squares is not quite normal: 2 % of 400


def test_the_interval_of_a_share_is_clopper_s_and_pearson_s() -> None:
    for count, runs in ((0, 10), (3, 10), (10, 10)):
        exact = stats.binomtest(count, runs).proportion_ci(0.95, method="exact")
        assert share(count, runs) == pytest.approx((count / runs, exact.low, exact.high))


def test_the_interval_of_a_rate_is_poisson_s() -> None:
    low, high = stats.chi2.ppf([0.025, 0.975], [6, 8]) / 2.0
    assert poisson_rate(3, 2.0) == pytest.approx((1.5, low / 2.0, high / 2.0))
    assert poisson_rate(0, 2.0) == pytest.approx((0.0, 0.0, stats.chi2.ppf(0.975, 2) / 4.0))
