"""Range differences: values, slopes, and the noise they are seen with."""

from __future__ import annotations

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.model.range_difference import (
    effective_covariance,
    effective_relative_covariance,
    jacobian,
    range_differences,
    rd_covariance,
)

EMITTER = np.array([120.0, -340.0, 3.0])
REFERENCE = np.array([-400.0, 30.0, 60.0])
COMPANIONS = REFERENCE + np.array([[40.0, 90.0, 15.0], [70.0, -80.0, 30.0], [-95.0, 5.0, 45.0]])


def test_a_range_difference_is_the_companion_s_range_less_the_reference_s() -> None:
    rd = range_differences(np.array([3.0, 4.0]), np.zeros(2), np.array([[3.0, 0.0], [0.0, 4.0]]))
    assert rd.tolist() == [-1.0, -2.0]


@pytest.mark.parametrize("d", [2, 3])
def test_the_jacobian_agrees_with_finite_differences(d: int) -> None:
    emitter, reference, companions = EMITTER[:d], REFERENCE[:d], COMPANIONS[:, :d]
    step = 1e-3
    numeric = np.stack(
        [
            range_differences(emitter + axis, reference, companions)
            - range_differences(emitter - axis, reference, companions)
            for axis in step * np.eye(d)
        ],
        axis=-1,
    ) / (2.0 * step)
    # The central difference errs by step² / D², some 1e-11; rounding by 1e-13 / step.
    np.testing.assert_allclose(jacobian(emitter, reference, companions), numeric, atol=1e-9)


def test_a_batch_is_a_loop() -> None:
    rng = np.random.default_rng(1)
    emitters = EMITTER + rng.normal(0.0, 50.0, (4, 1, 3))
    references = REFERENCE + rng.normal(0.0, 50.0, (5, 3))
    companions = rng.normal(0.0, 200.0, (4, 5, 6, 3))
    rd = range_differences(emitters, references, companions)
    slope = jacobian(emitters, references, companions)
    for i in range(4):
        for j in range(5):
            one = (emitters[i, 0], references[j], companions[i, j])
            np.testing.assert_array_equal(rd[i, j], range_differences(*one))
            np.testing.assert_array_equal(slope[i, j], jacobian(*one))


def test_companions_share_the_noise_of_the_reference_receiver() -> None:
    np.testing.assert_allclose(rd_covariance([2.0, 3.0], 0.5), [[4.0, 3.0], [3.0, 9.0]])
    np.testing.assert_allclose(
        rd_covariance([2.0, 3.0], [0.0, 0.5]), [[4.0, 0.0], [0.0, 9.0]], atol=1e-15
    )
    assert rd_covariance(np.ones((7, 4)), 0.3).shape == (7, 4, 4)


@pytest.mark.parametrize(
    ("sigma", "rho", "message"),
    [
        ([1.0, -1.0], 0.5, "sigma must be"),
        ([1.0, 0.0], 0.5, "sigma must be"),
        ([1.0, np.nan], 0.5, "sigma must be"),
        ([1.0, np.inf], 0.5, "sigma must be"),
        ([], 0.5, "sigma must be"),
        ([1.0], 1.0, "rho must be"),
        ([1.0], -0.1, "rho must be"),
        ([1.0], np.nan, "rho must be"),
    ],
)
def test_a_noise_that_cannot_be_is_refused(sigma: list[float], rho: float, message: str) -> None:
    with pytest.raises(EstimationError, match=message):
        rd_covariance(sigma, rho)


def test_the_effective_covariance_is_that_of_the_residual_at_measured_positions() -> None:
    rng = np.random.default_rng(2)
    draws, sigma_p = 200_000, 0.8
    Cr = rd_covariance([1.0, 1.5, 2.0], 0.4)
    noise = rng.standard_normal((draws, 3)) @ np.linalg.cholesky(Cr).T
    d_reference = sigma_p * rng.standard_normal((draws, 3))
    d_companions = sigma_p * rng.standard_normal((draws, 3, 3))
    measured = range_differences(EMITTER, REFERENCE, COMPANIONS) + noise

    absolute = measured - range_differences(
        EMITTER, REFERENCE + d_reference, COMPANIONS + d_companions
    )
    assert_is_covariance_of(effective_covariance(Cr, sigma_p), absolute)

    # The paper's relative position (to the true reference) sees the reference's error through
    # the baselines: u_iᵀu_j in place of 1. Here that is 0.97: told apart by this many draws.
    relative = measured - range_differences(
        EMITTER - REFERENCE,
        np.zeros(3),
        COMPANIONS - REFERENCE + d_companions - d_reference[:, None],
    )
    C = effective_relative_covariance(Cr, sigma_p, EMITTER - REFERENCE, COMPANIONS - REFERENCE)
    assert_is_covariance_of(C, relative)


def assert_is_covariance_of(covariance: np.ndarray, draws: np.ndarray) -> None:
    """Sample covariance within five of its own standard errors, (C_ii C_jj + C_ij²) / n."""
    variance = np.diag(covariance)
    error = np.sqrt((np.outer(variance, variance) + covariance**2) / len(draws))
    assert (np.abs(np.cov(draws.T) - covariance) < 5.0 * error).all()


@pytest.mark.parametrize("d", [2, 3])
def test_the_relative_covariance_is_that_of_the_slopes_by_every_position(d: int) -> None:
    """Cr + sigma_p² G Gᵀ, G by central differences; for a batch of emitters at once."""
    Cr, sigma_p, step = rd_covariance([1.0, 1.5, 2.0], 0.4), 0.8, 1e-2
    emitters = (EMITTER - REFERENCE)[:d] + np.array([0.0, 50.0, -80.0])[:, None]
    baselines = (COMPANIONS - REFERENCE)[:, :d]
    found = effective_relative_covariance(Cr, sigma_p, emitters, baselines)
    assert found.shape == (3, 3, 3)
    for p, C in zip(emitters, found, strict=True):
        columns = []
        for shift in step * np.eye(4 * d):
            moved = shift.reshape(4, d)  # the reference UAV first
            ahead, behind = (
                range_differences(p, np.zeros(d), baselines + sign * (moved[1:] - moved[0]))
                for sign in (1.0, -1.0)
            )
            columns.append((ahead - behind) / (2.0 * step))
        G = np.stack(columns, axis=-1)
        # The slopes err by step² / D², below 1e-9.
        np.testing.assert_allclose(C, Cr + sigma_p**2 * G @ G.T, atol=1e-8)


@pytest.mark.parametrize("far", [3e3, 3e4, 3e5])
def test_far_away_the_relative_covariance_is_the_absolute_one(far: float) -> None:
    """u_i and u_j differ by an angle below |m_i - m_j| / D, u_iᵀ u_j from 1 by half its square."""
    Cr, sigma_p = rd_covariance([1.0, 1.5, 2.0], 0.4), 0.8
    m = COMPANIONS - REFERENCE
    emitter = far * np.array([0.6, 0.0, 0.8])
    found = effective_relative_covariance(Cr, sigma_p, emitter, m)
    short_of = effective_covariance(Cr, sigma_p) - found
    apart = np.linalg.norm(m[:, None] - m, axis=-1)
    nearest = far - np.linalg.norm(m, axis=-1).max()
    assert (short_of > -1e-12).all()
    assert (short_of <= 0.5 * sigma_p**2 * (apart / nearest) ** 2 + 1e-12).all()
