"""The failsafes of the px4 personality by their parameters, over MAVLink bytes."""

from __future__ import annotations

import struct

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.config import VehicleConfig
from sim.faults import Faults
from tests.sim.flying import ACCEPTED, ALT, Station, of_type, simulation, vehicle

POSCTL, OFFBOARD = 3 << 16, 6 << 16
HOLD, RTL, LAND = (4 << 16 | sub << 24 for sub in (3, 5, 6))


def px4(**parameters: float) -> VehicleConfig:
    return vehicle(autopilot="px4", parameters=tuple(parameters.items()))


def up(config: VehicleConfig, height_m: float = 20.0) -> Station:
    """A vehicle that holds at a height."""
    station = Station(simulation(config))
    station.advance(5.0)
    assert station.arm() == ACCEPTED
    assert station.take_off(ALT + height_m) == ACCEPTED
    station.advance(5.0 + height_m)
    assert mode(station) == HOLD
    return station


def mode(station: Station) -> int:
    return int(station.heartbeat().custom_mode)


def stream(station: Station, duration_s: float, north_m: float = 0.0) -> None:
    for _ in range(round(duration_s * 10)):
        station.setpoint((0.0, north_m, 20.0))
        station.advance(0.1)


@pytest.mark.parametrize(
    ("action", "entered", "resumes"),
    [(0, POSCTL, True), (3, RTL, False), (4, LAND, False), (5, HOLD, True)],
)
def test_offboard_loss_does_what_is_set(action: int, entered: int, resumes: bool) -> None:
    station = up(px4(COM_OBL_RC_ACT=action))
    stream(station, 1.0)
    assert station.result(mavlink.MAV_CMD_DO_SET_MODE, 1, 6) == ACCEPTED
    stream(station, 1.0)
    assert mode(station) == OFFBOARD
    station.advance(0.9)  # a setpoint is 0.1 s old already
    assert mode(station) == OFFBOARD
    station.advance(0.2)
    assert mode(station) == entered
    assert station.heartbeat().system_status == mavlink.MAV_STATE_CRITICAL
    stream(station, 1.0)
    assert (mode(station) == OFFBOARD) is resumes


def test_a_mode_chosen_meanwhile_is_kept_when_setpoints_resume() -> None:
    station = up(px4())
    stream(station, 1.0)
    station.result(mavlink.MAV_CMD_DO_SET_MODE, 1, 6)
    station.advance(3.0)
    assert mode(station) == POSCTL
    assert station.result(mavlink.MAV_CMD_DO_SET_MODE, 1, 4, 3) == ACCEPTED
    stream(station, 2.0)
    assert mode(station) == HOLD


@pytest.mark.parametrize(("action", "entered"), [(0, HOLD), (2, RTL), (3, LAND)])
def test_datalink_loss_does_what_is_set_10_s_after_the_last_gcs(action: int, entered: int) -> None:
    station = up(px4(NAV_DLL_ACT=action))
    gcs = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3)
    companion = mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER, 8, 0, 0, 4, 3
    )
    station.send(gcs)
    station.advance(9.8)
    station.send(companion)
    assert mode(station) == HOLD
    station.advance(0.4)
    assert mode(station) == entered


@pytest.mark.parametrize(("action", "entered"), [(1, HOLD), (3, RTL), (5, LAND)])
def test_leaving_the_fence_does_what_is_set(action: int, entered: int) -> None:
    station = up(px4(GF_ACTION=action, GF_MAX_HOR_DIST=30.0))
    stream(station, 1.0, 25.0)
    station.result(mavlink.MAV_CMD_DO_SET_MODE, 1, 6)
    stream(station, 15.0, 25.0)
    assert mode(station) == OFFBOARD
    stream(station, 10.0, 40.0)
    assert mode(station) == (OFFBOARD if action == 1 else entered)
    texts = {m.text for m in of_type("STATUSTEXT", station.received)}
    assert "Geofence: exceeding maximum distance to Home" in texts


@pytest.mark.parametrize(("action", "entered"), [(0, HOLD), (2, LAND), (3, RTL)])
def test_a_critical_battery_does_what_is_set(action: int, entered: int) -> None:
    # 27 s of flight take 1.5 % of the charge: it falls below 7 % on the way.
    config = px4(COM_LOW_BAT_ACT=action)
    station = Station(
        simulation(vehicle(autopilot="px4", parameters=config.parameters, charge=0.085))
    )
    station.advance(5.0)
    station.arm()
    station.take_off(ALT + 20.0)
    station.advance(40.0)
    assert mode(station) == entered


def test_gps_loss_lands() -> None:
    station = Station(simulation(vehicle(autopilot="px4", faults=Faults(gps_lost_at_s=40.0))))
    station.advance(5.0)
    station.arm()
    station.take_off(ALT + 20.0)
    station.advance(39.0)  # at 44 s
    assert mode(station) == HOLD
    station.advance(2.0)
    assert mode(station) == LAND
    assert station.request(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT).fix_type < 2


def test_a_parameter_of_another_type_is_echoed_unchanged() -> None:
    station = Station(simulation(px4()))
    station.advance(1.0)
    kind = mavlink.MAV_PARAM_TYPE_REAL32
    ((_, echo),) = station.send(mavlink.MAVLink_param_set_message(1, 1, b"NAV_DLL_ACT", 2.0, kind))
    assert struct.pack("<f", echo.param_value) == struct.pack("<i", 0)


def test_take_off_in_the_air_climbs_on_and_does_not_fall() -> None:
    station = up(px4())
    assert station.take_off(ALT + 30.0) == ACCEPTED
    for _ in range(20):
        station.advance(1.0)
        assert station.position()[2] > 19.0
    assert station.position()[2] == pytest.approx(30.0, abs=0.2)


def test_it_asks_for_the_time_ten_times_a_second_and_answers_whoever_asks() -> None:
    station = Station(simulation(px4()))
    station.advance(2.0)
    asked = of_type("TIMESYNC", station.advance(5.0))
    assert len(asked) == pytest.approx(50, abs=1)
    assert {message.tc1 for message in asked} == {0}
    ((_, reply),) = station.send(mavlink.MAVLink_timesync_message(0, 1234567890123))
    assert (reply.get_type(), reply.ts1) == ("TIMESYNC", 1234567890123)
    assert reply.tc1 == pytest.approx(7e9, abs=1e6)
