"""Silence that counts as the loss of a vehicle."""

import pytest

from swarmctl.mission.loss_detection import HEARTBEAT_LOST_AFTER_S, LOST_AFTER_S, LossDetection
from swarmctl.mission.mission_file_loading import parse_mission
from tests.mission.vehicles import beat, fleet_of, report
from tests.missions import short_mission_text

MISSION = parse_mission(short_mission_text())


def test_a_vehicle_that_was_never_heard_is_lost() -> None:
    assert LossDetection(0.0).is_lost(fleet_of(MISSION).vehicles[1], 0.0)


@pytest.mark.parametrize("hiccup_s", [0.0, 2.0])
def test_positions_that_stop_are_a_loss_though_heartbeats_go_on(hiccup_s: float) -> None:
    fleet, losses = fleet_of(MISSION), LossDetection(hiccup_s)
    report(fleet, 1, (0.0, 0.0, 30.0), 0.0)
    last = LOST_AFTER_S + hiccup_s
    beat(fleet.vehicles[1], last)
    assert not losses.is_lost(fleet.vehicles[1], last)
    assert losses.is_lost(fleet.vehicles[1], last + 0.1)


@pytest.mark.parametrize("hiccup_s", [0.0, 2.0])
def test_heartbeats_that_stop_are_a_loss_though_positions_go_on(hiccup_s: float) -> None:
    fleet, losses = fleet_of(MISSION), LossDetection(hiccup_s)
    beat(fleet.vehicles[1], 0.0)
    last = HEARTBEAT_LOST_AFTER_S + hiccup_s
    report(fleet, 1, (0.0, 0.0, 30.0), last)
    assert not losses.is_lost(fleet.vehicles[1], last)
    assert losses.is_lost(fleet.vehicles[1], last + 0.1)
