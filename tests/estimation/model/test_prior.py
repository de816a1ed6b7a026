"""Where a track begins."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.model.prior import Prior, is_wide, sector, starts

SWARM = np.array([[0.0, 0.0], [0.0, 300.0], [0.0, -300.0], [-300.0, 0.0]])


@pytest.mark.parametrize("half_width_deg", [10.0, 30.0, 180.0])
def test_a_sector_has_the_moments_of_its_points(half_width_deg: float) -> None:
    half = math.radians(half_width_deg)
    found = sector(np.array([50.0, -20.0]), 0.7, half, 1000.0, 6000.0, 5.0)
    rng = np.random.default_rng(0)
    draws = 200_000
    angle = 0.7 + rng.uniform(-half, half, draws)
    distance = rng.uniform(1000.0, 6000.0, draws)
    points = np.stack([np.cos(angle), np.sin(angle)], axis=-1) * distance[:, None]
    # Five sigmas of the sample's mean and covariance.
    mean = points.mean(0) + np.array([50.0, -20.0])
    assert np.abs(found.mean[:2] - mean).max() < 5 * 6000.0 / math.sqrt(draws)
    off = np.abs(found.covariance[:2, :2] - np.cov(points.T)).max()
    assert off < 5 * math.sqrt(2.0) * 6000.0**2 / math.sqrt(draws)
    assert found.covariance[2, 2] == 25.0


def test_a_height_makes_three_axes() -> None:
    found = sector(np.zeros(2), 0.0, 1.0, 100.0, 1000.0, 5.0, height=(30.0, 4.0))
    assert found.mean.size == 6
    assert (found.mean[2], found.covariance[2, 2]) == (30.0, 16.0)
    heights = starts(found, np.column_stack([SWARM, np.full(4, 60.0)]))[:, 2]
    np.testing.assert_allclose(heights, 30.0, atol=1e-9)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ((0.0, 0.0, 1.0, 2.0, 1.0), "half_width_rad"),
        ((math.nan, 1.0, 1.0, 2.0, 1.0), "half_width_rad"),
        ((0.0, 1.0, 2.0, 1.0, 1.0), "nearest_m"),
        ((0.0, 1.0, 1.0, 2.0, 0.0), "speed_mps"),
    ],
)
def test_a_sector_that_cannot_be_is_refused(
    wrong: tuple[float, float, float, float, float], named: str
) -> None:
    with pytest.raises(EstimationError, match=named):
        sector(np.zeros(2), *wrong)


def test_the_grid_covers_the_prior_in_ratios_of_the_range() -> None:
    prior = sector(np.zeros(2), 0.0, math.pi, 100.0, 8000.0, 20.0)
    grid = starts(prior, SWARM)
    rng = np.random.default_rng(1)
    for _ in range(200):
        angle, distance = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(500.0, 8000.0)
        point = distance * np.array([math.cos(angle), math.sin(angle)])
        nearest = np.linalg.norm(grid[:, :2] - point, axis=1).min()
        # Half a cell of the grid: 7.5° across, a factor of sqrt(1.5) along; its centre is
        # the swarm's, 75 m from the origin.
        assert nearest < 0.3 * distance + 75.0
    assert len(grid) < 300


def test_a_wide_prior_is_told_from_a_narrow_one() -> None:
    mean = np.array([5000.0, 0.0, 0.0, 0.0])
    assert not is_wide(Prior(mean, np.diag([900.0, 900.0, 1.0, 1.0])), SWARM)
    assert is_wide(Prior(mean, np.diag([4e6, 900.0, 1.0, 1.0])), SWARM)
