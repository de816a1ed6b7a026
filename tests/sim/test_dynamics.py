"""Airframe: limits, following, wind, ground."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.config import VehicleLimits
from sim.dynamics import GRAVITY_MPS2, Command, State, approach_speed, step

LIMITS = VehicleLimits(
    speed_mps=12.0, acceleration_mps2=2.5, climb_mps=3.0, climb_acceleration_mps2=1.5
)
DT = 0.02
DEEP = -1e6
"""Ground far below."""
CALM = (0.0, 0.0, 0.0)


def vectors(size: float) -> st.SearchStrategy[tuple[float, float, float]]:
    axis = st.floats(-size, size)
    return st.tuples(axis, axis, axis)


permitted = st.builds(
    lambda speed, course, climb: (speed * math.sin(course), speed * math.cos(course), climb),
    st.floats(0.0, LIMITS.speed_mps),
    st.floats(0.0, 2.0 * math.pi),
    st.floats(-LIMITS.climb_mps, LIMITS.climb_mps),
)


@given(permitted, vectors(1e4), vectors(60.0), vectors(30.0), st.floats(0.1, 2.0))
def test_speed_and_acceleration_limits_hold(
    velocity: tuple[float, float, float],
    error: tuple[float, float, float],
    feed_forward: tuple[float, float, float],
    wind: tuple[float, float, float],
    gain: float,
) -> None:
    state = State((0.0, 0.0, 0.0), velocity, CALM, False)
    for _ in range(3):
        new = step(state, Command(error, feed_forward, gain), wind, LIMITS, DEEP, DT)
        (ox, oy, oz), (vx, vy, vz) = state.velocity_enu, new.velocity_enu
        assert math.hypot(vx, vy) <= LIMITS.speed_mps + 1e-9
        assert abs(vz) <= LIMITS.climb_mps + 1e-9
        assert math.hypot(vx - ox, vy - oy) <= LIMITS.acceleration_mps2 * DT + 1e-9
        assert abs(vz - oz) <= LIMITS.climb_acceleration_mps2 * DT + 1e-9
        state = new


def test_it_leans_no_faster_than_the_jerk_limit() -> None:
    state = State((0.0, 0.0, 0.0), CALM, CALM, False)
    velocities = [state.velocity_enu]
    for target in (300.0, -300.0):
        for _ in range(100):
            ahead = Command((target, 0.0, 50.0), CALM, 1.0)
            state = step(state, ahead, (3.0, 0.0, 0.0), LIMITS, DEEP, DT)
            velocities.append(state.velocity_enu)
    for axis in (0, 2):
        speeds = [0.0] + [velocity[axis] for velocity in velocities]
        changes = [
            abs(c - 2.0 * b + a) for a, b, c in zip(speeds, speeds[1:], speeds[2:], strict=False)
        ]
        # The jerk's effect on a velocity in one step; the full acceleration is used all the same.
        assert max(changes) == pytest.approx(LIMITS.jerk_mps3 * DT * DT)
    fastest = max(b[0] - a[0] for a, b in itertools.pairwise(velocities))
    assert fastest == pytest.approx(LIMITS.acceleration_mps2 * DT)


def test_a_tailwind_does_not_push_it_beyond_its_speed() -> None:
    state = State((0.0, 0.0, 0.0), (LIMITS.speed_mps, 0.0, 0.0), CALM, False)
    for _ in range(100):
        ahead = Command((1e3, 0.0, 0.0), CALM, 1.0)
        state = step(state, ahead, (40.0, 0.0, 0.0), LIMITS, DEEP, DT)
        assert state.velocity_enu[0] == pytest.approx(LIMITS.speed_mps)


def test_position_moves_with_the_mean_velocity_of_the_step() -> None:
    state = State((10.0, 20.0, 30.0), (1.0, 2.0, 0.5), CALM, False)
    new = step(state, Command(CALM, (5.0, 0.0, 0.0), 1.0), CALM, LIMITS, DEEP, DT)
    for i in range(3):
        mean = 0.5 * (state.velocity_enu[i] + new.velocity_enu[i])
        assert new.position_enu[i] == pytest.approx(state.position_enu[i] + mean * DT, abs=1e-12)


def fly_to(target: tuple[float, float, float], wind: tuple[float, float, float]) -> list[State]:
    state = State((0.0, 0.0, 0.0), CALM, CALM, False)
    states = []
    for _ in range(3000):
        (x, y, z), (tx, ty, tz) = state.position_enu, target
        state = step(state, Command((tx - x, ty - y, tz - z), CALM, 1.0), wind, LIMITS, DEEP, DT)
        states.append(state)
    return states


def test_a_distant_target_is_reached_at_full_speed_and_without_overshoot() -> None:
    states = fly_to((300.0, 0.0, 40.0), CALM)
    fastest = max(state.velocity_enu[0] for state in states)
    assert fastest == pytest.approx(LIMITS.speed_mps, rel=0.05)
    assert max(state.position_enu[0] for state in states) < 300.05
    assert max(state.position_enu[2] for state in states) < 40.05
    assert states[-1].position_enu == pytest.approx((300.0, 0.0, 40.0), abs=1e-3)


def test_wind_is_mostly_but_not_wholly_rejected() -> None:
    # The velocity loop balances the uncancelled fifth of the drag: 3 k e = 0.2 * 0.3 * wind.
    *_, last = fly_to((0.0, 0.0, 0.0), (10.0, 0.0, 0.0))
    assert last.position_enu[0] == pytest.approx(0.2 * 0.3 * 10.0 / 3.0, rel=1e-3)


def test_velocity_alone_brakes_within_the_acceleration_limit() -> None:
    state = State((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), CALM, False)
    for _ in range(500):
        state = step(state, Command(CALM, CALM, 1.0), CALM, LIMITS, DEEP, DT)
    # v²/2a at the limit, then an exponential tail of the 1/3 s velocity loop.
    assert 20.0 < state.position_enu[0] < 21.5
    assert math.hypot(*state.velocity_enu) < 0.01


def test_thrust_carries_the_weight_and_leans_against_the_wind() -> None:
    *_, hover = fly_to((0.0, 0.0, 0.0), (6.0, 0.0, 0.0))
    # At rest all of the drag 0.3 * 6 is balanced by thrust.
    assert hover.thrust_enu == pytest.approx((-1.8, 0.0, GRAVITY_MPS2), abs=1e-3)


def test_idle_on_the_ground_nothing_moves() -> None:
    state = State((1.0, 2.0, 3.0))
    assert step(state, None, (20.0, 0.0, 0.0), LIMITS, 3.0, DT) == state


def test_the_ground_stops_a_descent_and_a_climb_leaves_it() -> None:
    state = State((0.0, 0.0, 1.0), CALM, CALM, False)
    down = Command(CALM, (1.0, 0.0, -1.0), 1.0)
    for _ in range(200):
        state = step(state, down, (5.0, 0.0, 0.0), LIMITS, 0.0, DT)
    assert state.on_ground
    assert state.position_enu[2] == 0.0
    assert state.velocity_enu == CALM
    landed_at = state.position_enu
    state = step(state, down, (5.0, 0.0, 0.0), LIMITS, 0.0, DT)
    assert state.position_enu == landed_at
    state = step(state, Command(CALM, (0.0, 0.0, 1.0), 1.0), CALM, LIMITS, 0.0, DT)
    assert not state.on_ground
    assert state.position_enu[2] > 0.0


def test_with_the_rotors_stopped_it_falls() -> None:
    state = State((0.0, 0.0, 10.0), (3.0, 0.0, 0.0), CALM, False)
    steps = 0
    while not state.on_ground:
        state = step(state, None, CALM, LIMITS, 0.0, DT)
        steps += 1
    # Free fall from 10 m takes 1.43 s; drag of 0.3/s makes it a little longer.
    assert 1.43 < steps * DT < 1.6


@given(st.floats(0.1, 2.0), st.floats(0.2, 5.0))
def test_approach_speed_is_continuous_in_value_and_slope(gain: float, braking: float) -> None:
    joint = braking / gain**2
    h = 1e-4 * joint
    below, at, above = (approach_speed(joint + d, gain, braking) for d in (-h, 0.0, h))
    assert at == pytest.approx(gain * joint)
    assert (above - at) / h == pytest.approx((at - below) / h, rel=1e-3)
