"""The epoch loop: what it does whatever filter runs in it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.errors import EstimationError, UsageError
from swarmctl.estimation.estimate import Counts
from swarmctl.estimation.filters import FILTERS, Filters
from swarmctl.estimation.integrity.health import Verdict
from swarmctl.estimation.model import motion
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.range_difference import range_differences
from swarmctl.estimation.model.rows import Rows, star
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.estimation.track.track import Track
from swarmctl.units import Array

PSD = (4e-4, 4e-4, 0.0)
EMITTER, DRIFT = np.zeros(3), np.array([0.8, -0.3, 0.0])
PRIOR = Prior(
    np.array([10.0, -12.0, 0.0, 0.5, -0.5, 0.0]), np.diag([20, 20, 1, 1.5, 1.5, 0.01]) ** 2
)
WHITE = 9.0 * 0.5 * (np.eye(3) + 1.0)
START = np.array([[-1500, 0, 60], [-1500, 285, 75], [-1500, -285, 90], [-1785, 0, 105]], float)

FRESH = Verdict("initialising", None, nis=1.0, correlation=0.0, rejected=0.0)
"""What is said of a track that has not seen any rows."""

every_filter = pytest.mark.parametrize("name", list(FILTERS))


def track_by(name: str, process_noise: tuple[float, ...] = PSD) -> Track:
    return FILTERS.track(name, PRIOR, Behaviour(process_noise))


def places(t: float) -> Array:
    """Positions at a time, the reference's first, (4, 3)."""
    at: Array = START + t * np.array([8.0, 3.0, 0.0])
    return at


def rows(t: float, echo_m: float = 0.0) -> Rows:
    """The rows of one epoch, the same whenever asked for; the last arrival may have an echo."""
    rng = np.random.default_rng(round(100 * t))
    at = places(t)
    rd = range_differences(EMITTER + t * DRIFT, at[0], at[1:])
    rd = rd + np.linalg.cholesky(WHITE) @ rng.standard_normal(3) + np.array([0.0, 0.0, echo_m])
    return star(t, 1, at[0], [2, 3, 4], at[1:], rd, WHITE)


def fed(track: Track, epochs: range) -> Track:
    for k in epochs:
        track.update(rows(0.1 * k))
    return track


@every_filter
def test_it_tracks(name: str) -> None:
    track = track_by(name)
    assert not track.is_begun
    assert track.verdict == FRESH
    fed(track, range(50))
    assert track.is_begun
    assert track.is_resolved
    assert track.counts == Counts(used=150)
    assert track.verdict.status == "tracking"
    latest = track.latest()
    assert (latest.epoch_s, latest.rd_count) == (track.epoch_s, 3)
    assert latest.nis == pytest.approx(float(track.innovation @ track.innovation))
    error = latest.x[:2] - (EMITTER + track.epoch_s * DRIFT)[:2]
    assert error @ np.linalg.solve(latest.P[:2, :2], error) < 13.8  # chi-squared, 1 of 1000


@every_filter
def test_repeats_are_left_out_named_and_coasted_over(name: str) -> None:
    track = fed(track_by(name), range(60))
    used, held = track.counts.used, rows(5.9)
    for k in range(60, 110):
        at = places(0.1 * k)
        track.update(held._replace(epoch_s=0.1 * k, first_at=at[[0, 0, 0]], second_at=at[1:]))
    assert (track.verdict.status, track.verdict.cause) == ("degraded", "repeated")
    assert track.verdict.rejected == 0.0
    assert track.counts.repeated > 45 * 3
    assert sum(track.counts) == 110 * 3
    assert track.counts.used - used < 5 * 3
    assert track.epoch_s == pytest.approx(10.9)
    assert track.innovation.size == 0


@every_filter
def test_an_echo_is_set_aside_and_the_rest_used(name: str) -> None:
    with_echo, without = (fed(track_by(name), range(21)) for _ in range(2))
    for k in range(21, 40):
        with_echo.update(rows(0.1 * k, echo_m=150.0))
        without.update(rows(0.1 * k).where(np.array([True, True, False])))
    assert (with_echo.counts.aside, without.counts.aside) == (19, 0)
    assert with_echo.counts.used == without.counts.used
    x, y = with_echo.estimates()[0], without.estimates()[0]
    assert (np.abs(x.x - y.x) < 0.01 * np.sqrt(np.diagonal(y.P))).all()


@every_filter
def test_late_rows_are_used_where_they_belong(name: str) -> None:
    late, on_time = (track_by(name, (0.0, 0.0, 0.0)) for _ in range(2))
    fed(on_time, range(30))
    for k in (*range(25), *range(26, 30), 25):
        late.update(rows(0.1 * k))
    assert late.epoch_s == on_time.epoch_s
    x, y = late.estimates()[0], on_time.estimates()[0]
    assert (np.abs(x.x - y.x) < 0.2 * np.sqrt(np.diagonal(y.P))).all()
    np.testing.assert_allclose(np.diagonal(x.P), np.diagonal(y.P), rtol=0.05)


@every_filter
def test_rows_without_a_finite_result_are_refused(name: str) -> None:
    track = fed(track_by(name), range(30))
    one = rows(3.0)
    twice = Rows(
        3.0,
        [1, 1],
        [2, 2],
        one.first_at[[0, 0]],
        one.second_at[[0, 0]],
        one.rd[[0, 0]],
        np.zeros((2, 2)),
    )
    with pytest.raises(EstimationError, match="no finite result"):
        track.update(twice)
    with pytest.raises(EstimationError):
        track.update(one._replace(epoch_s=3.1, covariance=np.full((3, 3), math.nan)))


@every_filter
def test_before_the_first_rows_it_is_the_prior_that_is_believed(name: str) -> None:
    track = track_by(name)
    believed = track.believed_at(100.0)
    np.testing.assert_array_equal(believed.x, PRIOR.mean)
    np.testing.assert_array_equal(believed.P, PRIOR.covariance)
    with pytest.raises(EstimationError, match="no estimate yet"):
        track.mixture_to(1.0)
    with pytest.raises(EstimationError, match="must be finite"):
        track.believed_at(math.nan)


@every_filter
def test_it_restarts_from_its_own_prior_grown_old_and_keeps_the_counts(name: str) -> None:
    track = fed(track_by(name), range(30))
    counts, until_s = track.counts, track.epoch_s
    track.restart()
    assert track.counts == counts
    assert track.estimates() == []
    assert track.verdict == FRESH
    assert track.innovation.size == 0
    aged = motion.predict(*PRIOR, until_s, np.array(PSD))
    np.testing.assert_allclose(track.believed_at(until_s).P, aged[1])


@pytest.mark.parametrize(
    ("mean", "covariance", "message"),
    [
        (np.zeros(4), PRIOR.covariance, "prior.mean must have shape"),
        (np.full(6, math.nan), PRIOR.covariance, "prior.mean must be finite"),
        (PRIOR.mean, np.zeros((6, 6)), "prior.covariance must be positive definite"),
        (np.zeros((2, 6)), PRIOR.covariance, "no leading axes"),
    ],
)
def test_a_prior_that_is_none_is_refused(mean: Array, covariance: Array, message: str) -> None:
    with pytest.raises(EstimationError, match=message):
        FILTERS.track("ncrkf", Prior(mean, covariance), Behaviour(PSD))


def test_a_registry_does_not_change_and_names_what_there_is() -> None:
    assert list(FILTERS) == ["tracker", "ncrkf", "ekf"]
    more = FILTERS.adding("mine", FILTERS["ekf"])
    assert isinstance(more, Filters)
    assert (len(more), len(FILTERS)) == (4, 3)
    with pytest.raises(UsageError, match="no filter 'mine'; there are tracker, ncrkf, ekf"):
        FILTERS.track("mine", PRIOR, Behaviour(PSD))
