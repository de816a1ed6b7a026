"""Two motion models side by side."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.track.manoeuvre import BELIEVED, Manoeuvre, moment_match
from swarmctl.units import Array

CAR = Manoeuvre(speed_mps=20.0, every_s=60.0, lasts_s=1.0)


def test_switching_is_a_markov_chain_in_continuous_time() -> None:
    np.testing.assert_allclose(CAR.switching(0.7).sum(1), 1.0)
    np.testing.assert_allclose(CAR.switching(0.2) @ CAR.switching(0.5), CAR.switching(0.7))
    np.testing.assert_allclose(CAR.switching(1e-3)[0, 1], 1e-3 / 60.0, rtol=1e-2)
    np.testing.assert_allclose(CAR.switching(1e-3)[1, 0], 1e-3, rtol=1e-2)
    np.testing.assert_allclose(CAR.switching(1e4)[0], [60.0 / 61.0, 1.0 / 61.0])


def mixture(count: int) -> tuple[Array, Array]:
    """States and covariances of two models, (count, 2, ...)."""
    rng = np.random.default_rng(0)
    roots = rng.standard_normal((count, 2, 6, 6))
    return rng.normal(0.0, 5.0, (count, 2, 6)), roots @ roots.mT


def test_mixing_with_a_manoeuvre_believed_keeps_the_mixture_but_for_the_jump() -> None:
    x, P = mixture(3)
    weight = np.array([[0.009, 0.991], [0.001, 0.999], [1.0, 0.0]])
    mixed, covariance, after = CAR.mix(x, P, weight, 0.5, 2)
    np.testing.assert_allclose(after, weight @ CAR.switching(0.5))
    mean, total = moment_match(mixed, covariance, after)
    wanted_mean, wanted = moment_match(x, P, weight)
    np.testing.assert_allclose(mean, wanted_mean, atol=1e-12)
    entered = weight[:, 0] * CAR.switching(0.5)[0, 1]
    for axis in (2, 3):
        wanted[:, axis, axis] += entered * 400.0
    np.testing.assert_allclose(total, wanted, atol=1e-9)


def test_the_quiet_model_takes_nothing_from_a_manoeuvre_that_is_not_believed() -> None:
    """But its probability, and model 1 is the mixture of what stayed and what jumped."""
    x, P = mixture(3)
    weight = np.array([[0.98, 0.02], [0.5, 0.5], [1.0 - BELIEVED, BELIEVED]])
    mixed, covariance, after = CAR.mix(x, P, weight, 0.5, 2)
    np.testing.assert_allclose(mixed[:, 0], x[:, 0], rtol=1e-12)
    np.testing.assert_allclose(covariance[:, 0], P[:, 0], rtol=1e-12)
    np.testing.assert_allclose(after, weight @ CAR.switching(0.5))
    came, stayed = weight[:, 0] * CAR.switching(0.5)[0, 1], weight[:, 1] * CAR.switching(0.5)[1, 1]
    P[:, 0, [2, 3], [2, 3]] += 400.0
    wanted_mean, wanted = moment_match(
        x, P, np.stack([came, stayed], -1) / (came + stayed)[:, None]
    )
    np.testing.assert_allclose(mixed[:, 1], wanted_mean)
    np.testing.assert_allclose(covariance[:, 1], wanted)


def test_a_car_keeps_its_height() -> None:
    level = Manoeuvre(speed_mps=20.0, is_level=True)
    np.testing.assert_array_equal(level.psd(3), [20.0, 20.0, 0.0])
    np.testing.assert_array_equal(level.psd(2), CAR.psd(2))
    np.testing.assert_array_equal(CAR.psd(3), [20.0, 20.0, 20.0])
    x, P, weight = np.zeros((2, 6)), np.stack([np.eye(6)] * 2), np.array([1.0, 0.0])
    _, covariance, _ = level.mix(x, P, weight, 0.5, 3)
    np.testing.assert_allclose(np.diagonal(covariance[1]), [1, 1, 1, 401, 401, 1])


def test_a_mixture_is_matched_by_its_moments() -> None:
    x, P = np.array([[0.0, 0.0], [4.0, 0.0]]), np.stack([np.eye(2), 3.0 * np.eye(2)])
    mean, covariance = moment_match(x, P, np.array([0.75, 0.25]))
    np.testing.assert_allclose(mean, [1.0, 0.0])
    np.testing.assert_allclose(covariance, [[1.5 + 3.0, 0.0], [0.0, 1.5]])


@pytest.mark.parametrize("wrong", [0.0, -1.0, math.inf, math.nan])
def test_a_manoeuvre_needs_positive_numbers(wrong: float) -> None:
    with pytest.raises(EstimationError, match="every_s"):
        Manoeuvre(20.0, every_s=wrong)
