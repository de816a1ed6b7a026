"""NEES, its interval, and the ellipse."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.bounds.consistency import ellipse, mean_bounds, nees


def test_nees_is_the_squared_distance_in_sigmas() -> None:
    assert nees([6.0, 0.0], [[9.0, 0.0], [0.0, 4.0]]) == pytest.approx(4.0)
    assert nees(np.zeros((5, 4, 2)), np.broadcast_to(np.eye(2), (5, 4, 2, 2))).shape == (5, 4)


def test_the_interval_is_that_of_the_chi_squared_tables() -> None:
    # Chi-squared with 100 degrees of freedom: 74.222 and 129.561 (2.5 % and 97.5 %).
    assert mean_bounds(2, 50) == pytest.approx((74.222 / 50, 129.561 / 50), abs=1e-5)
    # With one: 0.000982 and 5.02389.
    assert mean_bounds(1, 1) == pytest.approx((0.000982, 5.02389), abs=1e-5)


def test_a_consistent_ensemble_lies_in_the_interval_as_often_as_promised() -> None:
    rng = np.random.default_rng(7)
    root = np.array([[3.0, 0.0], [1.0, 0.5]])
    error = rng.standard_normal((2000, 40, 2)) @ root.T
    mean = nees(error, np.broadcast_to(root @ root.T, (2000, 40, 2, 2))).mean(-1)
    low, high = mean_bounds(2, 40)
    inside = float(np.mean((low < mean) & (mean < high)))
    # 2000 draws of a 95 % event: standard deviation 0.5 %.
    assert abs(inside - 0.95) < 4 * 0.005


@pytest.mark.parametrize("angle", [-1.4, -0.3, 0.0, 0.6, 1.5])
def test_the_ellipse_has_the_axes_and_the_direction_it_was_made_with(angle: float) -> None:
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    covariance = np.full((2, 3, 3), 99.0)
    covariance[:, :2, :2] = turn @ np.diag([25.0, 4.0]) @ turn.T
    major, minor, direction = ellipse(covariance)
    np.testing.assert_allclose(major, [5.0, 5.0])
    np.testing.assert_allclose(minor, [2.0, 2.0])
    np.testing.assert_allclose(direction, [angle, angle])


def test_a_degenerate_ellipse_has_no_width() -> None:
    north = 3 * 0.1
    cross = math.sqrt(0.1) * math.sqrt(north)  # rounding makes the smaller eigenvalue negative
    assert ellipse(np.array([[0.1, cross], [cross, north]])).minor == 0.0


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(EstimationError, match="covariance must have shape"):
        nees([1.0, 2.0], np.eye(3))
    with pytest.raises(EstimationError, match="covariance must not be singular"):
        nees([1.0, 2.0], np.zeros((2, 2)))
    with pytest.raises(EstimationError, match="dof and runs"):
        mean_bounds(0, 10)
    with pytest.raises(EstimationError, match="probability"):
        mean_bounds(2, 10, 1.0)
    with pytest.raises(EstimationError, match="covariance must be"):
        ellipse(np.eye(1))
