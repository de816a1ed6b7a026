"""Whether samples are noise of a given covariance."""

from __future__ import annotations

import numpy as np
from scipy import stats

from swarmctl.units import Array

RISK = 1e-4
"""Probability that correct code misses one of the statistical bounds of a test."""


def assert_white(noise: Array, covariance: Array) -> None:
    """``noise`` (n, m) has mean zero and ``covariance``.

    An entry of the sample covariance of normal numbers with known mean has the variance
    ``(C_ii C_jj + C_ij²) / n``. Every entry may miss with RISK / (their number).
    """
    n, m = noise.shape
    far = float(stats.norm.isf(RISK / (m + m * m) / 2.0))
    variance = np.diag(covariance)
    assert (np.abs(noise.mean(0)) <= far * np.sqrt(variance / n)).all()
    spread = np.sqrt((np.outer(variance, variance) + covariance**2) / n)
    assert (np.abs(noise.T @ noise / n - covariance) <= far * spread).all()
