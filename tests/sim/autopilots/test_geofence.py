"""Fences: what they contain, and how fast one may still fly towards them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.autopilots.geofence import Fence
from sim.dynamics import Command, State, step
from tests.sim.flying import vehicle

# An L: the square from 0 to 100 without its upper right quarter.
ELL = ((0.0, 0.0), (100.0, 0.0), (100.0, 50.0), (50.0, 50.0), (50.0, 100.0), (0.0, 100.0))


@pytest.mark.parametrize(
    ("place", "inside"),
    [((25, 75), True), ((75, 25), True), ((75, 75), False), ((-1, 50), False), ((25, 101), False)],
)
def test_a_concave_polygon(place: tuple[float, float], inside: bool) -> None:
    assert Fence(inside=(ELL,)).contains((*place, 10.0)) is inside
    assert Fence(outside=(ELL,)).contains((*place, 10.0)) is not inside


def test_circles_and_ceiling() -> None:
    fence = Fence(
        circles_inside=((0.0, 0.0, 50.0),), circles_outside=((20.0, 0.0, 5.0),), ceiling_up_m=30.0
    )
    assert fence.contains((0.0, 49.0, 29.0))
    assert not fence.contains((0.0, 51.0, 29.0))
    assert not fence.contains((22.0, 0.0, 29.0))
    assert not fence.contains((0.0, 0.0, 31.0))
    assert Fence().contains((1e6, 1e6, 1e6))


@given(st.floats(-math.pi, math.pi), st.floats(1.0, 12.0))
@settings(deadline=None)
def test_whatever_velocity_is_asked_for_it_stops_just_inside(course: float, speed: float) -> None:
    fence, limits = Fence(inside=(ELL,), ceiling_up_m=60.0), vehicle().limits
    state = State((30.0, 30.0, 40.0), on_ground=False)
    asked = (speed * math.sin(course), speed * math.cos(course), 1.0)
    for _ in range(3000):
        velocity = fence.restrain(state.position_enu, asked, 2.0)
        command = Command((0.0, 0.0, 0.0), velocity, 1.0)
        state = step(state, command, (0.0, 0.0, 0.0), limits, -1e3, 0.02)
        assert fence.contains(state.position_enu)
    assert state.position_enu[2] == pytest.approx(58.0, abs=0.5)
    assert math.hypot(*state.velocity_enu) < 12.0


def test_how_far_beyond_is_told_of_each_kind() -> None:
    square = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
    circle = (0.0, 0.0, 10.0)
    assert Fence(inside=(square,)).beyond_m((13.0, 14.0, 0.0)) == 5.0
    assert Fence(outside=(square,)).beyond_m((3.0, 5.0, 0.0)) == 3.0
    assert Fence(circles_inside=(circle,)).beyond_m((9.0, 12.0, 0.0)) == 5.0
    assert Fence(circles_outside=(circle,)).beyond_m((3.0, 4.0, 0.0)) == 5.0
    assert Fence(ceiling_up_m=20.0).beyond_m((0.0, 0.0, 27.0)) == 7.0
    everything = Fence((square,), (), (circle,), (), 20.0)
    assert everything.beyond_m((3.0, 4.0, 19.0)) == 0.0
    assert everything.beyond_m((13.0, 14.0, 27.0)) == pytest.approx(math.hypot(13.0, 14.0) - 10.0)
