"""What no command may break."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmctl.formation.flight_limits import (
    FlightLimits,
    keep_inside,
    keep_outside,
    limit,
    violations,
)

BOUNDS = FlightLimits(
    separation_m=8.0, d_max_m=300.0, stand_off_m=400.0, fence_radius_m=4000.0, ceiling_m=120.0
)
EMITTER = np.array([1000.0, 0.0, 0.0])
GOOD = np.array([[0.0, 0.0, 40.0], [0.0, 285.0, 52.0], [0.0, -285.0, 64.0], [-285.0, 0.0, 76.0]])

angles = st.floats(-math.pi, math.pi)


@settings(max_examples=30)
@given(start=st.floats(430.0, 2000.0), bearing=angles, aim=st.floats(-400, 400))
def test_a_path_aimed_at_the_circle_slides_round_it(
    start: float, bearing: float, aim: float
) -> None:
    east, north = start * math.cos(bearing), start * math.sin(bearing)
    dt = 0.1
    for _ in range(1500):
        wanted = limit((aim - east, -north), 10.0)
        ve, vn = keep_outside((east, north), wanted, 412.0, 1.0)
        assert math.hypot(ve, vn) <= 10.0 + 1e-9
        east, north = east + ve * dt, north + vn * dt
        # One explicit Euler step of the chord at 10 m/s bends outwards only by 1.2 mm.
        assert math.hypot(east, north) >= 412.0 - 0.1


@given(bearing=angles, gap=st.floats(1.0, 100.0), east=st.floats(-10, 10), north=st.floats(-10, 10))
def test_inside_the_circle_every_velocity_leads_out(
    bearing: float, gap: float, east: float, north: float
) -> None:
    offset = ((412.0 - gap) * math.cos(bearing), (412.0 - gap) * math.sin(bearing))
    ve, vn = keep_outside(offset, (east, north), 412.0, 1.0)
    assert ve * math.cos(bearing) + vn * math.sin(bearing) > 0.0


def test_a_velocity_away_from_the_circle_is_left_alone() -> None:
    assert keep_outside((500.0, 0.0), (3.0, 4.0), 412.0, 1.0) == (3.0, 4.0)


@settings(max_examples=30)
@given(bearing=angles, start=st.floats(0.0, 990.0), east=st.floats(-9, 9), north=st.floats(-9, 9))
def test_the_fence_is_never_crossed(
    bearing: float, start: float, east: float, north: float
) -> None:
    here = [start * math.cos(bearing), start * math.sin(bearing)]
    for _ in range(2000):
        ve, vn = keep_inside((here[0], here[1]), (east, north), 1000.0, 1.0)
        here = [here[0] + 0.1 * ve, here[1] + 0.1 * vn]
        assert math.hypot(*here) <= 1000.0 + 0.1


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(0.1, 20))
def test_limit_shortens_and_never_turns(east: float, north: float, most: float) -> None:
    ve, vn = limit((east, north), most)
    assert math.hypot(ve, vn) <= most * (1 + 1e-12)
    assert ve * north == pytest.approx(vn * east, abs=1e-6)
    assert ve * east + vn * north >= 0.0


def test_a_good_plan_breaks_nothing() -> None:
    assert violations(GOOD, 0, EMITTER, BOUNDS) == []


@pytest.mark.parametrize(
    ("row", "position", "text"),
    [
        (1, (0.0, 300.0, 52.0), "a range to the reference of 300.2 m > 300 m"),
        (1, (1.0, 1.0, 47.0), "a separation of 7.1 m < 8 m"),
        (2, (620.0, -100.0, 60.0), "a stand-off of 397.5 m < 400.0 m"),
        (2, (0.0, -4001.0, 64.0), "a distance from the origin of 4001 m > 4000 m"),
        (3, (-200.0, 0.0, 121.0), "a height of 121.0 m > 120.0 m"),
    ],
)
def test_each_broken_limit_is_named(
    row: int, position: tuple[float, float, float], text: str
) -> None:
    plan = GOOD.copy()
    plan[row] = position
    assert text in violations(plan, 0, EMITTER, BOUNDS)


def test_the_range_does_not_bind_before_the_formation_is_formed() -> None:
    plan = GOOD.copy()
    plan[1] = (0.0, 350.0, 52.0)
    bounds = FlightLimits(8.0, None, 400.0, 4000.0, 120.0)
    assert violations(plan, 0, EMITTER, bounds) == []
