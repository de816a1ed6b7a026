"""Who gets which frame when other ground stations listen in."""

from __future__ import annotations

import pytest

from swarmctl.link.address import Address
from swarmctl.link.codec.framing import split
from swarmctl.link.codec.messages import Frame
from swarmctl.link.forwarding import Forwarder
from tests.link.wire import Sender

US = 245
QGC, OTHER = Address("qgc", 14550, 1), Address("tablet", 14550, 2)
AT_1, AT_2 = Address("10.0.0.1", 14550), Address("10.0.0.2", 14550)


def frame(raw: bytes) -> Frame:
    (found,), _ = split(raw)
    return found


@pytest.fixture
def forwarder() -> Forwarder:
    """Two stations and two vehicles that have heard of each other."""
    made = Forwarder(US, [QGC, OTHER])
    made.from_vehicles(frame(Sender(1).heartbeat()), AT_1)
    made.from_vehicles(frame(Sender(2).heartbeat()), AT_2)
    made.from_station(frame(Sender(255, compid=190).heartbeat()), QGC)
    made.from_station(frame(Sender(254, compid=190).heartbeat()), OTHER)
    return made


def test_what_vehicles_say_to_everybody_goes_to_every_station(forwarder: Forwarder) -> None:
    for raw in (Sender(1).heartbeat(), Sender(1).pack("GLOBAL_POSITION_INT", lat=1)):
        assert forwarder.from_vehicles(frame(raw), AT_1) == [QGC, OTHER]


def test_stations_are_told_before_they_have_said_a_word() -> None:
    forwarder = Forwarder(US, [QGC])
    assert forwarder.from_vehicles(frame(Sender(1).heartbeat()), AT_1) == [QGC]


def test_an_answer_goes_to_the_station_that_asked_and_to_no_other(forwarder: Forwarder) -> None:
    vehicle = Sender(1)
    for target, stations in ((255, [QGC]), (254, [OTHER]), (US, []), (0, [QGC, OTHER])):
        ack = vehicle.pack("COMMAND_ACK", command=400, target_system=target)
        assert forwarder.from_vehicles(frame(ack), AT_1) == stations


def test_a_station_reaches_the_vehicle_it_names_and_all_when_it_names_none(
    forwarder: Forwarder,
) -> None:
    station = Sender(255, compid=190)
    arm = station.pack("COMMAND_LONG", command=400, target_system=2, target_component=1)
    assert forwarder.from_station(frame(arm), QGC) == [AT_2]
    assert forwarder.from_station(frame(station.heartbeat()), QGC) == [AT_1, AT_2]
    for nobody in (77, US):
        lost = station.pack("COMMAND_LONG", command=400, target_system=nobody)
        assert forwarder.from_station(frame(lost), QGC) == []


def test_mavlink_1_and_unknown_messages_are_passed_on_too(forwarder: Forwarder) -> None:
    set_mode = Sender(255).pack_v1("SET_MODE", target_system=2, custom_mode=4)
    assert forwarder.from_station(frame(set_mode), QGC) == [AT_2]
    raw = b"\xfd\x02\x00\x00\x00\x01\x01\x50\xc3\x00ab\x12\x34"  # message 50000 of a vehicle
    assert forwarder.from_vehicles(frame(raw), AT_1) == [QGC, OTHER]


def test_a_vehicle_that_moves_is_reached_where_it_is(forwarder: Forwarder) -> None:
    forwarder.from_vehicles(frame(Sender(1).heartbeat()), AT_2)
    arm = Sender(255).pack("COMMAND_LONG", command=400, target_system=1)
    assert forwarder.from_station(frame(arm), QGC) == [AT_2]


def test_nothing_goes_back_to_where_its_sender_was_heard(forwarder: Forwarder) -> None:
    """A router on the vehicles' side that repeats QGroundControl's frames makes no echo."""
    echo = Sender(255, compid=190).heartbeat()
    assert forwarder.from_vehicles(frame(echo), AT_1) == [OTHER]
    # Nor is the station taken for a vehicle there.
    to_qgc = Sender(254).pack("COMMAND_LONG", command=400, target_system=255)
    assert forwarder.from_station(frame(to_qgc), OTHER) == []


def test_a_vehicles_frames_that_come_back_from_a_station_are_a_loop(
    forwarder: Forwarder,
) -> None:
    assert forwarder.from_station(frame(Sender(1).heartbeat()), QGC) == "loop"


def test_our_own_system_id_is_passed_on_in_neither_direction(forwarder: Forwarder) -> None:
    ours = frame(Sender(US, compid=190).heartbeat())
    assert forwarder.from_vehicles(ours, AT_1) == []
    assert forwarder.from_station(ours, QGC) == "our_sysid"
