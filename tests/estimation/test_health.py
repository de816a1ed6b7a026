"""Good data are left in peace, bad models are named."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from swarmctl.estimation.arguments import Array
from swarmctl.estimation.health import Health, Verdict

PAIRS = ((0, 1), (0, 2), (0, 3))
HZ = 10.0


def run(
    health: Health, seconds: float, white: Callable[[int], Array], begin_s: float = 0.0
) -> list[Verdict]:
    return [
        health.add(begin_s + k / HZ, PAIRS, white(k), 0, ()) for k in range(round(seconds * HZ))
    ]


def good(seed: int) -> Callable[[int], Array]:
    rng = np.random.default_rng(seed)
    return lambda _: rng.standard_normal(3)


def test_an_hour_of_good_data_is_never_degraded() -> None:
    """By the thresholds once in hundreds of hours."""
    statuses = {verdict.status for verdict in run(Health(), 3600.0, good(0))[30:]}
    assert statuses == {"tracking"}


def test_a_tenth_of_echoes_is_no_reason() -> None:
    rng = np.random.default_rng(1)
    health = Health()
    for k in range(6000):
        aside = tuple((np.flatnonzero(rng.random(3) < 0.1) + 1).tolist())
        pairs = tuple(pair for pair in PAIRS if pair[1] not in aside)
        white = rng.standard_normal(len(pairs))
        verdict = health.add(k / HZ, pairs, white, len(aside), aside)
        assert k < 30 or verdict.status == "tracking"


@pytest.mark.parametrize("cause", ["noise", "correlated"])
def test_a_wrong_model_is_named_within_five_seconds_and_forgiven_when_it_is_right(
    cause: str,
) -> None:
    health = Health()
    run(health, 10.0, good(2))
    rng = np.random.default_rng(3)
    state = np.zeros(3)

    def wrong(_: int) -> Array:
        nonlocal state
        if cause == "noise":
            return 2.0 * rng.standard_normal(3)
        # Of unit variance, like good ones, but remembering.
        state = 0.8 * state + 0.6 * rng.standard_normal(3)
        return state

    verdict = run(health, 5.0, wrong, 10.0)[-1]
    assert (verdict.status, verdict.cause) == ("degraded", cause)
    after = run(health, 10.0, good(4), 15.0)
    # All sums have to be well inside for as long as the window.
    assert after[20].status == "degraded"
    assert after[-1].status == "tracking"


def test_one_receiver_that_is_always_set_aside_is_named() -> None:
    health = Health()
    run(health, 10.0, good(5))
    for k in range(50):
        verdict = health.add(10.0 + k / HZ, PAIRS[:2], good(k)(0)[:2], 1, (3,))
    assert (verdict.status, verdict.cause) == ("degraded", "rejected")


def test_a_track_that_is_elsewhere_has_diverged() -> None:
    health = Health()
    run(health, 10.0, good(6))
    for k in range(50):
        verdict = health.add(10.0 + k / HZ, (), np.zeros(0), 3, (0,))
    assert verdict.status == "diverged"
    rng = np.random.default_rng(7)
    assert run(Health(), 8.0, lambda _: 4.0 * rng.standard_normal(3))[-1].status == "diverged"
