"""The failsafes of the simulated ArduCopter by their parameters, over MAVLink bytes."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.faults import Faults
from tests.sim.flying import BRAKE, GUIDED, LAND, RTL, Station, of_type, simulation, vehicle

GCS = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3)


def mode(station: Station) -> int:
    return int(station.heartbeat().custom_mode)


@pytest.mark.parametrize(("enabled", "entered"), [(0, GUIDED), (1, RTL), (5, LAND), (7, BRAKE)])
def test_gcs_loss_does_what_is_set_5_s_after_the_last_heartbeat(enabled: int, entered: int) -> None:
    parameters = (("FS_GCS_ENABLE", enabled), ("MAV_GCS_SYSID", 77))
    station = Station(simulation(vehicle(parameters=parameters)))
    station.airborne(20.0)
    station.send(GCS)
    station.advance(4.9)
    assert mode(station) == GUIDED
    station.advance(0.2)
    assert mode(station) == entered
    station.send(GCS)
    cleared = "GCS Failsafe Cleared" in [
        m.text for m in of_type("STATUSTEXT", station.advance(0.1))
    ]
    assert cleared is (enabled != 0)
    assert mode(station) == entered


@pytest.mark.parametrize(("action", "entered"), [(0, GUIDED), (1, LAND), (2, RTL)])
def test_a_low_battery_does_what_is_set(action: int, entered: int) -> None:
    # It falls below 11.535 V after 13 s with the motors armed.
    parameters = (("BATT_FS_LOW_ACT", action), ("BATT_LOW_VOLT", 11.535), ("BATT_LOW_TIMER", 3))
    station = Station(simulation(vehicle(parameters=parameters, charge=0.5)))
    station.airborne(20.0)
    assert mode(station) == entered
    assert "Battery 1 is low" in [m.text for m in of_type("STATUSTEXT", station.received)]


def test_gps_loss_lands_after_8_s() -> None:
    station = Station(simulation(vehicle(faults=Faults(gps_lost_at_s=40.0))))
    station.airborne(20.0)
    station.advance(47.9 - station.world.time_s)
    assert mode(station) == GUIDED
    station.advance(0.2)
    assert mode(station) == LAND
