"""The posterior Cramér-Rao bound against two other ways to compute it."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from swarmctl.errors import EstimationError
from swarmctl.estimation.bounds.pcrb import CramerRaoBound, pcrb
from swarmctl.estimation.model.motion import ConstantVelocity, transition
from swarmctl.estimation.model.range_difference import effective_covariance, jacobian, rd_covariance

PRIOR = np.diag([400.0, 300.0, 1.0, 1.5, 1.5, 0.01]) ** 2
MOTION = ConstantVelocity((4e-4, 4e-4, 0.0))
STEADY = ConstantVelocity((0.0, 0.0, 0.0))
CR = rd_covariance([3.0, 2.0, 3.0], 0.5)
SIGMA_P = 0.5


def geometry(rng: np.random.Generator, *batch: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    emitter = rng.normal(0.0, 100.0, (*batch, 3))
    reference = emitter + np.array([-1500.0, 0.0, 60.0])
    return emitter, reference, reference[..., None, :] + rng.normal(0.0, 200.0, (*batch, 3, 3))


def observe(bound: CramerRaoBound, where: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    bound.update(*where, CR, SIGMA_P)


def slope(where: tuple[np.ndarray, np.ndarray, np.ndarray]) -> np.ndarray:
    J = jacobian(*where)
    return np.concatenate([J, np.zeros_like(J)], axis=-1)


def test_the_recursion_agrees_with_filterpy_s_covariance() -> None:
    rng = np.random.default_rng(8)
    bound = CramerRaoBound(PRIOR, MOTION)
    judge = KalmanFilter(dim_x=6, dim_z=3)
    judge.P, judge.R = PRIOR.copy(), effective_covariance(CR, SIGMA_P)
    judge.F, judge.Q = MOTION.step(0.1)
    for _ in range(50):
        where = geometry(rng)
        bound.predict(0.1)
        observe(bound, where)
        judge.predict()
        judge.update(np.zeros(3), H=slope(where))
    scale = np.sqrt(np.diag(judge.P))
    difference = (bound.covariance - judge.P) / np.outer(scale, scale)
    assert np.abs(difference).max() < 1e-9


def test_the_recursion_is_fisher_s_information_added_up() -> None:
    rng = np.random.default_rng(9)
    bound = CramerRaoBound(PRIOR, STEADY)
    weight = np.linalg.inv(effective_covariance(CR, SIGMA_P))
    information = np.linalg.inv(PRIOR)
    back = transition(-0.5, 3)
    for _ in range(20):
        bound.predict(0.5)
        information = back.T @ information @ back
        where = geometry(rng)
        observe(bound, where)
        information = information + slope(where).T @ weight @ slope(where)
    expected = np.linalg.inv(information)
    scale = np.sqrt(np.diag(expected))
    assert np.abs((bound.covariance - expected) / np.outer(scale, scale)).max() < 1e-8


def test_an_axis_known_exactly_stays_known_exactly() -> None:
    known = PRIOR.copy()
    known[2, 2] = known[5, 5] = 0.0
    bound = CramerRaoBound(known, MOTION)
    rng = np.random.default_rng(10)
    for _ in range(100):
        bound.predict(0.1)
        observe(bound, geometry(rng))
    assert np.isfinite(bound.covariance).all()
    assert np.abs(bound.covariance[2]).max() == 0.0
    assert np.linalg.eigvalsh(bound.covariance[:2, :2]).min() > 0.0


def test_tight_axes_beside_loose_ones_stay_positive_definite() -> None:
    """A prior of 1000 km beside one of 0.1 mm, receivers good to 1 mm."""
    bound = CramerRaoBound(np.diag([1e6, 1e6, 1e-4, 1e3, 1e3, 1e-6]) ** 2, STEADY)
    rng = np.random.default_rng(11)
    for _ in range(50):
        bound.predict(0.1)
        bound.update(*geometry(rng), 1e-6 * np.eye(3), 0.0)
        np.linalg.cholesky(bound.covariance)


def test_a_batch_is_a_loop_and_a_trajectory_is_its_steps() -> None:
    rng = np.random.default_rng(12)
    epochs = np.array([0.0, 0.1, 0.5, 0.6])
    emitter, reference, companions = geometry(rng, 4, 5)
    batch = pcrb(PRIOR, MOTION, epochs, emitter, reference, companions, CR, SIGMA_P)
    assert batch.shape == (4, 5, 6, 6)
    for trial in range(5):
        bound = CramerRaoBound(PRIOR, MOTION)
        for k, dt in enumerate((0.0, 0.1, 0.4, 0.1)):
            bound.predict(dt)
            observe(bound, (emitter[k, trial], reference[k, trial], companions[k, trial]))
            np.testing.assert_allclose(batch[k, trial], bound.covariance, rtol=1e-7, atol=1e-7)


def test_wrong_arguments_are_named() -> None:
    where = geometry(np.random.default_rng(13))
    bound = CramerRaoBound(PRIOR, MOTION)
    with pytest.raises(EstimationError, match="prior_covariance must have shape"):
        CramerRaoBound(np.eye(4), MOTION)
    with pytest.raises(EstimationError, match="prior_covariance must be positive"):
        CramerRaoBound(np.diag([1.0, -1.0, 1.0, 1.0]), ConstantVelocity((0.0, 0.0)))
    with pytest.raises(EstimationError, match="dt must be"):
        bound.predict(-1.0)
    with pytest.raises(EstimationError, match="companions must have shape"):
        bound.update(where[0], where[1], where[2][:, :2], CR, SIGMA_P)
    with pytest.raises(EstimationError, match="rd_covariance must have shape"):
        bound.update(*where, CR[:2, :2], SIGMA_P)
    with pytest.raises(EstimationError, match="sigma_p must be"):
        bound.update(*where, CR, -1.0)
    emitter, reference, companions = (a[None] for a in where)
    with pytest.raises(EstimationError, match="epochs_s must be"):
        pcrb(PRIOR, MOTION, [0.0, 1.0], emitter, reference, companions, CR, SIGMA_P)
