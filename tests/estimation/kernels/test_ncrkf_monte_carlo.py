"""The NCRKF is consistent and efficient: ensembles against chi-squared intervals and the PCRB.

Every interval is two-sided at 99.9 %. The squared error over the bound's is a mean of numbers
no wider than chi-squared ones with one degree of freedom (as if all error lay on one axis).
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.estimation.bounds.consistency import mean_bounds, nees
from swarmctl.estimation.model.range_difference import rd_covariance
from swarmctl.units import Array
from tests.estimation.scenarios import Engagement, Record, fly, search_flight

PROBABILITY = 0.999


def assert_consistent(flight: Record, companions: int) -> None:
    runs = flight.error.shape[1]
    position = nees(flight.error[..., :2], flight.covariance[..., :2, :2]).mean(-1)
    state = nees(flight.error, flight.covariance).mean(-1)
    for mean, dof in (
        (position, 2),
        (state, flight.error.shape[-1]),
        (flight.nis.mean(-1), companions),
    ):
        low, high = mean_bounds(dof, runs, PROBABILITY)
        assert ((low < mean) & (mean < high)).all(), (dof, mean, low, high)
    assert flight.guarded == 0


def assert_efficient(flight: Record) -> None:
    low, high = np.sqrt(mean_bounds(1, flight.error.shape[1], PROBABILITY))
    ratio = flight.rmse_to_bound()
    assert ((low < ratio) & (ratio < high)).all(), (ratio, low, high)


def search(
    duration_s: float, record: list[int], *, runs: int = 100, sigma_m: float = 400.0, **how: object
) -> Record:
    """The real system's flight from its prior: height known to 1 m, nearly at rest."""
    rng = np.random.default_rng(2)
    P = np.diag([sigma_m, sigma_m, 1.0, 1.5, 1.5, 0.01]) ** 2
    psd = np.array([0.03**2, 0.03**2, 0.0])
    truth = rng.multivariate_normal(np.zeros(6), P, size=runs)
    return fly(
        search_flight(rng, truth, psd, duration_s=duration_s, **how),  # type: ignore[arg-type]  # passed on
        np.zeros((runs, 6)),
        P,
        psd=psd,
        rd_covariance=rd_covariance(np.full(3, 3.0), 0.5),
        sigma_p=0.5,
        rng=rng,
        record=record,
    )


def test_the_search_flight() -> None:
    """From 2.5 km to the orbit at 430 m."""
    flight = search(240.0, [50, 300, 1000, 1600, 2000, 2390])
    assert_consistent(flight, 3)
    assert_efficient(flight)


def test_flat_baselines_say_next_to_nothing_of_the_height() -> None:
    flight = search(
        100.0, [50, 300, 600, 990], sigma_m=100.0, range_m=1000.0, altitudes_m=(80.0,) * 4
    )
    assert_consistent(flight, 3)
    assert_efficient(flight)


def over_unknown_ground(
    altitudes_m: tuple[float, ...],
    *,
    ground_sigma_m: float,
    range_m: float = 1000.0,
    sigma_r_m: float = 1.0,
    speed_mps: float = 0.0,
    runs: int = 100,
) -> Record:
    """A reference and four companions around it, flying by or standing still."""
    rng = np.random.default_rng(4)
    P = np.diag([200.0, 200.0, ground_sigma_m, 1.0, 1.0, 0.01]) ** 2
    truth = rng.multivariate_normal(np.zeros(6), P, size=runs)
    epochs = 0.1 * np.arange(600)
    drift = epochs[:, None, None] * truth[:, 3:]
    emitter = np.concatenate([truth[:, :3] + drift, np.tile(truth[:, 3:], (600, 1, 1))], axis=-1)
    angles = np.array([0.0, math.pi / 2, math.pi, -math.pi / 2])
    ring = 285.0 * np.stack([np.cos(angles), np.sin(angles), np.zeros(4)], axis=-1)
    center = np.array([-range_m, 0.0, 0.0]) + epochs[:, None] * [0.0, speed_mps, 0.0]
    positions = center[:, None, :] + np.concatenate([np.zeros((1, 3)), ring])
    positions[..., 2] += altitudes_m
    engagement = Engagement(epochs, emitter, positions[:, 0], positions[:, 1:])
    return fly(
        engagement,
        np.zeros((runs, 6)),
        P,
        psd=np.zeros(3),
        rd_covariance=rd_covariance(np.full(4, sigma_r_m), 0.5),
        sigma_p=0.3,
        rng=rng,
        record=[50, 200, 400, 599],
    )


def claimed_height(flight: Record) -> Array:
    """1-sigma of the emitter's height at the end, (runs,), m."""
    return np.asarray(np.sqrt(flight.covariance[-1, :, 2, 2]))


@pytest.mark.parametrize("speed_mps", [0.0, 10.0])
def test_the_height_is_found_where_the_receivers_span_height(speed_mps: float) -> None:
    altitudes = (300.0, 60.0, 500.0, 60.0, 500.0)
    flight = over_unknown_ground(altitudes, ground_sigma_m=40.0, speed_mps=speed_mps)
    assert_consistent(flight, 4)
    assert_efficient(flight)
    assert (claimed_height(flight) < 0.05 * 40.0).all()


def test_the_height_stays_a_constraint_where_they_do_not() -> None:
    """All at one height, far away: the ground's uncertainty stays, and is in the error bars."""
    flight = over_unknown_ground((80.0,) * 5, ground_sigma_m=20.0, range_m=3000.0, sigma_r_m=3.0)
    assert_consistent(flight, 4)
    assert_efficient(flight)
    assert (claimed_height(flight) > 0.6 * 20.0).all()


def test_a_height_known_to_a_quarter_of_the_swarm_s_own_is_well_enough_known() -> None:
    """The module's limit. Beyond it the height, not the position, gets too small error bars."""
    flight = over_unknown_ground((80.0,) * 5, ground_sigma_m=20.0)
    assert_consistent(flight, 4)
    assert_efficient(flight)
    beyond = over_unknown_ground((80.0,) * 5, ground_sigma_m=40.0)
    low, high = mean_bounds(2, 100, PROBABILITY)
    position = nees(beyond.error[..., :2], beyond.covariance[..., :2, :2]).mean(-1)
    assert ((low < position) & (position < high)).all()
    height = (beyond.error[-1, :, 2] / claimed_height(beyond)) ** 2
    assert height.mean() > mean_bounds(1, 100, PROBABILITY)[1]


@pytest.mark.parametrize(("d_m", "range_m"), [(15.0, 2500.0), (285.0, 8000.0)])
def test_where_the_range_is_hard_to_tell(d_m: float, range_m: float) -> None:
    """Forming up, or far away: the wave's curvature is below the noise (module, item 4)."""
    flight = search(60.0, [50, 200, 400, 590], d_m=d_m, range_m=range_m)
    assert_consistent(flight, 3)
    assert_efficient(flight)


def test_no_track_is_lost_from_a_start_that_knows_no_range() -> None:
    """10 ± 5 km assumed, 5 km true; an iterated EKF loses a third to a half of these."""
    rng = np.random.default_rng(3)
    runs = 200
    P = np.diag([5000.0, 1000.0, 1.0, 3.0, 3.0, 0.01]) ** 2
    psd = np.array([0.03**2, 0.03**2, 0.0])
    truth = np.zeros((runs, 6))
    truth[:, 3:5] = rng.normal(0.0, 3.0, (runs, 2))
    start = np.zeros((runs, 6))
    start[:, 0] = 5000.0
    start[:, 1] = rng.normal(0.0, 1000.0, runs)
    flight = fly(
        search_flight(rng, truth, psd, duration_s=30.0, range_m=5000.0),
        start,
        P,
        psd=psd,
        rd_covariance=rd_covariance(np.full(3, 0.5), 0.5),
        sigma_p=0.5,
        rng=rng,
        record=[100, 200, 299],
    )
    assert math.sqrt((flight.error[..., :2] ** 2).sum(-1).max()) < 500.0
    low, high = mean_bounds(2, runs, PROBABILITY)
    mean = nees(flight.error[..., :2], flight.covariance[..., :2, :2]).mean(-1)
    assert ((low < mean) & (mean < high)).all(), mean
    assert_efficient(flight)
