"""Boot, modes, arming, take-off and commands of the simulated ArduCopter, over MAVLink."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.faults import Faults
from tests.sim.flying import (
    ACCEPTED,
    BRAKE,
    DENIED,
    FAILED,
    GUIDED,
    LAND,
    LOITER,
    RTL,
    STABILIZE,
    UNSUPPORTED,
    Station,
    landed_state,
    of_type,
    simulation,
    vehicle,
)

ARM_DISARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM


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
        station = Station(simulation(vehicle(faults=Faults(refuses_arming=True))))
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
"""The vehicle of the fuzzing test, which works in any state."""
