"""What tells two modes apart, and how much of it the noise of reported positions makes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import norm

from swarmctl.estimation.model.rows import Rows
from swarmctl.estimation.track.contrast import Contrast, contrast_in_epoch, no_contrast
from swarmctl.units import Array

LINE = np.array([[0.0, 300.0], [0.0, 150.0], [0.0, 0.0], [0.0, -150.0], [0.0, -300.0]])
"""Where receivers 0 to 4 are; a mode's mirror image is at the opposite x."""
FIRST, SECOND = [2, 0, 3, 2], [0, 1, 1, 4]
"""Pairs in which a receiver is now the first and now the second."""
MODES = np.array([[900.0, 400.0], [-900.0, 400.0]])
SIGMA_R, SIGMA_P = 0.4, 0.5
DRAWS = 1500
SURE = norm.ppf(0.9995)


def expected(emitter: Array, at: Array) -> Array:
    """Range differences of the pairs, from receivers at (..., 5, 2)."""
    ranges = np.linalg.norm(emitter - at, axis=-1)
    difference: Array = ranges[..., SECOND] - ranges[..., FIRST]
    return difference


def by_positions(emitter: Array) -> Array:
    """Derivative of the range differences by the receivers' positions, (K, 10), numerically."""
    steps = 1e-3 * np.eye(10).reshape(10, 5, 2)
    return (expected(emitter, LINE + steps) - expected(emitter, LINE - steps)).T / 2e-3


G = [by_positions(mode) for mode in MODES]
S = SIGMA_R**2 * np.eye(4) + SIGMA_P**2 * G[0] @ G[0].T
A = SIGMA_P**2 * (G[1] - G[0]) @ (G[1] - G[0]).T @ np.linalg.inv(S)


def found(at: Array, reported: Array, noise: Array) -> tuple[Contrast, float]:
    """Between both modes if the first is true; the log-likelihood ratio in its favour."""
    rd = expected(MODES[0], at) + noise
    nu = np.stack([rd - expected(mode, reported) for mode in MODES])
    rows = Rows(0.0, FIRST, SECOND, reported[FIRST], reported[SECOND], rd, S, SIGMA_P)
    ratio = 0.5 * (nu[1] @ np.linalg.solve(S, nu[1]) - nu[0] @ np.linalg.solve(S, nu[0]))
    of_all = contrast_in_epoch(rows, MODES, nu, np.stack([S, S]), SIGMA_P**2)
    return of_all, float(ratio)


@pytest.mark.parametrize("off_m", [0.0, 0.5], ids=["on the line", "one beside it"])
def test_its_moments_and_those_of_the_likelihood_ratio_are_as_derived(off_m: float) -> None:
    """By so many draws of all noise, each within what happens once in a thousand times."""
    at = LINE.copy()
    at[3, 0] = off_m
    c = expected(MODES[1], at) - expected(MODES[0], at)
    information = c @ np.linalg.solve(S, c)
    rng = np.random.default_rng(0)
    squares, ratios = np.empty(DRAWS), np.empty(DRAWS)
    for k in range(DRAWS):
        reported = at + SIGMA_P * rng.standard_normal((5, 2))
        contrast, ratios[k] = found(at, reported, SIGMA_R * rng.standard_normal(4))
        squares[k] = contrast.found[0, 1]
        # Lines of sight turn by half a milliradian.
        assert contrast.noise[0, 1] == pytest.approx(np.trace(A), rel=5e-3)
        assert contrast.variance[0, 1] == pytest.approx(2.0 * np.trace(A @ A), rel=1e-2)
    for values, mean in ((squares, information + np.trace(A)), (ratios, 0.5 * information)):
        assert abs(values.mean() - mean) < SURE * values.std() / math.sqrt(DRAWS)
    # A variance's own scatter, by the fourth moment of what was drawn.
    spread = ((ratios - ratios.mean()) ** 2).std() / math.sqrt(DRAWS)
    assert ratios.var() < information + np.trace(A) + SURE * spread
    if off_m == 0.0:
        spread = ((squares - squares.mean()) ** 2).std() / math.sqrt(DRAWS)
        assert abs(squares.var() - 2.0 * np.trace(A @ A)) < SURE * spread
        # Not far below either: the steps of a walk that would otherwise decide.
        assert ratios.var() > 0.3 * np.trace(A)


def test_the_same_the_other_way_round_and_nothing_of_a_mode_against_itself() -> None:
    reported = LINE + SIGMA_P * np.random.default_rng(1).standard_normal((5, 2))
    contrast, _ = found(LINE, reported, np.zeros(4))
    for part in (contrast.found, contrast.noise, contrast.variance):
        np.testing.assert_allclose(part, part.T, rtol=1e-9)
        np.testing.assert_array_equal(np.diag(part), 0.0)


def test_of_what_noise_alone_explains_nothing_counts_and_of_a_large_contrast_nearly_all() -> None:
    """On the line noise exceeds the three sigmas once in 740 times; then one receiver leaves it."""
    rng = np.random.default_rng(2)
    for _ in range(3):
        total = no_contrast(2)
        for _ in range(100):
            reported = LINE + SIGMA_P * rng.standard_normal((5, 2))
            total = total + found(LINE, reported, SIGMA_R * rng.standard_normal(4))[0]
        assert total.found[0, 1] > 100.0  # nats, and yet
        assert total.share[0, 1] == 0.0
    off = LINE.copy()
    off[0, 0] = 60.0
    total = total + found(off, off, np.zeros(4))[0]
    assert 0.9 < total.share[0, 1] < 1.0


def test_positions_that_are_exact_take_nothing_from_it() -> None:
    contrast = Contrast(np.array([0.0, 1e-9, 5.0]), np.zeros(3), np.zeros(3))
    np.testing.assert_array_equal(contrast.share, [0.0, 1.0, 1.0])


def test_of_many_modes_those_that_are_kept() -> None:
    parts = np.arange(27.0).reshape(3, 3, 3)
    kept = Contrast(*parts).where(np.array([True, False, True]))
    for part, whole in zip((kept.found, kept.noise, kept.variance), parts, strict=True):
        np.testing.assert_array_equal(part, whole[::2, ::2])
