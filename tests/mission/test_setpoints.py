"""A plan as commands, and how far the vehicles are from it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.formation.guidance import LineOfSight
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.mission.planner import PlannedMotion, Planner
from swarmctl.mission.setpoints import measured_slots, setpoint_commands
from swarmctl.mission.target import Target
from tests.mission.vehicles import fleet_of, report
from tests.missions import short_mission_text

MISSION = parse_mission(short_mission_text())
UTC = 1_790_000_000.0
ALTITUDES = np.array([v.altitude_amsl_m for v in MISSION.swarm.vehicles])
HEIGHTS = ALTITUDES - MISSION.origin.alt_amsl_m
POSITIONS = np.column_stack([[0.0, 50.0, -50.0, 0.0], [0.0, 90.0, 90.0, -120.0], HEIGHTS])
VELOCITIES = np.array([[1.0, 2.0, 0.0], [3.0, 4.0, 0.0], [5.0, 6.0, 0.0], [7.0, 8.0, 0.0]])
SLOTS = POSITIONS + np.array([3.0, 4.0, 0.0])


@pytest.fixture
def planned() -> PlannedMotion:
    return PlannedMotion(POSITIONS, VELOCITIES, SLOTS, LineOfSight(0.0, 0.0), ())


@pytest.fixture
def planner() -> Planner:
    planner = Planner(MISSION)
    aim = Target((1500.0, 700.0, 0.0), (0.0, 0.0, 0.0), 2.0, 0.1, (4.0, 0.0, 4.0))
    planner.begin(POSITIONS[:, :2], aim)
    return planner


def test_each_vehicle_of_ours_is_sent_its_own_row_at_its_own_altitude(
    planned: PlannedMotion,
) -> None:
    commands = setpoint_commands(planned, fleet_of(MISSION), [True, False, True, True])
    assert [c.sysid for c in commands] == [1, 3, 4]
    for row, command in zip((0, 2, 3), commands, strict=True):
        lat, lon, alt = command.lat_rad, command.lon_rad, command.alt_amsl_m
        assert MISSION.frame.to_enu(lat, lon, alt)[:2] == pytest.approx(
            POSITIONS[row, :2], abs=0.01
        )
        assert alt == ALTITUDES[row]
        assert command.velocity_enu == tuple(VELOCITIES[row])


def test_a_plan_for_another_number_of_vehicles_is_a_bug(planned: PlannedMotion) -> None:
    with pytest.raises(ValueError, match="shorter"):
        setpoint_commands(planned, fleet_of(MISSION), [True])


def test_errors_are_measured_at_one_instant(planned: PlannedMotion, planner: Planner) -> None:
    """A report that is 2 s old is carried on by its velocity."""
    fleet = fleet_of(MISSION)
    report(fleet, 1, (0.0, 0.0, HEIGHTS[0]), 0.0, utc_s=UTC)
    east, north, up = POSITIONS[1]
    report(fleet, 2, (east - 20.0, north, up), 0.0, utc_s=UTC - 2.0, velocity=(10.0, 0.0, 0.0))
    slots = measured_slots(planned, fleet, planner, UTC)
    assert [s.sysid for s in slots] == [1, 2, 3, 4]
    assert [s.position_enu for s in slots] == [tuple(row) for row in SLOTS.tolist()]
    assert [s.velocity_enu for s in slots] == [tuple(row) for row in VELOCITIES.tolist()]
    assert slots[0].error_m == pytest.approx(5.0, abs=0.01)
    assert slots[0].range_to_reference_m is None, "it is the reference"
    assert slots[1].error_m == pytest.approx(5.0, abs=0.01)
    reach = math.dist(POSITIONS[0], POSITIONS[1])
    assert slots[1].range_to_reference_m == pytest.approx(reach, abs=0.01)
    assert slots[2].error_m is slots[2].range_to_reference_m is None, "never heard"


def test_nothing_is_measured_while_utc_is_unknown(planned: PlannedMotion, planner: Planner) -> None:
    fleet = fleet_of(MISSION)
    for sysid, place in zip(fleet.vehicles, POSITIONS.tolist(), strict=True):
        report(fleet, sysid, tuple(place), 0.0, utc_s=UTC)
    slots = measured_slots(planned, fleet, planner, None)
    assert all(s.error_m is None and s.range_to_reference_m is None for s in slots)


def test_one_that_is_lost_or_on_its_way_back_has_not_joined(
    planned: PlannedMotion, planner: Planner
) -> None:
    def joined() -> list[bool]:
        return [s.joined for s in measured_slots(planned, fleet_of(MISSION), planner, UTC)]

    assert joined() == [True, True, True, True]
    planner.drop(2)
    assert joined() == [True, True, False, True]
    planner.add(2, POSITIONS[2, :2])
    assert joined() == [True, True, False, True]
