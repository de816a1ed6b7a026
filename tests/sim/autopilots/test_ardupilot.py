"""The manners of the ardupilot personality, one by one, over MAVLink bytes."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.config import WindConfig
from tests.sim.flying import (
    ACCEPTED,
    BRAKE,
    DENIED,
    FAILED,
    GUIDED,
    LAND,
    LOITER,
    POSITION_AND_VELOCITY,
    POSITION_ONLY,
    RTL,
    STABILIZE,
    UNSUPPORTED,
    VELOCITY_ONLY,
    Station,
    of_type,
    simulation,
    vehicle,
)

ARM_DISARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
EXTENDED = mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE


def landed_state(station: Station) -> int:
    return int(station.request(EXTENDED).landed_state)


def speed(station: Station) -> float:
    return math.hypot(*station.velocity())


class TestBoot:
    """From power-up to the first messages."""

    def test_silent_and_deaf_before_power_up(self) -> None:
        station = Station(simulation(vehicle(boot_delay_s=2.0)))
        assert station.advance(1.9) == []
        assert station.command(mavlink.MAV_CMD_REQUEST_MESSAGE, 0) == []
        assert of_type("HEARTBEAT", station.advance(0.2))

    def test_only_the_heartbeat_streams_and_seldom_a_timesync(self) -> None:
        station = Station()
        messages = station.advance(29.5)
        heartbeats, requests = of_type("HEARTBEAT", messages), of_type("TIMESYNC", messages)
        assert (len(heartbeats), len(requests)) == (30, 3)
        assert len(messages) == 33
        assert all(request.tc1 == 0 for request in requests)
        heartbeat = heartbeats[-1]
        assert heartbeat.type == mavlink.MAV_TYPE_QUADROTOR
        assert heartbeat.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        assert heartbeat.custom_mode == STABILIZE
        assert heartbeat.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED


class TestModes:
    """Switching flight modes."""

    @pytest.mark.parametrize("mode", [GUIDED, LOITER, RTL, LAND, BRAKE])
    def test_a_change_is_acknowledged_and_shown_at_once(self, mode: int) -> None:
        station = Station()
        station.advance(0.5)
        replies = station.command(mavlink.MAV_CMD_DO_SET_MODE, 1, mode)
        assert [reply.get_type() for reply in replies] == ["COMMAND_ACK", "HEARTBEAT"]
        assert replies[0].result == ACCEPTED
        assert replies[1].custom_mode == mode

    def test_the_mode_it_is_in_changes_nothing(self) -> None:
        station = Station()
        station.airborne()
        station.setpoint((50.0, 0.0, 30.0))
        station.advance(2.0)
        replies = station.command(mavlink.MAV_CMD_DO_SET_MODE, 1, GUIDED)
        assert [reply.get_type() for reply in replies] == ["COMMAND_ACK"]
        station.advance(30.0)
        assert station.position()[0] == pytest.approx(50.0, abs=0.5)

    def test_unknown_modes_fail(self) -> None:
        station = Station()
        station.advance(0.5)
        assert station.mode(99) == FAILED
        assert station.result(mavlink.MAV_CMD_DO_SET_MODE, 1, math.nan) == FAILED
        assert station.result(mavlink.MAV_CMD_DO_SET_MODE, 0, GUIDED) == DENIED
        assert station.heartbeat().custom_mode == STABILIZE

    def test_legacy_set_mode_is_not_acknowledged(self) -> None:
        station = Station()
        station.advance(0.5)
        replies = station.send(mavlink.MAVLink_set_mode_message(1, 1, GUIDED))
        assert [reply.get_type() for _, reply in replies] == ["HEARTBEAT"]
        assert replies[0][1].custom_mode == GUIDED

    def test_mav_cmd_nav_land_and_return(self) -> None:
        station = Station()
        station.advance(0.5)
        assert station.result(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
        assert station.heartbeat().custom_mode == LAND
        assert station.result(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == ACCEPTED
        assert station.heartbeat().custom_mode == RTL


class TestArming:
    """Arming and disarming."""

    def test_refused_before_there_is_a_position(self) -> None:
        station = Station()
        station.advance(3.9)
        assert station.mode(GUIDED) == ACCEPTED
        text, ack = station.command(ARM_DISARM, 1)
        assert text.text == "Arm: Need Position Estimate"
        assert ack.result == FAILED
        assert not station.armed()
        station.advance(0.2)
        assert station.arm() == ACCEPTED
        assert station.armed()

    def test_refused_by_the_fault(self) -> None:
        station = Station(simulation(vehicle(refuses_arming=True)))
        station.advance(60.0)
        text, ack = station.command(ARM_DISARM, 1)
        assert text.text.startswith("Arm: ")
        assert ack.result == FAILED
        assert not station.armed()

    @pytest.mark.parametrize("mode", [RTL, LAND, BRAKE])
    def test_refused_in_modes_that_do_not_arm(self, mode: int) -> None:
        station = Station()
        station.advance(5.0)
        station.mode(mode)
        text, ack = station.command(ARM_DISARM, 1)
        assert text.text.endswith("mode not armable")
        assert ack.result == FAILED

    def test_neither_arm_nor_disarm_is_unsupported(self) -> None:
        station = Station()
        station.advance(5.0)
        assert station.result(ARM_DISARM, 2) == UNSUPPORTED

    def test_disarms_by_itself_when_left_on_the_ground(self) -> None:
        station = Station()
        station.advance(5.0)
        station.mode(GUIDED)
        station.arm()
        station.advance(9.9)
        assert station.armed()
        station.advance(0.2)
        assert not station.armed()

    def test_disarm_on_the_ground_but_in_the_air_only_by_force(self) -> None:
        station = Station()
        station.advance(5.0)
        station.mode(GUIDED)
        station.arm()
        assert station.result(ARM_DISARM, 0) == ACCEPTED
        assert not station.armed()
        station.airborne(20.0)
        assert station.result(ARM_DISARM, 0) == FAILED
        assert station.armed()
        assert station.result(ARM_DISARM, 0, 21196) == ACCEPTED
        station.advance(4.0)
        assert station.position()[2] == pytest.approx(0.0, abs=0.01)
        assert landed_state(station) == mavlink.MAV_LANDED_STATE_ON_GROUND


class TestTakeOff:
    """MAV_CMD_NAV_TAKEOFF."""

    def test_fails_disarmed_in_another_mode_and_airborne(self) -> None:
        station = Station()
        station.advance(5.0)
        station.mode(GUIDED)
        assert station.take_off(10.0) == FAILED
        station.mode(STABILIZE)
        station.arm()
        assert station.take_off(10.0) == FAILED
        station.mode(GUIDED)
        assert station.take_off(-1.0) == FAILED
        assert station.take_off(math.nan) == FAILED
        assert station.take_off(10.0) == ACCEPTED
        station.advance(15.0)
        assert station.take_off(20.0) == FAILED

    def test_timeline(self) -> None:
        station = Station()
        station.advance(5.0)
        station.mode(GUIDED)
        station.arm()
        station.take_off(15.0)
        station.advance(2.9)
        assert landed_state(station) == mavlink.MAV_LANDED_STATE_ON_GROUND
        station.advance(0.5)
        assert landed_state(station) == mavlink.MAV_LANDED_STATE_TAKEOFF
        station.advance(8.0)
        assert landed_state(station) == mavlink.MAV_LANDED_STATE_IN_AIR
        station.advance(5.0)
        assert station.position() == pytest.approx((0.0, 0.0, 15.0), abs=0.05)

    def test_a_setpoint_replaces_it(self) -> None:
        station = Station()
        station.advance(5.0)
        station.mode(GUIDED)
        station.arm()
        station.take_off(50.0)
        station.advance(5.0)
        assert 2.0 < station.position()[2] < 10.0
        station.setpoint((10.0, 0.0, 12.0))
        station.advance(20.0)
        assert station.position() == pytest.approx((10.0, 0.0, 12.0), abs=0.05)

    def test_command_int_wants_an_altitude_above_home(self) -> None:
        def result(frame: int) -> int:
            message = mavlink.MAVLink_command_int_message(
                1, 1, frame, mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 0, 0, 10.0
            )
            ((_, ack),) = station.send(message)
            return int(ack.result)

        station = Station()
        station.advance(5.0)
        station.mode(GUIDED)
        station.arm()
        assert result(mavlink.MAV_FRAME_GLOBAL_INT) == DENIED
        assert result(mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT) == ACCEPTED
        station.advance(15.0)
        assert station.position()[2] == pytest.approx(10.0, abs=0.1)

    def test_a_setpoint_alone_lifts_nothing(self) -> None:
        station = Station()
        station.advance(5.0)
        station.mode(GUIDED)
        station.arm()
        station.setpoint((0.0, 0.0, 30.0))
        station.advance(5.0)
        assert station.position()[2] == 0.0


class TestCommands:
    """Commands and telemetry on request."""

    def test_unknown_ones_are_unsupported(self) -> None:
        station = Station()
        station.advance(0.1)
        assert station.result(31000) == UNSUPPORTED
        assert station.result(mavlink.MAV_CMD_DO_REPOSITION) == UNSUPPORTED

    def test_the_acknowledgement_names_who_asked(self) -> None:
        station = Station()
        station.advance(0.1)
        (ack,) = of_type("COMMAND_ACK", station.command(31000))
        assert (ack.target_system, ack.target_component) == (77, 190)

    def test_another_target_is_met_with_silence(self) -> None:
        station = Station()
        station.advance(5.0)
        assert station.command(ARM_DISARM, 1, target=9) == []
        assert not station.armed()
        message = mavlink.MAVLink_command_long_message(1, 154, ARM_DISARM, 0, 1, *([0] * 6))
        assert station.send(message) == []
        assert not station.armed()
        # Target 0 is everyone.
        message = mavlink.MAVLink_command_long_message(0, 0, ARM_DISARM, 0, 1, *([0] * 6))
        assert of_type("COMMAND_ACK", station.send(message))
        assert station.armed()

    def test_intervals(self) -> None:
        station = Station()
        station.advance(3.0)
        attitude = mavlink.MAVLINK_MSG_ID_ATTITUDE
        interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        assert station.stream(attitude, 25.0) == ACCEPTED
        assert len(of_type("ATTITUDE", station.advance(4.0))) == 100
        assert station.result(interval, attitude, -1) == ACCEPTED
        assert of_type("ATTITUDE", station.advance(4.0)) == []
        assert station.result(interval, attitude, 0) == ACCEPTED
        assert of_type("ATTITUDE", station.advance(4.0)) == []
        assert station.stream(65000, 1.0) == DENIED
        assert station.result(interval, math.nan, 1e6) == DENIED
        assert station.result(interval, attitude, math.nan) == DENIED

    def test_requesting_an_unknown_message_fails(self) -> None:
        station = Station()
        station.advance(0.1)
        assert station.result(mavlink.MAV_CMD_REQUEST_MESSAGE, 65000) == FAILED

    def test_timesync_is_answered_once(self) -> None:
        station = Station(simulation(vehicle(boot_delay_s=1.0)))
        station.advance(3.05)
        ((_, reply),) = station.send(mavlink.MAVLink_timesync_message(0, 1234567890123))
        assert reply.ts1 == 1234567890123
        assert reply.tc1 == pytest.approx(2.05e9, abs=10)
        assert station.send(mavlink.MAVLink_timesync_message(reply.tc1, reply.ts1)) == []

    @given(
        st.integers(0, 65535) | st.sampled_from([20, 21, 22, 176, 400, 511, 512]),
        st.lists(
            st.floats(width=32) | st.sampled_from([0.0, 1.0, 30.0, 4.0]), min_size=7, max_size=7
        ),
    )
    @settings(max_examples=300, deadline=None)
    def test_any_command_gets_exactly_one_answer(self, command: int, params: list[float]) -> None:
        assert len(of_type("COMMAND_ACK", AIRBORNE.command(command, *params))) == 1
        AIRBORNE.advance(0.04)


AIRBORNE = Station()
"""Shared by the fuzzing test, which cares for no state."""


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
