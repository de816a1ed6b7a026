"""Statistics of the position error."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from sim.config import NavigationConfig
from sim.navigation_errors import NavigationErrors
from sim.noise import generator

RISK = 1e-4


def test_a_report_adds_a_fresh_white_part_to_the_correlated_one() -> None:
    config = NavigationConfig(white_sigma_m=0.7, correlated_sigma_m=3.0, correlated_tau_s=1e6)
    error = NavigationErrors(config, 0.02, np.random.default_rng(1))
    reports = np.array([error.report_enu() for _ in range(4000)])
    white = reports - error.correlated_enu
    low, high = stats.chi2.interval(1.0 - RISK, white.size)
    assert low < np.sum(white**2) / 0.7**2 < high
    # Independent from report to report and between axes.
    n = len(white)
    bound = stats.norm.isf(RISK / 2.0) / np.sqrt(n - 1)
    assert abs(np.corrcoef(white[:-1, 0], white[1:, 0])[0, 1]) < bound
    assert abs(np.corrcoef(white[:, 0], white[:, 1])[0, 1]) < bound


def test_the_correlated_part_has_its_deviation_across_vehicles() -> None:
    config = NavigationConfig(white_sigma_m=0.0, correlated_sigma_m=3.0, correlated_tau_s=10.0)
    values = []
    for seed in range(1000):
        error = NavigationErrors(config, 1.0, np.random.default_rng(seed))
        for _ in range(3):
            error.advance()
        values.append(error.correlated_enu)
        assert error.report_enu() == error.correlated_enu
    low, high = stats.chi2.interval(1.0 - RISK, 3000)
    assert low < np.sum(np.square(values)) / 3.0**2 < high


def test_two_vehicles_errors_are_independent() -> None:
    """Each has the generator that the world gives it: of 1000 flights, after a while."""
    config = NavigationConfig(white_sigma_m=0.0, correlated_sigma_m=3.0, correlated_tau_s=10.0)
    flights = 1000

    def errors(sysid: int) -> np.ndarray:
        ends = []
        for seed in range(flights):
            error = NavigationErrors(config, 1.0, generator(seed, "navigation", sysid))
            for _ in range(3):
                error.advance()
            ends.append(error.correlated_enu)
        return np.array(ends).T

    bound = math.tanh(stats.norm.isf(RISK / 2.0) / math.sqrt(flights - 3))
    for one in errors(1):
        for other in errors(2):
            assert abs(np.corrcoef(one, other)[0, 1]) < bound
