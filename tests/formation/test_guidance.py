"""Guidance laws, flown by an ideal point in virtual time."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmctl.formation.guidance import (
    LineOfSight,
    approach_and_orbit,
    follow_line_of_sight,
    go_to,
    orbit_speed,
    pace,
    wrap_angle,
)


@given(st.floats(-50, 50))
def test_wrapped_angles_are_the_same_angle(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


def test_the_outermost_follower_flies_exactly_the_top_speed() -> None:
    speed = orbit_speed(13.0, 425.0, 285.0)
    rate = speed / 425.0
    assert rate * (425.0 + 285.0) == pytest.approx(13.0)


speed = st.floats(-15, 15)


@given(
    st.tuples(st.floats(100, 3000), st.floats(-500, 500)),
    st.tuples(speed, speed),
    st.tuples(st.floats(-2, 2), st.floats(-2, 2)),
    st.lists(st.tuples(st.floats(-300, 300), st.floats(-300, 300), st.floats(4, 20)), max_size=5),
)
def test_at_the_pace_everyone_just_keeps_up(
    offset: tuple[float, float],
    relative: tuple[float, float],
    drift: tuple[float, float],
    others: list[tuple[float, float, float]],
) -> None:
    slots = np.array([(0.0, 0.0), *((x, y) for x, y, _ in others)])
    speeds = np.array([13.0, *(most for _, _, most in others)])
    share = pace(offset, relative, drift, slots, speeds)

    def load(share: float) -> float:
        # Where the slots are after a little while, by rotating the whole formation.
        h = 1e-4
        moved = (offset[0] + share * relative[0] * h, offset[1] + share * relative[1] * h)
        turn = math.atan2(moved[1], moved[0]) - math.atan2(offset[1], offset[0])
        c, s = math.cos(turn), math.sin(turn)
        shift = np.array(moved) - np.array(offset) + h * np.array(drift)
        velocity = (slots @ np.array([[c, s], [-s, c]]) + shift - slots) / h
        return float((np.linalg.norm(velocity, axis=1) / speeds).max())

    assert 0.0 <= share <= 1.0
    assert load(share) <= 1.0 + 1e-3
    if share < 1.0:
        assert load(share) == pytest.approx(1.0, abs=1e-3)


def test_whoever_cannot_even_follow_the_emitter_stops_the_swarm() -> None:
    assert pace((1000.0, 0.0), (-5.0, 0.0), (3.0, 0.0), np.zeros((1, 2)), np.array([2.0])) == 0.0


def test_the_approach_joins_the_orbit_and_stays_on_it() -> None:
    east, north, dt = -2500.0, 100.0, 0.1
    nearest = math.inf
    for _ in range(6000):
        ve, vn = approach_and_orbit((east, north), (0.0, 0.0), 425.0, 10.0, 7.0)
        assert math.hypot(ve, vn) <= 10.0 + 1e-9
        east, north = east + ve * dt, north + vn * dt
        nearest = min(nearest, math.hypot(east, north))
    assert nearest > 424.0
    assert math.hypot(east, north) == pytest.approx(425.0, abs=1.0)
    ve, vn = approach_and_orbit((east, north), (0.0, 0.0), 425.0, 10.0, 7.0)
    assert math.hypot(ve, vn) == pytest.approx(7.0, abs=0.01)
    assert east * vn - north * ve > 0.0  # counter-clockwise


def test_the_orbit_moves_with_the_emitter() -> None:
    ve, vn = approach_and_orbit((425.0, 0.0), (1.5, 0.5), 425.0, 10.0, 7.0)
    assert (ve, vn) == pytest.approx((1.5, 7.5))


def test_the_los_follows_geometry_at_once_and_corrects_at_a_limited_rate() -> None:
    los = LineOfSight(0.0, 0.0)
    los = follow_line_of_sight(los, 1.0, 0.02, 0.01, 0.1)
    assert los.rate_rads == pytest.approx(0.03)
    for _ in range(3000):
        los = follow_line_of_sight(los, 1.0, 0.0, 0.01, 0.1)
    assert los.angle_rad == pytest.approx(1.0, abs=1e-6)


def test_the_los_turns_the_short_way_round() -> None:
    los = follow_line_of_sight(LineOfSight(3.1, 0.0), -3.1, 0.0, 1.0, 0.1)
    assert los.rate_rads > 0.0


@settings(max_examples=30)
@given(st.floats(-3000, 3000), st.floats(-3000, 3000))
def test_go_to_arrives_without_overshoot(east: float, north: float) -> None:
    dt, start = 0.1, math.hypot(east, north)
    least = start
    for _ in range(int(start / 10.0 / dt) + 400):
        ve, vn = go_to((-east, -north), 10.0, 1.0)
        assert math.hypot(ve, vn) <= 10.0 + 1e-9
        east, north = east + ve * dt, north + vn * dt
        here = math.hypot(east, north)
        assert here <= least + 1e-9
        least = here
    assert least < 0.5
