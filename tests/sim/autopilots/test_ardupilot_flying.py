"""How the simulated ArduCopter flies: setpoints in GUIDED, landing, returning, braking."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.config import WindConfig
from tests.sim.flying import (
    BRAKE,
    LAND,
    LOITER,
    POSITION_AND_VELOCITY,
    POSITION_ONLY,
    RTL,
    STABILIZE,
    VELOCITY_ONLY,
    Station,
    landed_state,
    simulation,
    vehicle,
)


def speed(station: Station) -> float:
    return math.hypot(*station.velocity())


class TestGuided:
    """Setpoints in GUIDED."""

    @pytest.mark.parametrize("rate_hz", [10.0, 1.0])
    def test_a_moving_setpoint_with_velocity_is_followed_closely(self, rate_hz: float) -> None:
        lags = follow(POSITION_AND_VELOCITY, rate_hz)
        assert min(lags) > 0.03
        assert max(lags) < 0.15

    def test_a_moving_setpoint_without_velocity_is_followed_far_behind(self) -> None:
        lags = follow(POSITION_ONLY, 10.0)
        assert sum(lags) / len(lags) == pytest.approx(7.2, abs=0.4)

    def test_a_position_is_held_for_ever(self) -> None:
        station = Station()
        station.airborne()
        station.setpoint((40.0, -30.0, 25.0), mask=POSITION_ONLY)
        station.advance(300.0)
        assert station.position() == pytest.approx((40.0, -30.0, 25.0), abs=0.05)

    def test_the_velocity_of_a_position_setpoint_times_out(self) -> None:
        station = Station()
        station.airborne()
        for k in range(9):
            station.setpoint((4.0 * k, 0.0, 30.0), (4.0, 0.0, 0.0))
            station.advance(1.0)
        station.advance(1.9)  # 2.9 s after the last
        assert station.velocity()[0] == pytest.approx(4.0, abs=0.1)
        station.advance(30.0)
        # From 32 m it moved on for three seconds and is held there.
        assert station.position() == pytest.approx((44.0, 0.0, 30.0), abs=0.05)

    def test_a_velocity_is_flown_until_it_times_out(self) -> None:
        station = Station()
        station.airborne()
        for _ in range(8):
            station.setpoint(velocity_enu=(3.0, 4.0, 0.0), mask=VELOCITY_ONLY)
            station.advance(1.0)
        assert station.velocity() == pytest.approx((3.0, 4.0, 0.0), abs=0.1)
        station.advance(1.9)  # 2.9 s after the last
        assert speed(station) == pytest.approx(5.0, abs=0.1)
        station.advance(0.8)
        assert speed(station) < 4.0
        station.advance(5.0)
        assert speed(station) < 0.01
        held = station.position()
        station.advance(60.0)
        assert station.position() == pytest.approx(held, abs=0.05)

    def test_a_senseless_setpoint_stops_it(self) -> None:
        station = Station()
        station.airborne()
        station.setpoint((500.0, 0.0, 30.0))
        station.advance(5.0)
        assert speed(station) > 5.0
        station.setpoint((500.0, 0.0, 30.0), mask=0b111111111111)
        station.advance(10.0)
        assert speed(station) < 0.05

    @pytest.mark.parametrize("mode", [BRAKE, LOITER])
    def test_setpoints_are_ignored_in_other_modes(self, mode: int) -> None:
        station = Station()
        station.airborne()
        station.mode(mode)
        station.setpoint((100.0, 0.0, 30.0))
        station.advance(5.0)
        assert math.hypot(*station.position()[:2]) < 0.1

    def test_altitudes_above_home(self) -> None:
        station = Station()
        station.airborne()
        # The helper's altitude, 400 m + up, goes out as metres above home.
        station.setpoint(
            (0.0, 0.0, -380.0), mask=POSITION_ONLY, frame=mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        )
        station.advance(20.0)
        assert station.position()[2] == pytest.approx(20.0, abs=0.05)

    def test_local_ned_counts_from_where_it_booted(self) -> None:
        station = Station(simulation(vehicle(1), vehicle(2, 100.0)))
        station.airborne(sysids=(2,))
        station.send(local_setpoint(2, (10.0, 20.0, -25.0)), 2)
        station.advance(30.0)
        assert station.position(2) == pytest.approx((120.0, 10.0, 25.0), abs=0.3)

    def test_yaw_is_turned_to(self) -> None:
        station = Station()
        station.airborne()
        station.send(local_setpoint(1, (0.0, 0.0, -30.0), yaw_rad=-1.5))
        station.advance(0.5)
        turning = station.request(mavlink.MAVLINK_MSG_ID_ATTITUDE).yaw
        assert turning == pytest.approx(-math.pi / 4.0, abs=0.05)
        station.advance(2.0)
        assert station.request(mavlink.MAVLINK_MSG_ID_ATTITUDE).yaw == pytest.approx(-1.5)
        heading = station.request(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT).hdg
        assert heading == pytest.approx(36000.0 - math.degrees(1.5) * 100.0, abs=1.0)


def local_setpoint(
    sysid: int, position_ned: tuple[float, float, float], yaw_rad: float | None = None
) -> Any:  # noqa: ANN401 - pymavlink is untyped
    mask = POSITION_ONLY if yaw_rad is None else POSITION_ONLY & ~(1 << 10)
    zeros = [0.0] * 6
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, sysid, 1, mavlink.MAV_FRAME_LOCAL_NED, mask, *position_ned, *zeros, yaw_rad or 0.0, 0.0
    )


def follow(mask: int, rate_hz: float) -> list[float]:
    """Lags (m) behind a setpoint that has moved east at 4 m/s for 30 s, over 10 s more."""
    station = Station()
    station.airborne()
    start, lags = station.world.time_s, []
    for k in range(round(40.0 * rate_hz)):
        station.setpoint((4.0 * k / rate_hz, 0.0, 30.0), (4.0, 0.0, 0.0), mask)
        for _ in range(10):
            station.advance(0.1 / rate_hz)
            elapsed = station.world.time_s - start
            # Compared on whole steps, where the true position is as of now.
            if elapsed > 30.0 and abs(elapsed * 50.0 - round(elapsed * 50.0)) < 1e-6:
                lags.append(4.0 * elapsed - station.position()[0])
    return lags


class TestEndings:
    """Landing, returning, braking, sinking."""

    def test_land_where_it_is(self) -> None:
        station = Station()
        station.airborne(30.0)
        station.setpoint((20.0, 5.0, 30.0))
        station.advance(15.0)
        station.mode(LAND)
        station.advance(5.0)
        assert landed_state(station) == mavlink.MAV_LANDED_STATE_LANDING
        assert station.velocity()[2] == pytest.approx(-1.5, abs=0.1)
        while station.position()[2] > 5.0:
            station.advance(0.5)
        assert 0.4 < -station.velocity()[2] < 1.0
        station.advance(15.0)
        assert station.position() == pytest.approx((20.0, 5.0, 0.0), abs=0.1)
        assert landed_state(station) == mavlink.MAV_LANDED_STATE_ON_GROUND
        assert not station.armed()

    def test_wind_does_not_carry_a_landing_away(self) -> None:
        station = Station(simulation(wind=WindConfig((8.0, 0.0, 0.0))))
        station.airborne(20.0)
        station.mode(LAND)
        station.advance(40.0)
        assert not station.armed()
        assert math.hypot(*station.position()[:2]) < 0.5

    def test_return_climbs_flies_home_lands_and_disarms(self) -> None:
        station = Station()
        station.airborne(6.0)
        station.setpoint((60.0, 40.0, 6.0))
        station.advance(30.0)
        station.mode(RTL)
        track = []
        while station.armed():
            station.advance(0.5)
            track.append(station.position())
        # First up, then home level, then down.
        away = [up for east, north, up in track if math.hypot(east, north) > 60.0]
        assert max(away) > 14.0
        level = [up for east, north, up in track if 5.0 < math.hypot(east, north) < 60.0]
        assert min(level) > 14.0
        assert track[-1] == pytest.approx((0.0, 0.0, 0.0), abs=0.3)

    def test_return_from_above_stays_above(self) -> None:
        station = Station()
        station.airborne(40.0)
        station.setpoint((80.0, 0.0, 40.0))
        station.advance(30.0)
        station.mode(RTL)
        while station.position()[0] > 5.0:
            station.advance(0.5)
            assert station.position()[2] == pytest.approx(40.0, abs=0.2)

    def test_brake_stops_and_holds(self) -> None:
        station = Station()
        station.airborne()
        station.setpoint(velocity_enu=(8.0, 0.0, 0.0), mask=VELOCITY_ONLY)
        station.advance(3.0)
        fast_at = station.position()[0]
        station.mode(BRAKE)
        station.advance(30.0)
        assert speed(station) < 0.01
        assert 8.0 < station.position()[0] - fast_at < 16.0
        assert station.position()[2] == pytest.approx(30.0, abs=0.1)

    @pytest.mark.parametrize("mode", [LOITER, STABILIZE])
    def test_a_mode_that_waits_for_a_pilot_sinks_to_the_ground(self, mode: int) -> None:
        station = Station()
        station.airborne(30.0)
        station.mode(mode)
        station.advance(5.0)
        assert 15.0 < station.position()[2] < 22.0
        assert landed_state(station) == mavlink.MAV_LANDED_STATE_IN_AIR
        station.advance(10.0)
        assert station.position()[2] == 0.0
        assert station.armed()
        station.advance(11.0)
        assert not station.armed()

    def test_it_can_fly_again(self) -> None:
        station = Station()
        station.airborne(10.0)
        station.mode(LAND)
        station.advance(40.0)
        assert not station.armed()
        station.airborne(10.0)
        assert station.position()[2] == pytest.approx(10.0, abs=0.1)
