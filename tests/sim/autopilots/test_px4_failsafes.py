"""The failsafes of the simulated PX4 by their parameters, over MAVLink bytes."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.faults import Faults
from tests.sim.autopilots.flying_px4 import HOLD, LAND, OFFBOARD, POSCTL, RTL, mode, px4, stream, up
from tests.sim.flying import ACCEPTED, ALT, Station, of_type, simulation, vehicle


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
