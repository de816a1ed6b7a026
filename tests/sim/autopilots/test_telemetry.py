"""What the messages say, against the truth."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilots.telemetry import lean
from sim.config import NavigationConfig, WindConfig
from sim.dynamics import GRAVITY_MPS2
from sim.faults import Faults
from tests.sim.flying import (
    ALT,
    BRAKE,
    GUIDED,
    LAT,
    LON,
    VELOCITY_ONLY,
    Station,
    of_type,
    simulation,
    vehicle,
)

PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK


def test_before_the_fix_nothing_pretends_to_know_a_position() -> None:
    station = Station()
    station.advance(0.5)
    position = station.request(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    assert (position.lat, position.lon) == (0, 0)
    gps = station.request(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT)
    assert gps.fix_type < mavlink.GPS_FIX_TYPE_2D_FIX
    assert gps.satellites_visible == 0
    assert station.request(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME).time_unix_usec == 0
    # As ArduCopter does, accepted, but there is nothing to send yet.
    replies = station.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    assert [reply.get_type() for reply in replies] == ["COMMAND_ACK"]


def test_position_velocity_and_altitudes_of_global_position_int() -> None:
    station = Station()
    station.airborne(30.0)
    station.setpoint(velocity_enu=(3.0, -4.0, 1.0), mask=VELOCITY_ONLY)
    station.advance(2.5)
    message = station.request(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    lat, lon, alt = station.world.frame.to_geodetic(*station.position())
    assert message.lat == pytest.approx(math.degrees(lat) * 1e7, abs=0.51)
    assert message.lon == pytest.approx(math.degrees(lon) * 1e7, abs=0.51)
    assert message.alt == pytest.approx(alt * 1e3, abs=0.51)
    assert message.relative_alt == pytest.approx((alt - ALT) * 1e3, abs=1.0)
    east, north, up = station.velocity()
    assert (message.vx, message.vy) == (round(100.0 * north), round(100.0 * east))
    assert message.vz == round(-100.0 * up)
    assert min(-message.vx, message.vy, -message.vz) > 90
    assert message.time_boot_ms == round(station.world.time_s * 1e3)


def test_reports_scatter_by_the_navigation_error() -> None:
    station = Station(simulation(navigation=NavigationConfig(white_sigma_m=1.0)))
    station.stream(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 10.0)
    altitudes = [
        message.alt / 1e3 - ALT
        for message in of_type("GLOBAL_POSITION_INT", station.advance(100.0))
        if message.lat != 0
    ]
    mean_square = sum(altitude**2 for altitude in altitudes) / len(altitudes)
    # 980 independent reports: chi-squared / n stays within 1 ± 4.5 sqrt(2 / n).
    assert mean_square == pytest.approx(1.0, abs=4.5 * math.sqrt(2.0 / len(altitudes)))


def test_the_vehicle_flies_the_correlated_error() -> None:
    navigation = NavigationConfig(white_sigma_m=0.0, correlated_sigma_m=5.0, correlated_tau_s=1e6)
    station = Station(simulation(navigation=navigation))
    station.airborne(30.0)
    station.setpoint((20.0, 10.0, 30.0))
    station.advance(20.0)
    message = station.request(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    reported = station.world.frame.to_enu(
        math.radians(message.lat * 1e-7), math.radians(message.lon * 1e-7), message.alt * 1e-3
    )
    assert reported == pytest.approx((20.0, 10.0, 30.0), abs=0.05)
    assert math.dist(station.position(), (20.0, 10.0, 30.0)) > 1.0


def test_attitude_leans_the_way_it_accelerates() -> None:
    station = Station()
    station.airborne(30.0)
    station.setpoint(velocity_enu=(0.0, 5.0, 0.0), mask=VELOCITY_ONLY)
    station.advance(0.5)
    north = station.request(mavlink.MAVLINK_MSG_ID_ATTITUDE)
    assert north.pitch == pytest.approx(-math.atan(3.0 / GRAVITY_MPS2), abs=0.06)
    assert north.roll == pytest.approx(0.0, abs=1e-3)
    station.advance(10.0)
    station.setpoint(velocity_enu=(5.0, 0.0, 0.0), mask=VELOCITY_ONLY)
    station.advance(0.5)
    east = station.request(mavlink.MAVLINK_MSG_ID_ATTITUDE)
    assert east.roll == pytest.approx(math.atan(3.0 / GRAVITY_MPS2), abs=0.06)
    assert east.pitch == pytest.approx(0.0, abs=1e-3)


def test_attitude_leans_into_the_wind() -> None:
    station = Station(simulation(wind=WindConfig((0.0, 10.0, 0.0))))
    station.airborne(30.0)
    hover = station.request(mavlink.MAVLINK_MSG_ID_ATTITUDE)
    assert hover.pitch == pytest.approx(math.atan(3.0 / GRAVITY_MPS2), abs=0.01)  # nose up


angles = st.floats(-1.2, 1.2)


@given(angles, angles, st.floats(-3.1, 3.1))
def test_lean_inverts_the_rotation_of_the_airframe(roll: float, pitch: float, yaw: float) -> None:
    # Rz(yaw) Ry(pitch) Rx(roll) applied to "up" (0, 0, -1) of north-east-down, by hand.
    x, y, z = 0.0, math.sin(roll), -math.cos(roll)
    x, z = x * math.cos(pitch) + z * math.sin(pitch), z * math.cos(pitch) - x * math.sin(pitch)
    north = x * math.cos(yaw) - y * math.sin(yaw)
    east = x * math.sin(yaw) + y * math.cos(yaw)
    assert lean((9.0 * east, 9.0 * north, -9.0 * z), yaw) == pytest.approx((roll, pitch))


def test_system_time_pairs_utc_and_time_since_power_up() -> None:
    station = Station(simulation(vehicle(boot_delay_s=3.3)))
    station.advance(10.0)
    message = station.request(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME)
    assert message.time_boot_ms == 6700
    assert message.time_unix_usec == pytest.approx(station.world.utc_s * 1e6, abs=1.0)


def test_home_position_is_where_it_was_armed() -> None:
    station = Station()
    station.airborne(30.0)
    home = station.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    assert home.latitude == pytest.approx(math.degrees(LAT) * 1e7, abs=1.0)
    assert home.longitude == pytest.approx(math.degrees(LON) * 1e7, abs=1.0)
    assert home.altitude == pytest.approx(ALT * 1e3, abs=1.0)


def test_prearm_bit_depends_on_boot_mode_and_fault() -> None:
    def prearm(station: Station) -> bool:
        status = station.request(mavlink.MAVLINK_MSG_ID_SYS_STATUS)
        assert status.onboard_control_sensors_present & PREARM
        assert status.onboard_control_sensors_enabled & PREARM
        return bool(status.onboard_control_sensors_health & PREARM)

    station = Station()
    station.advance(3.5)
    assert not prearm(station)
    station.advance(1.0)
    assert prearm(station)
    station.mode(BRAKE)
    assert not prearm(station)
    station.mode(GUIDED)
    assert prearm(station)
    faulty = Station(simulation(vehicle(faults=Faults(refuses_arming=True))))
    faulty.advance(5.0)
    assert prearm(faulty)


def test_the_battery_drains_when_armed() -> None:
    station = Station()
    station.airborne(30.0)
    before = station.request(mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    station.advance(180.0)
    after = station.request(mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    # A tenth of half an hour's endurance.
    assert before.battery_remaining - after.battery_remaining in {9, 10, 11}
    assert after.voltage_battery < before.voltage_battery


def test_every_vehicle_has_a_hardware_uid_of_its_own() -> None:
    station = Station(simulation(vehicle(1), vehicle(2, 10.0)))
    station.advance(0.1)
    versions = [station.request(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION, i) for i in (1, 2)]
    assert versions[0].uid != versions[1].uid
    assert versions[0].flight_sw_version >> 16 == 0x0407
