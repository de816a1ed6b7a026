"""The search: what it may not break, and that it finds optima known otherwise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmctl.formation import design_search
from swarmctl.formation.design_search import feasible, first_of_best, refine, turned, worst
from swarmctl.formation.objectives import approach, determinant, rms, track
from swarmctl.formation.requirements import Requirements
from swarmctl.units import Array

NINETY = math.pi / 2.0


def requirements(companions: int, range_m: float = 5000.0) -> Requirements:
    return Requirements(companions, 300.0, 10.0, range_m)


def scattered(wanted: Requirements, seed: int) -> Array:
    """A feasible design that nobody has thought about."""
    rng = np.random.default_rng(seed)
    while True:
        theta = rng.uniform(-math.pi, math.pi, wanted.companions)
        d = rng.uniform(wanted.separation_m, wanted.max_slot_distance_m, wanted.companions)
        design = np.column_stack((theta, d))
        if feasible(wanted, design):
            return design


# --- what is feasible ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("slots", "kept"),
    [
        ([(NINETY, 300.0), (-NINETY, 10.0)], True),
        ([(NINETY, 300.001), (-NINETY, 10.0)], False),
        ([(NINETY, 300.0), (-NINETY, 9.999)], False),
        ([(NINETY, 300.0), (NINETY, 290.001)], False),
        ([(NINETY, 300.0), (NINETY, 290.0)], True),
    ],
)
def test_a_design_keeps_d_max_and_the_separation_to_the_millimetre(
    slots: list[tuple[float, float]], kept: bool
) -> None:
    assert feasible(requirements(2), np.array(slots)) == kept
    several = np.array([[slots] * 2] * 3)
    assert (feasible(requirements(2), several) == np.full((3, 2), kept)).all()


# --- a line of sight that is off -------------------------------------------------------


def test_the_worst_of_a_sector_is_the_worst_of_its_lines_of_sight() -> None:
    objective = rms(requirements(3))
    designs = np.stack([scattered(requirements(3), seed) for seed in range(4)])
    offsets = np.radians([-30.0, 0.0, 20.0])
    each = [objective(designs - [angle, 0.0]) for angle in offsets]
    np.testing.assert_allclose(worst(objective, designs, offsets), np.max(each, axis=0))
    assert turned(designs, offsets).shape == (4, 3, 3, 2)


def test_of_equals_the_first_is_taken() -> None:
    assert first_of_best(np.array([3.0, 2.0 * (1.0 + 1e-12), 2.0, 2.1])) == 1
    assert first_of_best(np.array([3.0, 2.0 * (1.0 + 1e-6), 2.0, 2.1])) == 2
    assert first_of_best(np.array([math.inf, math.inf])) == 0


# --- the search ------------------------------------------------------------------------


@pytest.mark.parametrize("range_m", [1000.0, 20_000.0])
def test_from_one_slot_on_either_side_it_finds_the_two_best_points(range_m: float) -> None:
    """Where the emitter's rays touch the circle, whatever the objective."""
    wanted = requirements(2, range_m)
    end = math.acos(300.0 / range_m)
    for objective in (determinant(wanted), rms(wanted)):
        best = objective(np.array([(end, 300.0), (-end, 300.0)]))
        for seed in range(5):
            start = scattered(wanted, seed)
            start[:, 0] = np.abs(start[:, 0]) * [1.0, -1.0]
            found = refine(wanted, objective, [start])
            # The search ends when a step gains less than 1e-7.
            assert objective(found) == pytest.approx(best, rel=1e-6)
            assert found[:, 0] == pytest.approx([end, -end], abs=0.01)


@settings(max_examples=25, deadline=None)
@given(
    companions=st.integers(1, 7),
    seed=st.integers(0, 10**6),
    range_m=st.floats(700.0, 20_000.0),
    name=st.sampled_from(["determinant", "rms", "track"]),
)
def test_it_keeps_the_limits_and_is_never_worse_than_its_start(
    companions: int, seed: int, range_m: float, name: str
) -> None:
    wanted = Requirements(companions, 300.0, 40.0, range_m)
    prior = np.diag([100.0, 100.0, 5.0, 5.0]) ** 2
    flight = approach(range_m, 10.0, 20.0, 10.0, prior, epochs=8)
    objective = {
        "determinant": determinant(wanted),
        "rms": rms(wanted),
        "track": track(wanted, flight),
    }[name]
    start = scattered(wanted, seed)
    found = refine(wanted, objective, [start])
    assert feasible(wanted, found)
    assert (found[:, 1] <= 300.0).all()
    assert objective(found) <= objective(start)
    np.testing.assert_array_equal(refine(wanted, objective, [start]), found)


def test_a_search_that_ends_too_early_breaks_no_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """On its way it may; a third of these are then cut off outside the limits."""
    monkeypatch.setattr(design_search, "ITERATIONS", 3)
    wanted = Requirements(6, 300.0, 60.0, 5000.0)
    for seed in range(20):
        assert feasible(wanted, refine(wanted, rms(wanted), [scattered(wanted, seed)]))


def test_what_observes_nothing_is_given_back_as_it_came() -> None:
    start = np.array([(1.0, 200.0)])
    np.testing.assert_array_equal(
        refine(requirements(1), determinant(requirements(1)), [start]), start
    )


def test_where_no_slot_can_move_the_start_is_kept() -> None:
    """Seven UAVs a separation apart within one separation: a hexagon and its centre."""
    wanted = Requirements(6, 300.0, 300.0, 5000.0)
    start = np.column_stack((np.radians(np.arange(-120.0, 181.0, 60.0)), np.full(6, 300.0)))
    found = refine(wanted, rms(wanted), [start])
    assert feasible(wanted, found)
    np.testing.assert_allclose(found[:, 1], 300.0, rtol=1e-8)


def test_a_slot_near_the_axis_stays_on_its_side() -> None:
    wanted = requirements(3)
    ends = [(1.4, 280.0), (-1.5, 290.0)]
    for side, sign in ((0.0, 1.0), (math.pi, -1.0)):
        start = np.array([*ends, (side, 20.0)])
        found = refine(wanted, rms(wanted), [start], np.radians([-40.0, -10.0, 20.0, 40.0]))
        assert sign * math.cos(found[2, 0]) >= -1e-9


def test_over_a_sector_it_is_the_worst_that_is_made_better() -> None:
    wanted = requirements(4)
    objective = determinant(wanted)
    offsets = np.radians(np.linspace(-30.0, 30.0, 9))
    start = np.array([(1.5, 300.0), (1.7, 300.0), (-1.5, 300.0), (-1.7, 300.0)])
    found = refine(wanted, objective, [start], offsets)
    assert worst(objective, found, offsets) < 0.95 * worst(objective, start, offsets)
    assert feasible(wanted, found)
