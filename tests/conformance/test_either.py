"""Rows that hold for both: what MAVSDK and any ground station count on."""

from __future__ import annotations

import itertools

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.conformance.harness import ACCEPTED, Vehicle, count, of


def test_it_says_who_it_is_when_asked_in_either_way(either: Vehicle) -> None:
    version = either.request(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    assert version.uid != 0 or any(version.uid2)
    assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    assert either.result(mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1) == ACCEPTED
    assert count("AUTOPILOT_VERSION", either.wait(0.5)) == 1


def test_an_armable_vehicle_has_its_sensors_its_prearm_bit_and_a_home(either: Vehicle) -> None:
    either.stream(mavlink.MAVLINK_MSG_ID_SYS_STATUS, 2.0)
    prearm, gps = mavlink.MAV_SYS_STATUS_PREARM_CHECK, mavlink.MAV_SYS_STATUS_SENSOR_GPS
    samples = [m for _, m in either.wait(3.0) if of("SYS_STATUS")(m)]
    assert len(samples) >= 2
    for status in samples[-2:]:
        assert status.onboard_control_sensors_health & prearm
        assert status.onboard_control_sensors_health & gps
    assert either.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION).latitude != 0


def test_timesync_is_answered_with_its_boot_clock(either: Vehicle) -> None:
    replies = []
    for stamp in (111, 222):
        either.send(mavlink.MAVLink_timesync_message(0, stamp))
        _, reply = either.until(of("TIMESYNC", ts1=stamp), 2.0)
        replies.append(reply.tc1)
        either.wait(2.0)
    assert (replies[1] - replies[0]) * 1e-9 == pytest.approx(2.0, abs=0.2)


def test_a_parameter_can_be_read_by_index(either: Vehicle) -> None:
    either.send(mavlink.MAVLink_param_request_read_message(either.sysid, 1, b"", 3))
    by_index = either.until(of("PARAM_VALUE"), 2.0)[1]
    assert by_index.param_index == 3
    assert either.parameter(by_index.param_id).param_index == 3


def test_each_message_counts_its_sequence_on(either: Vehicle) -> None:
    numbers = [m.get_seq() for _, m in either.wait(5.0)]
    assert all((b - a) % 256 == 1 for a, b in itertools.pairwise(numbers))
