"""The paper's Appendices A and B against their own literal form and against Monte Carlo."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.model.motion import ConstantAcceleration
from swarmctl.estimation.model.range_difference import range_differences, rd_covariance
from swarmctl.study import paper_filters, paper_information
from swarmctl.units import Array


class Geometry(NamedTuple):
    """Where the companions are, and the noise."""

    baselines: np.ndarray
    rd: np.ndarray
    Cr: np.ndarray
    sigma_p: float

    @property
    def weight(self) -> paper_filters.Uncertainty:
        return paper_filters.uncertainty(self.baselines, self.rd, np.diag(self.Cr), self.sigma_p)


def close_up() -> Geometry:
    """Companions so near that W is a sizeable part of the information."""
    baselines = np.array([[3.0, -2.0], [-1.5, 3.5], [2.0, 4.0], [-3.0, -1.0]])
    rd = range_differences(np.array([8.0, 3.0]), np.zeros(2), baselines)
    return Geometry(baselines, rd, rd_covariance([0.6, 0.8, 1.0, 0.7], 0.5), 0.5)


def random_steps(rng: np.random.Generator, steps: int, n: int) -> np.ndarray:
    return np.asarray(np.eye(n) + 0.3 * rng.standard_normal((steps, n, n)))


# --- Appendix A ------------------------------------------------------------------------


def test_the_recursion_is_the_stacked_form_of_appendix_a() -> None:
    """Eq. (41), with Φ^k built backwards from F_{k-1} as printed below it."""
    rng = np.random.default_rng(1)
    steps, n, N = 6, 6, 2
    F = random_steps(rng, steps, n)
    H = np.zeros((steps + 1, N, n))
    H[..., :3] = rng.standard_normal((steps + 1, N, 3))
    R = rng.uniform(0.5, 2.0, (steps + 1, N))

    J = paper_information.advance(np.zeros((n, n)), np.eye(n), block(H[0], R[0]))
    for k in range(1, steps + 1):
        J = paper_information.advance(J, F[k - 1], block(H[k], R[k]))
        phi = np.eye(n)
        for step in range(k):
            phi = np.concatenate([phi @ np.linalg.inv(F[step]), np.eye(n)])
        stacked = np.concatenate([h @ phi[j * n : (j + 1) * n] for j, h in enumerate(H[: k + 1])])
        expected = stacked.T @ np.diag(1.0 / R[: k + 1].ravel()) @ stacked
        np.testing.assert_allclose(J, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
        assert (J == J.T).all()


def block(H: np.ndarray, R: np.ndarray) -> np.ndarray:
    return np.asarray((H.T / R @ H)[:3, :3])


def test_the_leading_block_is_the_plain_sum_but_unknown_derivatives_cost_information() -> None:
    """So Eqs. (13) and (44) are conditional, and no bound on the position."""
    rng = np.random.default_rng(2)
    F, _ = ConstantAcceleration((0.0, 0.0, 0.0)).step(0.5)
    roots = rng.standard_normal((12, 3, 3))
    J: Array = np.zeros((9, 9))
    for root in roots:
        J = paper_information.advance(J, F, root @ root.T)
    total = (roots @ roots.mT).sum(0)
    np.testing.assert_allclose(J[:3, :3], total, rtol=1e-10)

    position = paper_information.marginal(J, 2)
    np.testing.assert_allclose(position, np.linalg.inv(np.linalg.inv(J)[:2, :2]), rtol=1e-6)
    # Eq. (13) takes D_0 as known, Eq. (44) the derivatives too. One unknown costs in one
    # direction, six in both.
    derivatives_known = paper_information.marginal(total, 2)
    cost = np.linalg.eigvalsh(total[:2, :2] - derivatives_known)
    assert cost == pytest.approx([0.0, cost[1]], abs=1e-10)
    assert cost[1] > 0.1
    assert np.linalg.eigvalsh(derivatives_known - position).min() > 0.1


def test_states_nobody_has_measured_cost_the_others_nothing() -> None:
    told = np.array([[2.0, 0.5], [0.5, 1.0]])
    padded = paper_information.advance(np.zeros((5, 5)), np.eye(5), told)
    np.testing.assert_allclose(paper_information.marginal(padded, 2), told)
    np.testing.assert_allclose(paper_information.marginal(padded, 1), [[2.0 - 0.25]])
    np.testing.assert_array_equal(paper_information.marginal(told, 2), told)


# --- Appendix B ------------------------------------------------------------------------


def test_the_optimal_increment_is_eq_13_bordered_by_the_range() -> None:
    at = close_up()
    (x, y), r, R = at.baselines.T, at.rd, at.weight.R
    I_o = paper_information.optimal_increment(at.baselines, at.rd, at.weight)
    printed = 4.0 * np.array(
        [
            [(x * x / R).sum(), (x * y / R).sum()],
            [(x * y / R).sum(), (y * y / R).sum()],
        ]
    )
    np.testing.assert_allclose(I_o[:2, :2], printed, rtol=1e-12)
    border = 4.0 * np.array([(x * r / R).sum(), (y * r / R).sum(), (r * r / R).sum()])
    np.testing.assert_allclose(I_o[2], border, rtol=1e-12)


def test_the_robust_increment_has_the_optimal_one_s_mean_and_the_stated_covariance() -> None:
    """Though companions share the reference UAV's position and receiver: W is exact.

    Only with R of true values: made of measured ones the same mean is far off.
    """
    at, draws = close_up(), 400_000
    rng = np.random.default_rng(3)
    N, d = at.baselines.shape
    dp = at.sigma_p * rng.standard_normal((draws, N + 1, d))
    baselines = at.baselines + dp[:, 1:] - dp[:, :1]
    rd = at.rd + rng.standard_normal((draws, N)) @ np.linalg.cholesky(at.Cr).T

    I_o = paper_information.optimal_increment(at.baselines, at.rd, at.weight)
    spread = paper_information.increment_covariance(
        at.baselines, at.rd, at.weight, at.Cr, at.sigma_p
    ).reshape(9, 9)
    error = (paper_information.robust_increment(baselines, rd, at.weight) - I_o).reshape(draws, 9)
    standard = np.sqrt(np.diag(spread) / draws)
    W = np.diag((at.weight.W / at.weight.R[:, None]).sum(0)).ravel()
    assert (W[::4] > 20.0 * standard[::4]).all()
    # Five standard errors, of the mean and of every product.
    assert (np.abs(error.mean(0)) < 5.0 * standard).all()
    for entry in range(9):
        products = error[:, entry, None] * error
        bound = 5.0 * products.std(0) / np.sqrt(draws)
        assert (np.abs(products.mean(0) - spread[entry]) < bound).all()

    own = paper_filters.uncertainty(baselines, rd, np.diag(at.Cr), at.sigma_p)
    measured = paper_information.robust_increment(baselines, rd, own).mean(0) - I_o
    assert (np.abs(np.diag(measured)) > 20.0 * standard[::4]).any()


def test_a_batch_is_a_loop() -> None:
    rng = np.random.default_rng(4)
    baselines, rd = rng.normal(0.0, 50.0, (2, 3, 4, 3)), rng.normal(0.0, 50.0, (2, 3, 4))
    Cr = rd_covariance([1.0, 2.0, 1.5, 1.0], 0.3)
    weight = paper_filters.uncertainty(baselines, rd, np.diag(Cr), 0.5)
    F = random_steps(rng, 1, 12)[0]
    robust = paper_information.robust_increment(baselines, rd, weight)
    spread = paper_information.increment_covariance(baselines, rd, weight, Cr, 0.5)
    J = paper_information.advance(np.eye(12), F, robust)
    position = paper_information.marginal(J, 3)
    assert position.shape == (2, 3, 3, 3)
    for i in np.ndindex(2, 3):
        one = paper_filters.uncertainty(baselines[i], rd[i], np.diag(Cr), 0.5)
        np.testing.assert_allclose(
            robust[i], paper_information.robust_increment(baselines[i], rd[i], one), rtol=1e-12
        )
        np.testing.assert_allclose(
            spread[i],
            paper_information.increment_covariance(baselines[i], rd[i], one, Cr, 0.5),
            rtol=1e-10,
            atol=1e-12 * spread[i].max(),
        )
        alone = paper_information.advance(np.eye(12), F, robust[i])
        np.testing.assert_allclose(J[i], alone, rtol=1e-12)
        np.testing.assert_allclose(position[i], paper_information.marginal(alone, 3), rtol=1e-9)


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(EstimationError, match="information must have shape"):
        paper_information.advance(np.zeros((3, 2)), np.eye(2), np.eye(2))
    with pytest.raises(EstimationError, match="transition must have shape"):
        paper_information.advance(np.eye(3), np.eye(2), np.eye(2))
    with pytest.raises(EstimationError, match="transition must not be singular"):
        paper_information.advance(np.eye(3), np.zeros((3, 3)), np.eye(2))
    with pytest.raises(EstimationError, match="increment must be at most"):
        paper_information.advance(np.eye(3), np.eye(3), np.eye(4))
    with pytest.raises(EstimationError, match="increment must have shape"):
        paper_information.advance(np.eye(3), np.eye(3), np.zeros((1, 2)))
    with pytest.raises(EstimationError, match="information must have shape"):
        paper_information.marginal(np.zeros((3, 2)), 1)
    for kept in (0, 4):
        with pytest.raises(EstimationError, match="kept must be within"):
            paper_information.marginal(np.eye(3), kept)
