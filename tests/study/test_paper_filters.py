"""The paper's filter steps as printed, against filterpy, the printed formulas and Monte Carlo."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from swarmctl.errors import EstimationError
from swarmctl.estimation.model.motion import ConstantAcceleration
from swarmctl.estimation.model.range_difference import range_differences
from swarmctl.study import paper_filters
from tests.estimation.scenarios import table_1

P_0 = np.diag([100.0, 100.0, 141.0, 30.0, 30.0, 42.0, 10.0, 10.0, 14.0]) ** 2 / 9.0
MOTION = ConstantAcceleration((0.01, 0.01, 0.02))
VARIANCE = np.array([0.25, 0.16, 0.36])
SIGMA_P = 0.5
STEPS = 150


class Epoch(NamedTuple):
    """What one epoch of Table 1 measures, and what it would without noise."""

    baselines: np.ndarray
    rd: np.ndarray
    true_baselines: np.ndarray
    true_rd: np.ndarray


def measured_epochs(rng: np.random.Generator, *batch: int) -> Iterator[Epoch]:
    flight = table_1()
    for k in range(STEPS):
        e, p_0, p = flight.emitter[k, :2], flight.reference[k], flight.companions[k]
        noise_0 = rng.normal(0.0, SIGMA_P, (*batch, 1, 2))
        baselines = p - p_0 + rng.normal(0.0, SIGMA_P, (*batch, 3, 2)) - noise_0
        rd = range_differences(e, p_0, p)
        noisy = rd + np.sqrt(VARIANCE) * rng.standard_normal((*batch, 3))
        yield Epoch(baselines, noisy, p - p_0, rd)


def start(rng: np.random.Generator, *batch: int) -> tuple[np.ndarray, np.ndarray]:
    """Table 1's prior about p = (5000, 0) m, the relative velocity about (-248, -121) m/s."""
    mean = np.array([5000.0, 0.0, 5000.0, -248.0, -121.0, -248.0, 0.0, 0.0, 3.0])
    x = mean + rng.standard_normal((*batch, 9)) @ np.sqrt(P_0)
    return x, np.broadcast_to(P_0, (*batch, 9, 9))


def forward(x: np.ndarray, P: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    F, Q = MOTION.step(0.02)
    return x @ F.T, F @ P @ F.T + Q


def assert_same(
    x: np.ndarray, P: np.ndarray, judge_x: np.ndarray, judge_P: np.ndarray, tolerance: float
) -> None:
    """Alike to ``tolerance`` on the scale of the judge's sigma."""
    sigma = np.sqrt(np.diag(judge_P))
    assert np.abs((x - judge_x) / sigma).max() < tolerance
    assert np.abs((P - judge_P) / np.outer(sigma, sigma)).max() < tolerance


def kalman_judge(x: np.ndarray) -> KalmanFilter:
    judge = KalmanFilter(dim_x=9, dim_z=3)
    judge.x, judge.P = x.copy(), P_0.copy()
    judge.F, judge.Q = MOTION.step(0.02)
    return judge


def padded(H: np.ndarray) -> np.ndarray:
    """H as the paper has it, with the columns of the derivatives."""
    return np.concatenate([H, np.zeros((*H.shape[:-1], 6))], axis=-1)


def test_the_okf_is_filterpy_s_kalman_filter_with_the_true_matrix() -> None:
    rng = np.random.default_rng(1)
    x, P = start(rng)
    judge = kalman_judge(x)
    for at in measured_epochs(rng):
        x, P = paper_filters.okf_update(
            x, P, at.true_baselines, at.true_rd, at.baselines, at.rd, VARIANCE, SIGMA_P
        )
        R = paper_filters.uncertainty(at.true_baselines, at.true_rd, VARIANCE, SIGMA_P).R
        y = paper_filters.measurement(at.baselines, at.rd, VARIANCE, SIGMA_P)
        judge.update(y, R=np.diag(R), H=padded(paper_filters.rows(at.true_baselines, at.true_rd)))
        assert_same(x, P, judge.x, judge.P, 1e-9)
        x, P = forward(x, P)
        judge.predict()


def test_without_uncertainty_the_ncrkf_is_filterpy_s_kalman_filter(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With W = V = 0, Eqs. (8) and (9) are the information form of a Kalman filter."""
    printed = paper_filters.uncertainty

    def certain(*arguments: object) -> paper_filters.Uncertainty:
        R, W, V = printed(*arguments)  # type: ignore[arg-type]  # handed through
        return paper_filters.Uncertainty(R, 0.0 * W, 0.0 * V)

    monkeypatch.setattr(paper_filters, "uncertainty", certain)
    rng = np.random.default_rng(2)
    x, P = start(rng)
    judge = kalman_judge(x)
    for at in measured_epochs(rng):
        x, P = paper_filters.ncrkf_update(x, P, at.baselines, at.rd, VARIANCE, SIGMA_P)
        R = printed(at.baselines, at.rd, VARIANCE, SIGMA_P).R
        y = paper_filters.measurement(at.baselines, at.rd, VARIANCE, SIGMA_P)
        judge.update(y, R=np.diag(R), H=padded(paper_filters.rows(at.baselines, at.rd)))
        assert_same(x, P, judge.x, judge.P, 1e-9)
        x, P = forward(x, P)
        judge.predict()


def as_printed(x: np.ndarray, P: np.ndarray, at: Epoch) -> tuple[np.ndarray, np.ndarray]:
    """Eqs. (2) to (6), (8) and (9) word by word, with inverses of 9 x 9."""
    s, information, W, V = 2.0 * SIGMA_P**2, np.zeros((9, 9)), np.zeros((9, 9)), np.zeros(9)
    score = np.zeros(9)
    for (mx, my), r, v in zip(at.baselines, at.rd, VARIANCE, strict=True):
        R = 2 * (2 * r**2 + v) * v + 2 * s * (2 * mx**2 + s) + 2 * s * (2 * my**2 + s)
        h = np.array([-2 * mx, -2 * my, -2 * r, 0, 0, 0, 0, 0, 0])
        y = r**2 - mx**2 - my**2 + 2 * s - v
        information += np.outer(h, h) / R
        score += h * (y - h @ x) / R
        W += 4 * np.diag([s, s, v, 0, 0, 0, 0, 0, 0]) / R
        V += 4 * np.array([mx * s, my * s, -r * v, 0, 0, 0, 0, 0, 0]) / R
    updated = np.linalg.inv(np.linalg.inv(P) + information - W)
    return (np.eye(9) + updated @ W) @ x + updated @ score - updated @ V, updated


def test_the_ncrkf_is_equations_8_and_9() -> None:
    """Each step from one prior, so that the rounding of 9 x 9 inverses does not add up."""
    rng = np.random.default_rng(3)
    x, P = start(rng)
    for at in measured_epochs(rng):
        found = paper_filters.ncrkf_update(x, P, at.baselines, at.rd, VARIANCE, SIGMA_P)
        assert_same(*found, *as_printed(x, P, at), 1e-9)
        np.testing.assert_array_equal(found[1], found[1].T)
        x, P = forward(*found)


def test_a_batch_is_a_loop() -> None:
    rng = np.random.default_rng(4)
    x, P = start(rng, 3, 2)
    for at in list(measured_epochs(rng, 3, 2))[:10]:
        true = (at.true_baselines, at.true_rd)
        okf = paper_filters.okf_update(x, P, *true, at.baselines, at.rd, VARIANCE, SIGMA_P)
        ncrkf = paper_filters.ncrkf_update(x, P, at.baselines, at.rd, VARIANCE, SIGMA_P)
        for i in np.ndindex(3, 2):
            m, r = at.baselines[i], at.rd[i]
            one = paper_filters.okf_update(x[i], P[i], *true, m, r, VARIANCE, SIGMA_P)
            assert_same(okf[0][i], okf[1][i], *one, 1e-9)
            one = paper_filters.ncrkf_update(x[i], P[i], m, r, VARIANCE, SIGMA_P)
            assert_same(ncrkf[0][i], ncrkf[1][i], *one, 1e-9)
        x, P = forward(*ncrkf)


def test_what_is_random_has_the_variances_and_covariances_printed() -> None:
    """Per companion, by Monte Carlo of the definitions; and the residual has no mean.

    Close up, so that the squares of the noise show: a third of R_j.
    """
    rng = np.random.default_rng(5)
    draws = 400_000
    p = np.array([5.0, 2.0, -1.0])
    m = np.array([[1.5, -1.0, 0.5], [-1.0, 1.5, 0.5]])
    variance = np.array([1.0, 0.5])
    r = range_differences(p, np.zeros(3), m)
    d_m = rng.normal(0.0, SIGMA_P, (draws, 2, 3)) - rng.normal(0.0, SIGMA_P, (draws, 1, 3))
    d_r = np.sqrt(variance) * rng.standard_normal((draws, 2))
    y = paper_filters.measurement(m + d_m, r + d_r, variance, SIGMA_P)
    s = np.array([*p, np.linalg.norm(p)])

    v = y - paper_filters.rows(m, r) @ s  # Eq. (2) with the true H
    d_h = paper_filters.rows(m + d_m, r + d_r) - paper_filters.rows(m, r)
    residual = y - np.matvec(paper_filters.rows(m + d_m, r + d_r), s)
    np.testing.assert_allclose(residual, v - d_h @ s, atol=1e-9)

    R, W, V = paper_filters.uncertainty(m, r, variance, SIGMA_P)
    assert_mean(v, np.zeros(2))
    assert_mean(residual, np.zeros(2))
    assert_mean(v * v, R)
    for j in range(2):
        assert_mean(d_h[:, j, :, None] * d_h[:, j, None, :], np.diag(W[j]))
    assert_mean(d_h * v[..., None], V)


def assert_mean(draws: np.ndarray, expected: np.ndarray) -> None:
    """Within five standard errors."""
    error = draws.std(0) / np.sqrt(len(draws))
    assert (np.abs(draws.mean(0) - expected) < 5.0 * error).all()


def test_a_singular_update_is_refused() -> None:
    """A prior that is no covariance, such that I + A S has a zero: S = -1/A."""
    x, P = np.zeros(9), np.zeros((9, 9))
    P[2, 2] = -1.5  # A = (4 r² - 4 var) / R = 12 / 18 for the range
    with pytest.raises(EstimationError, match="singular"):
        paper_filters.ncrkf_update(x, P, np.zeros((1, 2)), np.array([2.0]), np.array([1.0]), 0.0)
    known = np.zeros((1, 2)), np.array([0.0])
    with pytest.raises(EstimationError, match="singular"):
        paper_filters.okf_update(x, np.zeros((9, 9)), *known, *known, np.array([0.0]), 0.0)
