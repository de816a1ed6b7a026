"""Bring a vehicle of either autopilot into the air, for the tests that begin there."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.conformance.harness import ACCEPTED, Vehicle, of, only

GUIDED, LOITER, RTL, LAND, BRAKE = 4, 5, 6, 9, 17
PX4_POSCTL, PX4_HOLD = 3 << 16, 4 << 16 | 3 << 24
PX4_LAND, PX4_RTL, PX4_OFFBOARD = 4 << 16 | 6 << 24, 4 << 16 | 5 << 24, 6 << 16
SET_MODE: int = mavlink.MAV_CMD_DO_SET_MODE
TAKE_OFF: int = mavlink.MAV_CMD_NAV_TAKEOFF
POSITION_ONLY = only(0b111)
"""Type mask of a position alone."""


def watch(vehicle: Vehicle, rate_hz: float = 50.0) -> None:
    """Ask for the messages that tests in the air look at; positions count from here."""
    vehicle.stream(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, rate_hz)
    vehicle.stream(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, rate_hz)
    vehicle.stand()


def airborne_ardupilot(vehicle: Vehicle, height_m: float = 30.0) -> None:
    """Bring an ArduCopter up to a height in GUIDED."""
    watch(vehicle)
    assert vehicle.result(SET_MODE, 1, GUIDED) == ACCEPTED
    assert vehicle.arm() == ACCEPTED
    vehicle.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    assert vehicle.result(TAKE_OFF, 0, 0, 0, 0, 0, 0, height_m) == ACCEPTED
    rise(vehicle, height_m)


def airborne_px4(vehicle: Vehicle, height_m: float = 20.0) -> None:
    """Bring a PX4 up to a height, where it holds."""
    watch(vehicle)
    assert vehicle.result(SET_MODE, 1, 4, 3) == ACCEPTED
    assert vehicle.arm() == ACCEPTED
    home = vehicle.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    amsl = home.altitude * 1e-3 + height_m
    assert vehicle.result(TAKE_OFF, 0, 0, 0, 0, 0, 0, amsl) == ACCEPTED
    rise(vehicle, height_m)
    vehicle.until(of("HEARTBEAT", custom_mode=PX4_HOLD), 20.0)


def rise(vehicle: Vehicle, height_m: float) -> None:
    """Wait until it is up."""
    vehicle.until(lambda m: of("LOCAL_POSITION_NED")(m) and -m.z > height_m - 0.7, 20.0 + height_m)
    vehicle.wait(3.0)
