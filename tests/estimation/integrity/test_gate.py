"""Echoes are set aside, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from swarmctl.estimation.integrity.gate import GATE, consensus, screen
from swarmctl.estimation.model.rows import Rows, star

N = 4
WHITE = 0.125 * (np.eye(N) + 1.0)
S = WHITE + 0.3 * np.outer([1.0, 2.0, -1.0, 0.5], [1.0, 2.0, -1.0, 0.5])


def rows() -> Rows:
    return star(0.0, 7, np.zeros(2), [1, 2, 3, 4], np.zeros((N, 2)), np.zeros(N), WHITE)


@pytest.mark.parametrize("echo", [1, 2, 3, 4])
@pytest.mark.parametrize("bias_m", [-60.0, 15.0, 300.0])
def test_an_echo_is_found_by_its_receiver(echo: int, bias_m: float) -> None:
    rng = np.random.default_rng(echo)
    nu = np.linalg.cholesky(S) @ rng.standard_normal(N)
    nu[echo - 1] += bias_m
    found = screen(nu, S, rows())
    assert found.aside == (echo,)
    assert found.kept.tolist() == [k != echo - 1 for k in range(N)]


def test_an_echo_at_the_reference_leaves_the_differences_between_companions() -> None:
    rng = np.random.default_rng(0)
    nu = np.linalg.cholesky(S) @ rng.standard_normal(N) - 80.0
    found = screen(nu, S, rows())
    assert found.aside == (7,)
    assert not found.kept.any()
    T = np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 1.0, -1.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
    np.testing.assert_allclose(T @ found.covariance @ T.T, T @ WHITE @ T.T, atol=1e-6)
    assert found.covariance[0, 0] > 1e6


def test_two_echoes_are_both_found() -> None:
    found = screen(np.array([90.0, 0.3, 210.0, -0.2]), S, rows())
    assert sorted(found.aside) == [1, 3]


def test_noise_is_set_aside_as_often_as_the_gate_says() -> None:
    """A gate of 2 for speed: at most five tests, each beyond it with probability 0.0455."""
    rng = np.random.default_rng(1)
    draws = 4000
    nu = rng.standard_normal((draws, N)) @ np.linalg.cholesky(S).T
    share = np.mean([bool(screen(one, S, rows(), 2.0).aside) for one in nu])
    # Bonferroni above, one test below; three sigmas of the binomial.
    assert 0.0455 - 0.01 < share < 5 * 0.0455 + 0.02
    assert not any(screen(one, S, rows()).aside for one in nu[:500])
    assert GATE > 3.0


def test_a_pair_s_echoes_are_off_its_straight_line() -> None:
    t = 0.1 * np.arange(6)
    rd = 120.0 - 30.0 * t + [0.2, -0.3, 0.1, 0.4, -0.1, 0.2]
    rd[[1, 4]] += np.array([70.0, 180.0])
    assert consensus(t, rd, 0.5).tolist() == [True, False, True, True, False, True]


def test_of_a_row_by_itself_either_receiver_may_be_wrong() -> None:
    alone = rows().where(np.array([False, True, False, False]))
    assert screen(np.array([9.0]), np.eye(1), alone).aside == (2, 7)


def test_samples_of_a_coarse_clock_share_their_times() -> None:
    t = np.array([0.0, 0.0, 0.1, 0.1, 0.2, 0.2])
    rd = 4.0 + t + [0.01, -0.02, 70.0, 0.02, 0.0, -0.01]
    assert consensus(t, rd, 0.1).tolist() == [True, True, False, True, True, True]
    assert consensus(np.zeros(5), rd[:5], 0.1).all()


def test_noise_larger_than_it_is_said_to_be_is_kept() -> None:
    rng = np.random.default_rng(2)
    t = 0.02 * np.arange(50)
    kept = consensus(t, rng.normal(0.0, 5.0, 50), 0.1)
    assert kept.mean() > 0.5
    assert consensus(t[:3], np.array([0.0, 500.0, -300.0]), 0.1).all()
