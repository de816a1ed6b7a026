"""The (iterated) extended Kalman filter against filterpy and against what it searches for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter

from swarmctl.errors import EstimationError
from swarmctl.estimation.model.motion import ConstantAcceleration
from swarmctl.estimation.model.range_difference import (
    effective_covariance,
    jacobian,
    range_differences,
    rd_covariance,
)
from swarmctl.study import ekf_update as ekf
from swarmctl.units import Array
from tests.estimation.scenarios import table_1

C = effective_covariance(rd_covariance([1.0, 2.0, 1.5, 1.0], 0.4), 0.5)


class Case(NamedTuple):
    """The arguments of an update, in its order."""

    x: np.ndarray
    P: np.ndarray
    reference: np.ndarray
    companions: np.ndarray
    rd: np.ndarray
    covariance: np.ndarray


def some_case(seed: int, spread_m: float, *batch: int) -> Case:
    """An emitter near the origin known to ``spread_m`` per axis, a swarm some 1.5 km away."""
    rng = np.random.default_rng(seed)
    root = np.diag([spread_m] * 3 + [5.0] * 3) + 0.2 * np.tril(rng.standard_normal((6, 6)))
    truth = rng.normal(0.0, 50.0, (*batch, 3))
    x = np.zeros((*batch, 6))
    x[..., :3] = truth
    x += rng.standard_normal((*batch, 6)) @ root.T
    reference = rng.normal(0.0, 50.0, (*batch, 3)) + np.array([-1500.0, 0.0, 200.0])
    companions = reference[..., None, :] + rng.normal(0.0, 300.0, (*batch, 4, 3))
    noise = rng.standard_normal((*batch, 4)) @ np.linalg.cholesky(C).T
    rd = range_differences(truth, reference, companions) + noise
    return Case(x, np.broadcast_to(root @ root.T, (*batch, 6, 6)), reference, companions, rd, C)


def of_batch(batch: Case, *trial: int) -> Case:
    x, P, reference, companions, rd, covariance = batch
    return Case(x[trial], P[trial], reference[trial], companions[trial], rd[trial], covariance)


def test_with_one_iteration_it_is_filterpy_s_ekf_along_a_run() -> None:
    """Table 1: relative state, constant acceleration; agreement on the scale of sigma."""
    flight, steps = table_1(), 150
    rng = np.random.default_rng(1)
    R = np.diag([0.25, 0.16, 0.36])
    F, Q = ConstantAcceleration((0.01, 0.01)).step(0.02)
    P: Array = np.diag([100.0, 100.0, 30.0, 30.0, 10.0, 10.0]) ** 2 / 9.0
    x: Array = np.array([5000.0, 0.0, -248.0, -121.0, 0.0, 0.0])
    x = x + np.sqrt(P) @ rng.standard_normal(6)
    judge = ExtendedKalmanFilter(dim_x=6, dim_z=3)
    judge.x, judge.P, judge.F, judge.Q, judge.R = x.copy(), P.copy(), F, Q, R
    origin = np.zeros(2)
    for k in range(steps):
        baselines = flight.companions[k] - flight.reference[k] + rng.normal(0.0, 0.7, (3, 2))
        p = flight.emitter[k, :2] - flight.reference[k]
        rd = range_differences(p, origin, baselines) + np.sqrt(R) @ rng.standard_normal(3)

        def slope(x: np.ndarray, m: np.ndarray = baselines) -> np.ndarray:
            return np.concatenate([jacobian(x[:2], origin, m), np.zeros((3, 4))], axis=-1)

        def computed(x: np.ndarray, m: np.ndarray = baselines) -> np.ndarray:
            return range_differences(x[:2], origin, m)

        x, P = ekf.update(x, P, origin, baselines, rd, R)
        judge.update(rd, slope, computed)
        sigma = np.sqrt(np.diag(judge.P))
        assert np.abs((x - judge.x) / sigma).max() < 1e-9
        assert np.abs((P - judge.P) / np.outer(sigma, sigma)).max() < 1e-9
        np.testing.assert_array_equal(P, P.T)
        x, P = F @ x, F @ P @ F.T + Q
        judge.predict()


def log_posterior(case: Case, x: np.ndarray) -> float:
    off = x - case.x
    residual = case.rd - range_differences(x[:3], case.reference, case.companions)
    of_prior = off @ np.linalg.solve(case.P, off)
    return float(-0.5 * (of_prior + residual @ np.linalg.solve(case.covariance, residual)))


def slope_of_the_log_posterior(case: Case, x: np.ndarray) -> np.ndarray:
    """By central differences, per prior sigma."""
    step = 1e-3 * np.diag(np.sqrt(np.diag(case.P)))
    return np.array(
        [(log_posterior(case, x + h) - log_posterior(case, x - h)) / 2e-3 for h in step]
    )


def test_iterated_it_ends_at_the_most_probable_state() -> None:
    """From priors 150 m wide, where one linearisation mostly ends elsewhere."""
    batch = some_case(2, 150.0, 20)
    apart = []
    for i in range(20):
        case = of_batch(batch, i)
        sigma = np.sqrt(np.diag(case.P))
        once, _ = ekf.update(*case)
        found, P = ekf.update(*case, iterations=20)
        # The posterior's own curvature turns a slope into the step that is left to the summit.
        # It is less than the last step taken, which was below 1e-3 prior sigmas.
        left = P / np.outer(sigma, sigma) @ slope_of_the_log_posterior(case, found)
        assert np.abs(left).max() < 1e-3
        assert log_posterior(case, found) > log_posterior(case, once)
        apart.append(np.abs((once - found) / sigma).max())
    assert np.median(apart) > 50 * 1e-3


@pytest.mark.parametrize("iterations", [1, 2, 3])
def test_each_iteration_is_a_gauss_newton_step(iterations: int) -> None:
    """In information form, from a prior so wide that the second does not settle yet."""
    case = some_case(11, 300.0)
    x = case.x
    for _ in range(iterations):
        J = jacobian(x[:3], case.reference, case.companions)
        H = np.concatenate([J, np.zeros_like(J)], axis=-1)
        residual = case.rd - range_differences(x[:3], case.reference, case.companions)
        slope = np.linalg.solve(case.P, case.x - x) + H.T @ np.linalg.solve(C, residual)
        P = np.linalg.inv(np.linalg.inv(case.P) + H.T @ np.linalg.solve(C, H))
        x = x + P @ slope
    found, P_found = ekf.update(*case, iterations=iterations)
    sigma = np.sqrt(np.diag(P))
    assert np.abs((found - x) / sigma).max() < 1e-9
    assert np.abs((P_found - P) / np.outer(sigma, sigma)).max() < 1e-9


def test_a_trial_s_result_does_not_depend_on_the_others() -> None:
    batch = some_case(12, 200.0, 6, 5)
    three, twenty = ekf.update(*batch, 3)[0], ekf.update(*batch, 20)[0]
    settled = (three == twenty).all(-1)
    assert settled.any()
    assert not settled.all()  # each must stop for itself
    for iterations in (1, 3, 20):
        x, P = ekf.update(*batch, iterations)
        for i in np.ndindex(6, 5):
            x_one, P_one = ekf.update(*of_batch(batch, *i), iterations)
            sigma = np.sqrt(np.diag(P_one))
            assert np.abs((x[i] - x_one) / sigma).max() < 1e-9
            assert np.abs((P[i] - P_one) / np.outer(sigma, sigma)).max() < 1e-9


def test_wrong_arguments_are_named() -> None:
    case = some_case(13, 100.0)
    with pytest.raises(EstimationError, match="iterations must be at least 1"):
        ekf.update(*case, iterations=0)
    nothing = case._replace(P=np.zeros((6, 6)), covariance=np.zeros((4, 4)))
    with pytest.raises(EstimationError, match="singular"):
        ekf.update(*nothing)
