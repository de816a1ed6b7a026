"""Transitions of the formation, flown by simulated airframes in gusty wind."""

from __future__ import annotations

import math

import pytest

from swarmctl.errors import UsageError
from swarmctl.study import transitions
from swarmctl.study.transitions import (
    PER_FLIGHT,
    TransitionFlight,
    fly_transitions,
    run_transitions,
)


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3, 4, 5))]
)
def test_no_transition_breaks_a_limit(seed: int) -> None:
    """Hundreds of them: ``swarmctl study formation --runs 0``."""
    flown = fly_transitions(seed)
    limits = transitions.mission(flown.companions, 0, level=False).limits
    assert flown.separation_m >= limits.min_separation_m
    assert 0.0 < flown.reach_m <= limits.d_max_m
    assert flown.not_formed == 0
    assert flown.swaps == 0


def test_the_worst_of_all_flights_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        transitions,
        "fly_transitions",
        lambda seed: TransitionFlight(seed, 4, 9.0 - 0.1 * seed, 280.0 + seed, seed % 2, 1),
    )
    told = run_transitions(count=2 * PER_FLIGHT + 1, seed=5)
    assert (told.flights, told.transitions) == (3, 3 * PER_FLIGHT)
    assert told.separation_m == pytest.approx(8.3)
    assert told.worst_seed == 7
    assert told.reach_m == 287.0
    assert (told.not_formed, told.swaps) == (2, 3)
    assert math.isclose(told.min_separation_m, 8.0)


def test_no_transitions_are_no_study() -> None:
    with pytest.raises(UsageError, match="at least 1 transition, not 0"):
        run_transitions(count=0)
