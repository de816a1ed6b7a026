"""Parameters, take-off and time of the simulated PX4, over MAVLink bytes."""

from __future__ import annotations

import struct

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.sim.autopilots.flying_px4 import px4, up
from tests.sim.flying import ACCEPTED, ALT, Station, of_type, simulation


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
