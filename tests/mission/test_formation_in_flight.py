"""The formation in flight: designs, slots and their line of sight, without vehicles."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.mission.formation_in_flight import HOLD_RAD, RELABEL_RAD, FormationInFlight
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.mission_file_loading import load_mission, parse_mission
from tests.missions import DEMO, short_mission_text

DT = 0.1
FAR = 2500.0
FAST = 0.02
"""Limit of the LOS's correction in these tests, rad/s."""


@pytest.fixture
def mission() -> Mission:
    return load_mission(DEMO)


def shape_of(mission: Mission, bearing_rad: float = 0.0) -> FormationInFlight:
    """A formation that stands, every companion 12 m above the last."""
    shape = FormationInFlight(mission)
    positions = np.array([[0.0, 0.0], [20.0, 0.0], [0.0, 20.0], [0.0, -20.0]])
    shape.begin(positions, FAR * np.array([math.cos(bearing_rad), math.sin(bearing_rad)]))
    return shape


def turn(
    shape: FormationInFlight,
    bearing_rad: float,
    *,
    seconds: float,
    range_m: float = FAR,
    los_sigma_rad: float = 0.01,
) -> None:
    for _ in range(round(seconds / DT)):
        shape.turn(bearing_rad, 0.0, range_m, los_sigma_rad, FAST, DT)


def test_the_slots_keep_their_distance_in_space(mission: Mission) -> None:
    shape = shape_of(mission)
    distance = np.hypot(np.linalg.norm(shape.offsets(), axis=1), [12.0, 24.0, 36.0])
    assert distance == pytest.approx(mission.limits.d_max_m - mission.formation.margin_m)


def test_the_formation_turns_with_the_line_of_sight(mission: Mission) -> None:
    shape = shape_of(mission, 0.3)
    before = shape.offsets()
    turn(shape, 0.8, seconds=60.0)
    assert shape.los.angle_rad == pytest.approx(0.8, abs=1e-3)
    c, s = math.cos(0.5), math.sin(0.5)
    # To within what a new design for the same range may differ by: nothing.
    assert shape.offsets() == pytest.approx(before @ np.array([[c, s], [-s, c]]), abs=0.5)


def test_a_line_of_sight_that_is_not_known_does_not_turn_it(mission: Mission) -> None:
    shape = shape_of(mission, 0.3)
    turn(shape, 0.8, seconds=10.0, los_sigma_rad=1.01 * HOLD_RAD)
    assert shape.los.angle_rad == pytest.approx(0.3)
    turn(shape, 0.8, seconds=10.0, los_sigma_rad=0.99 * HOLD_RAD)
    assert shape.los.angle_rad > 0.4


def test_the_bearing_s_own_rate_is_followed_even_so(mission: Mission) -> None:
    shape = shape_of(mission, 0.3)
    for _ in range(10):
        shape.turn(0.3, 0.05, FAR, 3.0, FAST, DT)
    assert shape.los.angle_rad == pytest.approx(0.3 + 0.05 * 10 * DT)


def test_an_unsure_line_of_sight_widens_the_formation_and_a_sure_one_narrows_it(
    mission: Mission,
) -> None:
    shape = shape_of(mission)
    nominal = shape.offsets()
    turn(shape, 0.0, seconds=500.0, los_sigma_rad=math.radians(20.0))
    wide = shape.offsets()
    assert np.abs(wide - nominal).max() > 20.0
    turn(shape, 0.0, seconds=500.0, los_sigma_rad=math.radians(2.0))
    assert shape.offsets() == pytest.approx(nominal, abs=0.1)


def test_a_line_of_sight_that_turns_round_relabels_instead_of_crossing(mission: Mission) -> None:
    shape = shape_of(mission, 0.0)
    before = shape.offsets()
    shape.turn(RELABEL_RAD + 0.1, 0.0, FAR, 0.01, FAST, DT)
    # Nobody jumps: the slots are where they were, and only then move.
    assert np.linalg.norm(shape.offsets() - before, axis=1).max() < 1.0
    turn(shape, RELABEL_RAD + 0.1, seconds=300.0)
    ahead = np.array([math.cos(RELABEL_RAD + 0.1), math.sin(RELABEL_RAD + 0.1)])
    along = np.sort(shape.offsets() @ ahead)
    assert along[0] == pytest.approx(-283.0, abs=3.0)
    assert (along[1:] > 0.0).all()


def test_slots_move_from_design_to_design_slowly_and_never_jump(mission: Mission) -> None:
    shape = shape_of(mission)
    spare = mission.limits.max_speed_mps - mission.limits.cruise_speed_mps
    last, fastest = shape.offsets(), 0.0
    first = last
    for range_m in np.linspace(FAR, 430.0, 3000):
        shape.turn(0.0, 0.0, float(range_m), 0.01, FAST, DT)
        here = shape.offsets()
        fastest = max(fastest, float(np.linalg.norm(here - last, axis=1).max()) / DT)
        assert (here - last) / DT == pytest.approx(shape.velocities(), abs=1e-6)
        last = here
    assert np.abs(last - first).max() > 30.0
    assert fastest <= 0.7 * spare + 1e-9


def test_a_lost_companion_s_place_is_closed_and_opened_again(mission: Mission) -> None:
    shape = shape_of(mission)
    three = shape.offsets()
    gone = shape.offsets()[1]
    shape.drop(2)
    assert shape.members == [1, 3]
    turn(shape, 0.0, seconds=600.0)
    # Two stand across the line of sight, one on either side.
    assert sorted(np.sign(shape.offsets()[:, 1])) == [-1.0, 1.0]
    assert np.abs(shape.offsets()[:, 1]).min() > 270.0
    shape.add(2, gone)
    assert shape.members == [1, 3, 2]
    assert shape.offsets()[2] == pytest.approx(gone)
    turn(shape, 0.0, seconds=600.0)
    assert np.sort(shape.offsets(), axis=0) == pytest.approx(np.sort(three, axis=0), abs=2.0)


def test_a_design_with_a_slot_ahead_keeps_the_reference_farther_off() -> None:
    near, far = (
        FormationInFlight(parse_mission(short_mission_text(formation__design=design))).orbit_m
        for design in ("optimal", "uniform")
    )
    assert near == 425.0
    assert far > 412.5 + 0.9 * 135.0


def test_a_doubtful_estimate_changes_no_design_and_a_lost_one_moves_nobody(
    mission: Mission,
) -> None:
    shape, doubtful = shape_of(mission), shape_of(mission)
    before = shape.offsets()
    for _ in range(3000):
        shape.turn(0.0, 0.0, 500.0, 0.01, FAST, DT)
        doubtful.turn(0.0, 0.0, 500.0, 0.01, FAST, DT, redesign=False)
    assert np.abs(shape.offsets() - before).max() > 30.0
    assert np.abs(doubtful.offsets() - before).max() < 1.0
    shape.turn(0.3, 0.02, 500.0, 0.01, FAST, DT)
    assert np.abs(shape.velocities()).max() > 1.0
    shape.rest(DT)
    assert np.abs(shape.velocities()).max() < 0.1
