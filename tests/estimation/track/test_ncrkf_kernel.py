"""The linear filter as a track: what it takes, what it sets aside, what it says of itself."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.estimate import Counts, Limits
from swarmctl.estimation.filters import FILTERS
from swarmctl.estimation.kernels import ncrkf
from swarmctl.estimation.model import motion
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.range_difference import range_differences
from swarmctl.estimation.model.rows import Rows, star
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.estimation.track.track import Track
from swarmctl.units import Array

PSD = (4e-4, 4e-4, 0.0)
PRIOR = Prior(
    np.array([30.0, -40.0, 0.0, 0.5, -0.5, 0.0]), np.diag([60, 60, 1, 1.5, 1.5, 0.01]) ** 2
)
EMITTER, DRIFT = np.array([0.0, 0.0, 0.0]), np.array([0.8, -0.3, 0.0])
WHITE = 9.0 * 0.5 * (np.eye(3) + 1.0)


def linear_track(prior: Prior, process_noise: tuple[float, ...]) -> Track:
    return FILTERS.track("ncrkf", prior, Behaviour(process_noise))


def places(t: float) -> Array:
    """Reference first, (4, 3)."""
    start = np.array(
        [[-1500, 0, 60], [-1500, 285, 75], [-1500, -285, 90], [-1785, 0, 105]], dtype=float
    )
    return start + t * np.array([8.0, 3.0, 0.0])


def rows(t: float, rng: np.random.Generator, echo_m: float = 0.0) -> Rows:
    """One epoch; the last companion's arrival comes by a detour."""
    at = places(t)
    rd = range_differences(EMITTER + t * DRIFT, at[0], at[1:])
    rd = rd + np.linalg.cholesky(WHITE) @ rng.standard_normal(3) + np.array([0.0, 0.0, echo_m])
    return star(t, 1, at[0], [2, 3, 4], at[1:], rd, WHITE)


def test_without_echoes_it_is_the_filter() -> None:
    rng = np.random.default_rng(1)
    track = linear_track(PRIOR, PSD)
    assert track.estimates() == []
    assert not track.is_resolved
    x, P = PRIOR
    for k in range(50):
        scan = rows(0.1 * k, rng)
        if k:
            x, P = motion.predict(x, P, 0.1, np.array(PSD))
        x, P, *_ = ncrkf.update(x, P, places(0.1 * k)[0], scan.second_at, scan.rd, WHITE, 0.0)
        assert track.update(scan)
    (estimate,) = track.estimates()
    np.testing.assert_allclose(estimate.x, x, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(estimate.P, P, rtol=1e-9, atol=1e-12)
    assert track.counts == Counts(used=150)
    assert track.is_resolved
    assert estimate.probability == 1.0
    ahead = track.mixture_to(7.0)
    np.testing.assert_allclose(ahead.P, motion.predict(x, P, 7.0 - track.epoch_s, np.array(PSD))[1])
    assert track.limits() == Limits(0.0, 0.0, 0.0)
    assert track.relative(2, 1)[0].shape == (0,)


def test_an_echo_is_set_aside_and_costs_the_others_nothing() -> None:
    with_echo, without = linear_track(PRIOR, PSD), linear_track(PRIOR, PSD)
    for k in range(40):
        for track, echo_m in ((with_echo, 120.0), (without, 0.0)):
            rng = np.random.default_rng(k)
            scan = rows(0.1 * k, rng, echo_m if k > 20 else 0.0)
            kept = np.array([True, True, k <= 20])
            track.update(scan if track is with_echo else scan.where(kept))
    assert (with_echo.counts.aside, without.counts.aside) == (19, 0)
    assert with_echo.counts.used == without.counts.used
    np.testing.assert_allclose(with_echo.estimates()[0].x, without.estimates()[0].x)


def test_rows_that_come_late_are_used_where_they_belong() -> None:
    rng = np.random.default_rng(2)
    scans = [rows(0.1 * k, rng) for k in range(30)]
    late, on_time = linear_track(PRIOR, (0.0, 0.0, 0.0)), linear_track(PRIOR, (0.0, 0.0, 0.0))
    for scan in scans:
        on_time.update(scan)
    for scan in (*scans[:12], *scans[13:], scans[12]):
        late.update(scan)
    assert late.epoch_s == on_time.epoch_s
    (a,), (b,) = late.estimates(), on_time.estimates()
    sigma = np.sqrt(np.diagonal(b.P))
    assert (np.abs(a.x - b.x) < 0.05 * sigma).all()
    np.testing.assert_allclose(np.diagonal(a.P), np.diagonal(b.P), rtol=0.01)


def test_health_says_when_the_noise_is_not_what_it_is_said_to_be() -> None:
    rng = np.random.default_rng(3)
    track = linear_track(PRIOR, PSD)
    for k in range(100):
        track.update(rows(0.1 * k, rng))
    assert track.verdict.status == "tracking"
    for k in range(100, 150):
        scan = rows(0.1 * k, rng)
        track.update(scan._replace(covariance=scan.covariance / 6.0))
    assert (track.verdict.status, track.verdict.cause) == ("degraded", "noise")


def test_after_a_restart_nothing_is_left_but_the_counts() -> None:
    rng = np.random.default_rng(4)
    track, fresh = linear_track(PRIOR, PSD), linear_track(PRIOR, PSD)
    for k in range(20):
        track.update(rows(0.1 * k, rng))
    track.restart(PRIOR)
    assert track.estimates() == []
    scan = rows(2.0, rng)
    track.update(scan)
    fresh.update(scan)
    np.testing.assert_array_equal(track.estimates()[0].x, fresh.estimates()[0].x)
    assert (track.counts.used, fresh.counts.used) == (63, 3)


def test_what_it_cannot_take_is_refused() -> None:
    rng = np.random.default_rng(5)
    track = linear_track(PRIOR, PSD)
    with pytest.raises(EstimationError, match="no estimate yet"):
        track.mixture_to(1.0)
    with pytest.raises(EstimationError, match="one reference at a time"):
        track.update(rows(0.0, rng)._replace(first=[1, 1, 2]))
    for mean, covariance, message in (
        (np.zeros(4), PRIOR.covariance, "prior.mean must have shape"),
        (np.full(6, math.nan), PRIOR.covariance, "prior.mean must be finite"),
        (PRIOR.mean, np.zeros((6, 6)), "prior.covariance must be positive definite"),
        (np.zeros((2, 6)), PRIOR.covariance, "no leading axes"),
    ):
        with pytest.raises(EstimationError, match=message):
            linear_track(Prior(mean, covariance), PSD)
    with pytest.raises(EstimationError, match="process_noise must be"):
        linear_track(PRIOR, (0.0, 0.0, -1.0))


def test_a_feed_that_is_held_is_named_and_left_out() -> None:
    rng = np.random.default_rng(6)
    track = linear_track(PRIOR, PSD)
    for k in range(60):
        last = rows(0.1 * k, rng)
        track.update(last)
    used = track.counts.used
    for k in range(60, 110):
        at = places(0.1 * k)
        track.update(last._replace(epoch_s=0.1 * k, first_at=at[[0, 0, 0]], second_at=at[1:]))
    assert (track.verdict.status, track.verdict.cause) == ("degraded", "repeated")
    assert track.counts.used + track.counts.aside - used < 5 * 3
    assert track.counts.repeated > 45 * 3
    assert track.epoch_s == pytest.approx(10.9)
