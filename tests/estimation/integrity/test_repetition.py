"""Copies are told from a coarse feed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.estimation.integrity.health import ALARM
from swarmctl.estimation.integrity.repetition import Repetition
from swarmctl.estimation.model.rows import Rows, star
from swarmctl.units import Array

HZ = 10.0
N = 3


def feed(rng: np.random.Generator, count: int, sigma: float, step: float) -> Array:
    """Range differences of a swarm that hovers, (count, N)."""
    arrivals = sigma / math.sqrt(2.0) * rng.standard_normal((count, N + 1))
    rd = np.array([100.0, -40.0, 7.0]) + arrivals[:, 1:] - arrivals[:, :1]
    rounded: Array = np.round(rd / step) * step if step else rd
    return rounded


def rows(t: float, rd: Array, sigma: float) -> Rows:
    C = 0.5 * sigma**2 * (np.eye(N) + 1.0)
    return star(t, 0, np.zeros(2), [1, 2, 3], np.zeros((N, 2)), rd, C)


@pytest.mark.parametrize("step", [0.0, 0.001, 0.01, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("sigma", [0.5, 0.05])
def test_an_honest_feed_is_never_accused_however_coarse(step: float, sigma: float) -> None:
    """Its claim covers its resolution; five minutes of 3 s windows, 1e-7 each."""
    claim = math.hypot(sigma, step / math.sqrt(6.0))
    repetition = Repetition(ALARM)
    for k, rd in enumerate(feed(np.random.default_rng(0), 3000, sigma, step)):
        assert not repetition.add(rows(k / HZ, rd, claim)).any()
        assert repetition.sigmas < ALARM


@pytest.mark.parametrize("step", [0.0, 0.01, 0.1])
def test_a_receiver_that_hangs_is_found_and_its_rows_are_copies(step: float) -> None:
    good = feed(np.random.default_rng(1), 300, 0.5, step)
    repetition = Repetition(ALARM)
    for k, rd in enumerate(good):
        hung = np.array([rd[0], good[200, 1], rd[2]]) if k >= 200 else rd
        copies = repetition.add(rows(k / HZ, hung, 0.5))
        assert k < 220 or copies[1]
        # By chance: two rows with p = q / (sqrt(2 pi) s), s = 0.41.
        assert step == 0.1 or k <= 200 or not copies[[0, 2]].all()
    assert repetition.sigmas > ALARM


@pytest.mark.parametrize("step", [0.0, 0.01, 0.1])
def test_epochs_that_are_played_again_are_found(step: float) -> None:
    good = feed(np.random.default_rng(2), 300, 0.5, step)
    repetition = Repetition(ALARM)
    for k, rd in enumerate([*good, *good[100:200]]):
        copies = repetition.add(rows(k / HZ, rd, 0.5))
        assert k < 320 or copies.all()
    # A good feed again: it is forgiven when the window has passed.
    for k, rd in enumerate(feed(np.random.default_rng(3), 32, 0.5, step)):
        repetition.add(rows(40.0 + k / HZ, rd, 0.5))
    assert repetition.sigmas < ALARM


def test_one_message_that_comes_twice_says_nothing_of_the_feed() -> None:
    good = feed(np.random.default_rng(4), 100, 0.5, 0.0)
    repetition = Repetition(ALARM)
    for k, rd in enumerate([*good[:50], good[49], *good[50:]]):
        assert not repetition.add(rows(k / HZ, rd, 0.5)).any()
        assert repetition.sigmas == 0.0


def test_of_a_feed_coarser_than_its_noise_nothing_is_said() -> None:
    """All rows stay the same for minutes, as they should: nothing moves."""
    repetition = Repetition(ALARM)
    flat = feed(np.random.default_rng(5), 2000, 0.02, 1.0)
    flat[700:705] += 1.0
    for k, rd in enumerate(flat):
        assert not repetition.add(rows(k / HZ, rd, 0.41)).any()
        assert repetition.sigmas < ALARM
