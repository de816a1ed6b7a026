"""Range differences: values, slopes, and the noise they are seen with."""

from __future__ import annotations

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.rd_model import (
    effective_covariance,
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
    u = EMITTER - COMPANIONS
    u /= np.linalg.norm(u, axis=-1, keepdims=True)
    assert_is_covariance_of(Cr + sigma_p**2 * (np.eye(3) + u @ u.T), relative)


def assert_is_covariance_of(covariance: np.ndarray, draws: np.ndarray) -> None:
    """Sample covariance within five of its own standard errors, (C_ii C_jj + C_ij²) / n."""
    variance = np.diag(covariance)
    error = np.sqrt((np.outer(variance, variance) + covariance**2) / len(draws))
    assert (np.abs(np.cov(draws.T) - covariance) < 5.0 * error).all()
