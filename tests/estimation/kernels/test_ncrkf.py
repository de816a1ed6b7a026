"""One update of the NCRKF: its parts, its symmetries, and what it refuses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmctl.errors import EstimationError
from swarmctl.estimation.kernels import ncrkf
from swarmctl.estimation.model.range_difference import (
    effective_covariance,
    range_differences,
    rd_covariance,
)


class Case(NamedTuple):
    """The arguments of an update, in its order."""

    x: np.ndarray
    P: np.ndarray
    reference: np.ndarray
    companions: np.ndarray
    rd: np.ndarray
    rd_covariance: np.ndarray
    sigma_p: float


def some_case(seed: int, d: int = 3, n: int = 3, *batch: int) -> Case:
    """An emitter near the origin, a swarm 300 m across some kilometre away, RDs with noise."""
    rng = np.random.default_rng(seed)
    spread = np.array([300.0] * d + [2.0] * d)
    root = rng.normal(0.0, 1.0, (*batch, 2 * d, 3 * d)) * spread[:, None] / np.sqrt(3.0 * d)
    P = root @ np.swapaxes(root, -1, -2)
    truth = rng.normal(0.0, 50.0, (*batch, d))
    x = np.zeros((*batch, 2 * d))
    x[..., :d] = truth + rng.normal(0.0, 200.0, (*batch, d))
    reference = rng.normal(0.0, 100.0, (*batch, d))
    reference[..., 0] -= 2000.0
    companions = reference[..., None, :] + rng.normal(0.0, 200.0, (*batch, n, d))
    rd = range_differences(truth, reference, companions) + rng.normal(0.0, 3.0, (*batch, n))
    return Case(x, P, reference, companions, rd, rd_covariance(np.full(n, 3.0), 0.5), 0.5)


def in_the_paper_s_terms(case: Case) -> tuple[np.ndarray, np.ndarray, float]:
    """The same update in full state space and the paper's scale, for one trial.

    State [p, v, D_0], rows -2 [m_jᵀ, 0, r_j], residual covariance 4 D_i D_j C_ij + 2 C_ij²,
    and P⁺ = P - P E (I + A EᵀPE)⁻¹ A EᵀP.
    """
    x, P, reference, companions, rd, Cr, sigma_p = case
    d, n = reference.size, rd.size
    m, p = companions - reference, x[:d] - reference
    D_0, D = np.linalg.norm(p), np.linalg.norm(p - m, axis=1)
    C = Cr + sigma_p**2 * (np.eye(n) + np.ones((n, n)))

    u = p / D_0
    across = np.eye(d) - np.outer(u, u)
    P_t = across @ P[:d, :d] @ across
    mean = np.sqrt(D_0**2 + np.trace(P_t))
    T = np.vstack([np.eye(2 * d), np.concatenate([u, np.zeros(d)])])
    P = T @ P @ T.T
    P[-1, -1] += np.trace(P_t @ P_t) / (2.0 * mean**2)
    s = np.concatenate([p, x[d:], [mean]])

    def rows(last: np.ndarray) -> np.ndarray:
        return -2.0 * np.column_stack([m, np.zeros((n, d)), last])

    residual = rd**2 - (m**2).sum(1) - np.diag(C) - rows(rd) @ s
    R = 4.0 * np.outer(D, D) * C + 2.0 * C**2
    S = R + rows(D - D_0) @ P @ rows(D - D_0).T
    best = rd - (R @ np.linalg.solve(S, residual)) / (2.0 * D)
    KC = C - np.diag(0.5 / D) @ R @ np.linalg.solve(S, np.diag(2.0 * D) @ C)

    M = np.linalg.inv(R)
    W, V = np.zeros((2 * d + 1, 2 * d + 1)), np.zeros(2 * d + 1)
    W[-1, -1] = 4.0 * (M * KC).sum()
    V[-1] = -4.0 * (M * KC @ best).sum()
    A = rows(best).T @ M @ rows(rd) - W
    g = rows(best).T @ M @ residual + W @ s - V
    step = np.linalg.solve(np.eye(2 * d + 1) + P @ A, P @ g)
    picked = [*range(d), 2 * d]
    E = np.eye(2 * d + 1)[:, picked]
    A = (0.5 * (A + A.T))[np.ix_(picked, picked)]
    P = P - P @ E @ np.linalg.solve(np.eye(d + 1) + A @ E.T @ P @ E, A @ E.T @ P)
    nis = float(residual @ np.linalg.solve(S, residual))
    return x + step[: 2 * d], P[: 2 * d, : 2 * d], nis


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("n", [1, 2, 3, 7, 12])
def test_the_update_is_that_of_the_paper_s_terms(d: int, n: int) -> None:
    for seed in range(5):
        case = some_case(seed, d, n)
        found = ncrkf.update(*case)
        x, P, nis = in_the_paper_s_terms(case)
        sigma = np.sqrt(np.diag(P))
        assert not found.guarded
        assert np.abs((found.x - x) / sigma).max() < 1e-7
        assert np.abs((found.P - P) / np.outer(sigma, sigma)).max() < 1e-7
        assert found.nis == pytest.approx(nis, rel=1e-7)


def test_a_batch_is_a_loop() -> None:
    case = some_case(1, 3, 4, 3, 2)
    batch = ncrkf.update(*case)
    for i in np.ndindex(3, 2):
        one = ncrkf.update(
            case.x[i],
            case.P[i],
            case.reference[i],
            case.companions[i],
            case.rd[i],
            case.rd_covariance,
            case.sigma_p,
        )
        np.testing.assert_allclose(batch.x[i], one.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(batch.P[i], one.P, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(batch.nis[i], one.nis, rtol=1e-9)
        np.testing.assert_array_equal(batch.P[i], batch.P[i].T)
        assert batch.guarded[i] == one.guarded


def test_a_geometry_shared_by_all_trials_needs_no_copies() -> None:
    case = some_case(2)
    x, P = np.stack([case.x] * 4), np.stack([case.P] * 4)
    shared = ncrkf.update(x, P, *case[2:])
    assert shared.P.shape == (4, 6, 6)
    np.testing.assert_allclose(shared.x[3], ncrkf.update(*case).x, rtol=1e-12)


# --- Symmetries ------------------------------------------------------------------------

seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=60, deadline=None)
@given(seed=seeds, d=st.sampled_from([2, 3]), n=st.integers(1, 8))
def test_where_north_is_and_the_origin_do_not_matter(seed: int, d: int, n: int) -> None:
    case = some_case(seed, d, n)
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.standard_normal((d, d)))[0]
    shift = rng.normal(0.0, 3000.0, d)
    both = np.kron(np.eye(2), turn)
    offset = np.concatenate([shift, np.zeros(d)])
    here = ncrkf.update(*case)
    there = ncrkf.update(
        both @ case.x + offset,
        both @ case.P @ both.T,
        turn @ case.reference + shift,
        case.companions @ turn.T + shift,
        *case[4:],
    )
    sigma = np.sqrt(np.diag(here.P))
    assert np.abs((both.T @ (there.x - offset) - here.x) / sigma).max() < 1e-6
    difference = (both.T @ there.P @ both - here.P) / np.outer(sigma, sigma)
    assert np.abs(difference).max() < 1e-6
    assert there.nis == pytest.approx(here.nis, rel=1e-6)


@settings(max_examples=60, deadline=None)
@given(seed=seeds, n=st.integers(2, 8))
def test_the_companions_names_do_not_matter(seed: int, n: int) -> None:
    case = some_case(seed, 3, n)
    rng = np.random.default_rng(seed)
    Cr = rd_covariance(rng.uniform(1.0, 5.0, n), rng.uniform(0.0, 0.9, n))
    order = rng.permutation(n)
    here = ncrkf.update(*case[:5], Cr, 0.5)
    there = ncrkf.update(
        *case[:3], case.companions[order], case.rd[order], Cr[np.ix_(order, order)], 0.5
    )
    sigma = np.sqrt(np.diag(here.P))
    assert np.abs((there.x - here.x) / sigma).max() < 1e-6
    assert np.abs((there.P - here.P) / np.outer(sigma, sigma)).max() < 1e-6


@settings(max_examples=200, deadline=None)
@given(
    seed=seeds,
    d=st.sampled_from([2, 3]),
    n=st.integers(1, 12),
    spread=st.floats(-3.0, 4.0),
    baseline=st.floats(-1.0, 3.0),
    outlier=st.floats(-1e4, 1e4),
)
def test_the_covariance_stays_positive_definite_whatever_comes(
    seed: int, d: int, n: int, spread: float, baseline: float, outlier: float
) -> None:
    """Prior spreads of 1 mm to 10 km, baselines of 0.1 m to 1 km, RDs off by 10 km."""
    rng = np.random.default_rng(seed)
    case = some_case(seed, d, n)
    root = rng.standard_normal((2 * d, 2 * d)) * 10.0**spread
    companions = case.reference + rng.standard_normal((n, d)) * 10.0**baseline
    rd = case.rd + outlier * rng.standard_normal(n)
    P = root @ root.T + 1e-6 * np.trace(root @ root.T) * np.eye(2 * d)
    found = ncrkf.update(case.x, P, case.reference, companions, rd, *case[5:])
    assert np.isfinite(found.x).all()
    np.testing.assert_array_equal(found.P, found.P.T)
    np.linalg.cholesky(found.P)


def test_a_uav_at_the_very_estimate_does_no_harm() -> None:
    case = some_case(3)
    at_reference = case.x.copy()
    at_reference[:3] = case.reference
    at_companion = case.x.copy()
    at_companion[:3] = case.companions[1]
    for x in (at_reference, at_companion):
        np.linalg.cholesky(ncrkf.update(x, *case[1:]).P)


# --- The guard -------------------------------------------------------------------------


def test_the_guard_keeps_the_prior_where_information_comes_out_negative() -> None:
    """A wave without any curvature, while the prior knows nothing of the range: A < 0 there."""
    angles = np.linspace(0.6, 2.6, 12)
    companions = 300.0 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    x = np.array([5000.0, 0.0, 0.0, 0.0])
    flat = -companions[:, 0]
    Cr = rd_covariance(np.full(12, 3.0), 0.5)

    wide = np.diag([8000.0**2, 8000.0**2, 1.0, 1.0])
    found = ncrkf.update(x, wide, np.zeros(2), companions, flat, Cr, 0.5)
    assert found.guarded
    assert found.P[0, 0] == pytest.approx(wide[0, 0], rel=0.01)  # along: as before
    assert abs(found.x[0] - x[0]) < 800.0
    assert found.P[1, 1] < 0.01 * wide[1, 1]  # across: the bearing is known all the same
    np.linalg.cholesky(found.P)

    narrow = np.diag([500.0**2, 500.0**2, 1.0, 1.0])
    assert not ncrkf.update(x, narrow, np.zeros(2), companions, flat, Cr, 0.5).guarded


# --- The parts, by Monte Carlo ---------------------------------------------------------


class Close(NamedTuple):
    """An emitter so close that the squares of the noise show."""

    p: np.ndarray
    m: np.ndarray
    D_0: float
    D: np.ndarray
    C: np.ndarray


def close_up() -> Close:
    p = np.array([5.0, 2.0, -1.0])
    m = np.array([[3.0, -2.0, 0.5], [-1.5, 3.5, 1.0], [1.0, 1.0, 4.5]])
    C = effective_covariance(rd_covariance([1.0, 1.5, 2.0], 0.4), 0.5)
    return Close(p, m, float(np.linalg.norm(p)), np.linalg.norm(p - m, axis=1), C)


def residuals_at_the_truth(at: Close, eps: np.ndarray) -> np.ndarray:
    """The residual y - H~ s over 2 D_j, from the linear form (2) as it stands."""
    rd = at.D - at.D_0 + eps
    y = rd**2 - (at.m**2).sum(1) - np.diag(at.C)
    return np.asarray((y + 2.0 * at.m @ at.p + 2.0 * rd * at.D_0) / (2.0 * at.D))


def test_the_residual_has_no_mean_and_the_covariance_it_is_weighted_with() -> None:
    at, draws = close_up(), 400_000
    rng = np.random.default_rng(4)
    eta = residuals_at_the_truth(at, rng.standard_normal((draws, 3)) @ np.linalg.cholesky(at.C).T)
    R = ncrkf.residual_covariance(at.C, at.D)
    # Its second term is 2-4 %; five standard errors of a variance are 1.1 %.
    assert (np.diag(R) > 1.02 * np.diag(at.C)).all()
    error = np.sqrt((np.outer(np.diag(R), np.diag(R)) + R**2) / draws)
    assert (np.abs(np.cov(eta.T) - R) < 5.0 * error).all()
    assert (np.abs(eta.mean(0)) < 5.0 * np.sqrt(np.diag(R) / draws)).all()


def test_the_compensation_is_the_bias_of_the_score() -> None:
    at, draws = close_up(), 400_000
    rng = np.random.default_rng(5)
    eps = rng.standard_normal((draws, 3)) @ np.linalg.cholesky(at.C).T
    K = np.array([[0.9, 0.2, -0.1], [0.0, 0.7, 0.3], [0.1, -0.2, 0.8]])
    M = np.linalg.inv(ncrkf.residual_covariance(at.C, at.D))
    row = -(at.D - at.D_0 + eps @ K.T) / at.D
    score = np.einsum("ki,ij,kj->k", row, M, residuals_at_the_truth(at, eps))
    B = ncrkf.compensation(M, K @ at.C, at.D)
    error = score.std() / np.sqrt(draws)
    assert abs((B @ at.D).sum()) > 50.0 * error
    assert abs(score.mean() + (B @ at.D).sum()) < 5.0 * error


def test_the_range_has_the_prior_s_mean_variance_and_covariance_to_second_order() -> None:
    rng = np.random.default_rng(6)
    draws = 1_000_000
    p = np.array([900.0, 300.0, -60.0])
    root = np.array([[0.4, 0.0, 0.0], [0.2, 0.6, 0.0], [-0.1, 0.1, 0.2]])
    D_0 = np.asarray(np.linalg.norm(p))
    prior = ncrkf.match_range(p, D_0, root)
    z = rng.standard_normal((draws, 3))
    # What the linear part of the range does not explain.
    rest = np.linalg.norm(p + z @ root.T, axis=1) - prior.mean - z @ prior.row[:3]
    own = prior.row[3]
    assert abs(rest.mean()) < 5.0 * own / np.sqrt(draws)
    # The square of a Gaussian has kurtosis 15: standard error sqrt(14 / draws) of its variance.
    assert rest.var() == pytest.approx(own**2, rel=5.0 * np.sqrt(14.0 / draws))
    assert (np.abs(rest @ z) / draws < 5.0 * own / np.sqrt(draws)).all()


# --- Wrong arguments -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x": np.zeros(2)}, "x must be"),
        ({"x": np.full(6, np.nan)}, "x must be finite"),
        ({"x": np.array([0.0, 0.0, 0.0, np.nan, 0.0, 0.0])}, "x must be finite"),
        ({"P": np.diag([1.0, 1.0, 1.0, 1.0, 1.0, np.inf])}, "P must be finite"),
        ({"P": np.eye(4)}, "P must be"),
        ({"P": np.eye(6) * np.nan}, "P must be finite"),
        ({"P": np.diag([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])}, "P must be positive definite"),
        ({"reference": np.zeros(4)}, "reference must be"),
        ({"reference": np.array([np.inf, 0.0, 0.0])}, "reference must be finite"),
        ({"companions": np.zeros((2, 3))}, "companions must be"),
        ({"companions": np.full((3, 3), np.nan)}, "companions must be finite"),
        ({"rd": np.zeros(0)}, "rd must be"),
        ({"rd": np.array([1.0, np.nan, 2.0])}, "rd must be finite"),
        ({"rd": np.full(3, 1e200)}, "exceed float64"),
        ({"rd_covariance": np.eye(2)}, "rd_covariance must be"),
        ({"rd_covariance": np.zeros((3, 3)), "sigma_p": 0.0}, "rd_covariance must be positive"),
        ({"sigma_p": -0.5}, "sigma_p must be"),
        ({"sigma_p": np.nan}, "sigma_p must be"),
    ],
)
def test_wrong_arguments_are_named(change: dict[str, object], message: str) -> None:
    case = some_case(7)._replace(**change)  # type: ignore[arg-type]  # one of each type
    with pytest.raises(EstimationError, match=message):
        ncrkf.update(*case)
