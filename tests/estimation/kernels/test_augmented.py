"""Emitter and receivers in one state: the update and its bound."""

from __future__ import annotations

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.bounds.augmented_pcrb import AugmentedBound
from swarmctl.estimation.bounds.pcrb import pcrb
from swarmctl.estimation.kernels.augmented import innovate, linearise, update
from swarmctl.estimation.model.motion import ConstantVelocity
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.estimation.model.rows import Rows
from swarmctl.study import ekf_update as ekf
from tests.estimation.receivers import PERIOD_S, REAL, WHITE, flight

ALL = ReceiverErrors(9.0, 0.3, 1.5, 60.0, 0.4, 0.5)


def some_rows(rng: np.random.Generator, d: int) -> Rows:
    """Pairs without a common reference, one pair the other way round of another."""
    at = {r: rng.normal(0.0, 300.0, d) for r in range(4)}
    first, second = [0, 2, 3, 1], [1, 1, 2, 0]
    return Rows(
        0.0,
        first,
        second,
        np.array([at[r] for r in first]),
        np.array([at[r] for r in second]),
        rng.normal(0.0, 100.0, 4),
        np.eye(4),
    )


def test_rows_that_are_kept_keep_what_is_theirs() -> None:
    rows = some_rows(np.random.default_rng(0), 2)._replace(position_m=0.4)
    kept = rows.where(np.array([False, True, False, True]))
    assert (kept.epoch_s, kept.first, kept.second) == (0.0, [2, 1], [1, 0])
    np.testing.assert_array_equal(kept.second_at, rows.second_at[1::2])
    np.testing.assert_array_equal(kept.covariance, np.eye(2))
    assert kept.position_m == 0.4


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("lag_s", [0.0, -2.0])
def test_the_derivative_is_that_of_the_expected_rows(d: int, lag_s: float) -> None:
    rng = np.random.default_rng(d)
    rows, layout = some_rows(rng, d), ALL.layout(d)
    places = {r: 2 * d + k * layout.size for k, r in enumerate([3, 0, 1, 2])}
    x = rng.normal(0.0, 5.0, 2 * d + 4 * layout.size)
    x[0] += 1500.0
    expected, H = linearise(x, rows, places, layout, lag_s)
    step = 1e-3
    for k in range(x.size):
        moved = x.copy()
        moved[k] += step
        slope = (linearise(moved, rows, places, layout, lag_s)[0] - expected) / step
        np.testing.assert_allclose(H[:, k], slope, atol=1e-5)
    assert expected[3] == pytest.approx(-expected[0])


def test_without_errors_it_is_the_iterated_ekf() -> None:
    rng = np.random.default_rng(1)
    one = flight(rng, ReceiverErrors(), 0.1).rows[0]
    x, P = np.array([40.0, -30.0, 0.0, 0.0]), np.diag([50.0**2, 50.0**2, 9.0, 9.0])
    found = update(x, P, one, {}, ReceiverErrors().layout(2), iterations=1)
    wanted = ekf.update(x, P, one.first_at[0], one.second_at, one.rd, WHITE)
    np.testing.assert_allclose(found.x, wanted[0], rtol=1e-10)
    np.testing.assert_allclose(found.P, wanted[1], rtol=1e-8, atol=1e-9)


def test_a_batch_is_a_loop() -> None:
    rng = np.random.default_rng(2)
    rows, layout = some_rows(rng, 2), ALL.layout(2)
    places = {r: 4 + r * layout.size for r in range(4)}
    n = 4 + 4 * layout.size
    x = rng.normal(0.0, 1.0, (3, 2, n))
    x[..., 0] += 2000.0
    P = np.broadcast_to(np.diag(np.full(n, 4.0)), (3, 2, n, n))
    first = innovate(x, P, rows, places, layout)
    both = update(x, P, rows, places, layout, first=first, iterations=2)
    for k in np.ndindex(3, 2):
        alone = update(x[k], P[k], rows, places, layout, iterations=2)
        np.testing.assert_allclose(both.x[k], alone.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(both.log_likelihood[k], alone.log_likelihood, rtol=1e-9)


def test_numbers_that_are_none_are_refused() -> None:
    one = flight(np.random.default_rng(0), ReceiverErrors(), 0.1).rows[0]
    wrong = one._replace(rd=np.array([1.0, np.nan, 1.0]))
    with pytest.raises(EstimationError, match="no finite result"):
        update(np.zeros(4), np.eye(4), wrong, {}, ReceiverErrors().layout(2))
    wrong = one._replace(covariance=-1e6 * np.eye(3))
    with pytest.raises(EstimationError, match="a covariance is not one"):
        update(np.zeros(4), np.eye(4), wrong, {}, ReceiverErrors().layout(2))


def test_the_bound_without_errors_is_that_of_the_emitter_alone() -> None:
    run = flight(np.random.default_rng(0), ReceiverErrors(), 3.0)
    P0, psd = np.diag([900.0, 900.0, 100.0, 100.0]), np.array([0.01, 0.01])
    bound = AugmentedBound(P0, ReceiverErrors(), psd)
    for k, (rows, e) in enumerate(zip(run.true_rows, run.emitter, strict=True)):
        bound.predict(PERIOD_S if k else 0.0)
        bound.update(e[:2], rows)
    wanted = pcrb(
        P0,
        ConstantVelocity((0.01, 0.01)),
        [rows.epoch_s for rows in run.rows],
        run.emitter[:, :2],
        np.array([rows.first_at[0] for rows in run.true_rows]),
        np.array([rows.second_at for rows in run.true_rows]),
        WHITE,
        0.0,
    )
    np.testing.assert_allclose(bound.covariance, wanted[-1], rtol=1e-8)


def test_the_bound_with_clocks_and_navigation_is_the_published_one() -> None:
    """46, 58, 78, 60 m at 1, 4, 8, 12 s: estimation.md, computed by other code."""
    run = flight(np.random.default_rng(0), REAL, 12.0)
    bound = AugmentedBound(np.diag([1111.0, 1111.0, 100.0, 100.0]), REAL, np.zeros(2))
    found = []
    for k, (rows, e) in enumerate(zip(run.true_rows, run.emitter, strict=True)):
        bound.predict(PERIOD_S if k else 0.0)
        bound.update(e[:2], rows)
        found.append(np.sqrt(np.trace(bound.covariance[:2, :2])))
    assert [round(found[k]) for k in (10, 40, 80, 120)] == [46, 58, 78, 60]
