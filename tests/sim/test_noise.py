"""Statistics of the random processes."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from sim.noise import BLOCK, GaussMarkov, Normals, generator

RISK = 1e-4
"""Probability that a correct implementation misses one of the derived bounds."""


def test_normals_are_the_generators_deviates() -> None:
    normals = Normals(np.random.default_rng(3))
    drawn = [normals.draw() for _ in range(2 * BLOCK)]
    expected = np.random.default_rng(3).standard_normal(2 * BLOCK)
    assert sorted(drawn) == sorted(expected.tolist())


def test_generators_differ_by_seed_purpose_and_vehicle() -> None:
    keys = [(1, "gust", 1), (2, "gust", 1), (1, "navigation", 1), (1, "gust", 2)]
    firsts = {float(generator(*key).standard_normal()) for key in keys}
    assert len(firsts) == len(keys)
    assert generator(1, "gust", 1).standard_normal() in firsts


def test_gauss_markov_is_stationary_with_the_given_correlation_time() -> None:
    sigma, tau_s, step_s, steps, count = 2.0, 5.0, 0.5, 10, 2000
    normals = Normals(np.random.default_rng(7))
    first: list[float] = []
    last: list[float] = []
    for _ in range(count):
        process = GaussMarkov(sigma, tau_s, step_s, normals)
        first += process.value
        for _ in range(steps):
            process.advance()
        last += process.value
    n = 3 * count
    low, high = stats.chi2.interval(1.0 - RISK, n)
    for sample in (first, last):
        assert low < np.sum(np.square(sample)) / sigma**2 < high
    # After one correlation time; Fisher's z is standard normal for the right correlation.
    r = float(np.corrcoef(first, last)[0, 1])
    z = math.sqrt(n - 3) * (math.atanh(r) - math.atanh(math.exp(-1.0)))
    assert abs(z) < stats.norm.isf(RISK / 2.0)


def test_without_deviation_it_stays_at_zero() -> None:
    process = GaussMarkov(0.0, 5.0, 0.1, Normals(np.random.default_rng(0)))
    process.advance()
    assert process.value == (0.0, 0.0, 0.0)
