"""Planned paths keep apart whatever is wanted, and everybody still gets where he wants to."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from swarmctl.formation import separation
from swarmctl.formation.guidance import go_to
from swarmctl.formation.separation import SpeedBound, least_distances, separate, slot_separation
from swarmctl.units import Array

SPEED_MPS, ACCELERATION_MPS2, DT = 13.0, 2.0, 0.1
D_M = 13.0


@dataclass
class Flown:
    """A flight of points that do what they plan."""

    least_m: float
    seconds: float
    arrived: bool


def fly(starts: np.ndarray, goals: np.ndarray, weights: np.ndarray, limit_s: float) -> Flown:
    """All at one altitude, from rest to their goals; who has no weight stands still."""
    apart = least_distances([30.0] * len(starts), D_M - 5.0, 5.0)
    here, least = starts.astype(float), math.inf
    velocities: Array = np.zeros((len(starts), 2))
    for period in range(round(limit_s / DT)):
        wanted = np.array(
            [go_to((e, n), 0.9 * SPEED_MPS, 1.0, 0.5) for e, n in (goals - here).tolist()]
        )
        wanted[weights == 0.0] = 0.0
        planned = separate(
            here, velocities, wanted, apart, weights, [], SPEED_MPS, ACCELERATION_MPS2, DT
        )
        assert np.linalg.norm(planned - velocities, axis=1).max() <= ACCELERATION_MPS2 * DT + 1e-9
        assert np.linalg.norm(planned, axis=1).max() <= SPEED_MPS + 1e-9
        here = here + 0.5 * (velocities + planned) * DT
        velocities = planned
        least = min(least, nearest(here))
        if (np.linalg.norm(goals - here, axis=1) < 1.0).all():
            return Flown(least, period * DT, True)
    return Flown(least, limit_s, False)


def test_each_brakes_and_goes_aside_as_well_as_it_can() -> None:
    """Two head-on, one of them slower and four times as sluggish: neither is asked for more."""
    speeds, accelerations = np.array([13.0, 8.0]), np.array([2.0, 0.5])
    apart = least_distances([30.0, 30.0], D_M - 5.0, 5.0)
    here = np.array([[-150.0, 0.0], [150.0, 0.0]])
    velocities: Array = np.zeros((2, 2))
    goals = -here
    least = math.inf
    for _ in range(900):
        wanted = np.array(
            [
                go_to((e, n), 0.9 * speed, 0.5 * a, 0.5)
                for (e, n), speed, a in zip(
                    (goals - here).tolist(), speeds, accelerations, strict=True
                )
            ]
        )
        planned = separate(
            here, velocities, wanted, apart, np.ones(2), [], speeds, accelerations, DT
        )
        assert (np.linalg.norm(planned - velocities, axis=1) <= accelerations * DT + 1e-9).all()
        assert (np.linalg.norm(planned, axis=1) <= speeds + 1e-9).all()
        here = here + 0.5 * (velocities + planned) * DT
        velocities = planned
        least = min(least, nearest(here))
    assert least >= D_M
    assert np.linalg.norm(goals - here, axis=1).max() < 1.0


def nearest(places: np.ndarray) -> float:
    gaps = np.linalg.norm(places[:, None] - places, axis=-1)
    return float(gaps[np.triu_indices(len(places), 1)].min())


def scattered(rng: np.random.Generator, count: int, taken: list[np.ndarray]) -> np.ndarray:
    """Random places a little more than D apart, in a square they fill by a fifth."""
    half = 12.0 * math.sqrt(count + len(taken))
    places = list(taken)
    while len(places) < count + len(taken):
        place = rng.uniform(-half, half, 2)
        if all(math.dist(place, other) > D_M + 0.5 for other in places):
            places.append(place)
    return np.array(places)


@pytest.mark.parametrize("count", [2, 3, 4, 7, 10, 13])
def test_all_swap_places_across_a_circle(count: int) -> None:
    """Free, each takes 23 s; round one another on a circle no longer than half of it, pi / 2."""
    angles = 2.0 * math.pi * np.arange(count) / count
    starts = max(60.0, D_M * count / math.pi) * np.column_stack((np.cos(angles), np.sin(angles)))
    flown = fly(starts, np.roll(starts, count // 2, axis=0), np.ones(count), 60.0)
    assert flown.least_m >= D_M
    assert flown.arrived
    assert flown.seconds < 23.0 * math.pi / 2.0


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("obstacle", [False, True])
def test_a_crowd_of_any_order_sorts_itself_out(seed: int, obstacle: bool) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 13))
    standing = [np.zeros(2)] if obstacle else []
    weights = np.array([0.0] * len(standing) + [1.0] * count)
    flown = fly(scattered(rng, count, standing), scattered(rng, count, standing), weights, 200.0)
    assert flown.least_m >= D_M
    assert flown.arrived


@pytest.mark.parametrize("seed", range(3))
def test_the_proof_alone_keeps_them_apart(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wishes that change at random and mean to collide, and no bending of them at all."""
    monkeypatch.setattr(separation, "_project", lambda wanted, spaces, weights: wanted)
    rng = np.random.default_rng(seed)
    here = scattered(rng, 8, [])
    velocities: Array = np.zeros((8, 2))
    apart = least_distances([30.0] * 8, D_M - 5.0, 5.0)
    least = math.inf
    for period in range(400):
        if period % 20 == 0:
            aims = rng.integers(0, 8, 8)
        wanted = here[aims] - here
        wanted *= SPEED_MPS / np.maximum(np.linalg.norm(wanted, axis=1, keepdims=True), 1.0)
        planned = separate(
            here, velocities, wanted, apart, np.ones(8), [], SPEED_MPS, ACCELERATION_MPS2, DT
        )
        here = here + 0.5 * (velocities + planned) * DT
        velocities = planned
        least = min(least, nearest(here))
    # Equal but for rounding: positions are summed in another order than the proof's.
    assert D_M - 1e-9 <= least < D_M + 0.5


def test_who_is_far_or_staggered_does_what_it_wants() -> None:
    """Within its acceleration."""
    starts = np.array([[0.0, 0.0], [14.0, 0.0]])
    wanted = np.array([[5.0, 0.0], [-5.0, 0.1]])
    still = np.zeros((2, 2))
    for heights, places in (([30.0, 38.0], starts), ([30.0, 30.0], 100.0 * starts)):
        apart = least_distances(heights, 8.0, 5.0)
        planned = separate(
            places, still, wanted, apart, np.ones(2), [], SPEED_MPS, ACCELERATION_MPS2, DT
        )
        reached = wanted * 0.2 / np.linalg.norm(wanted, axis=1, keepdims=True)
        assert planned == pytest.approx(reached)


def test_the_lighter_one_makes_way() -> None:
    """From rest two metres beyond D, head-on."""
    starts = np.array([[0.0, 0.0], [D_M + 2.0, 0.0]])
    ends = starts[::-1].copy()
    apart = least_distances([30.0, 30.0], D_M - 5.0, 5.0)
    here = starts.copy()
    velocities: Array = np.zeros((2, 2))
    aside = np.zeros(2)
    for _ in range(300):
        wanted = np.array([go_to((e, n), 5.0, 1.0, 0.5) for e, n in (ends - here).tolist()])
        planned = separate(here, velocities, wanted, apart, np.array([1.0, 0.1]), [], 13.0, 2.0, DT)
        here, velocities = here + 0.5 * (velocities + planned) * DT, planned
        aside = np.maximum(aside, np.abs(here[:, 1]))
    assert np.linalg.norm(here - ends, axis=1).max() < 0.1
    assert aside[0] > 3.0 * aside[1]


def test_a_pair_that_is_too_near_parts() -> None:
    here = np.array([[0.0, 0.0], [6.0, 0.0]])
    velocities: Array = np.zeros((2, 2))
    apart = least_distances([30.0, 30.0], D_M - 5.0, 5.0)
    gap = 6.0
    for _ in range(100):
        planned = separate(here, velocities, 0.0 * here, apart, np.ones(2), [], 13.0, 2.0, DT)
        here, velocities = here + 0.5 * (velocities + planned) * DT, planned
        assert nearest(here) >= gap - 1e-9
        gap = nearest(here)
    assert gap >= D_M


def test_nobody_is_sent_over_a_bound_to_make_way() -> None:
    here = np.array([[0.0, 0.0], [0.0, D_M + 1.0]])
    velocities: Array = np.zeros((2, 2))
    apart = least_distances([30.0, 30.0], D_M - 5.0, 5.0)
    wanted = np.array([[0.0, 5.0], [0.0, 0.0]])
    bounds = [SpeedBound(1, (0.0, 1.0), 0.0)]
    for _ in range(50):
        planned = separate(here, velocities, wanted, apart, np.ones(2), bounds, 13.0, 2.0, DT)
        here, velocities = here + 0.5 * (velocities + planned) * DT, planned
    assert here[1, 1] <= D_M + 1.0 + 0.1
    assert nearest(here) >= D_M


def test_least_distances_are_for_pairs_that_share_a_level() -> None:
    apart = least_distances([30.0, 30.0, 36.0, 44.0], 10.0, 5.0)
    assert apart[0] == pytest.approx([0.0, 15.0, 13.0, 0.0])
    assert (apart == apart.T).all()
    assert slot_separation([30.0, 40.0], 10.0, 5.0) == 10.0
    assert slot_separation([30.0, 39.0], 10.0, 5.0) == 18.0
