"""Who is a vehicle of the swarm, and where it is."""

from __future__ import annotations

import math
from typing import Any

import pytest

from swarmctl.commands import Arm
from swarmctl.events import CommandOutcome, Heartbeat, InputRejected, Mode
from tests.link.bench import AT_1, AT_2, ELSEWHERE, GCS, Bench, Vehicle, goto
from tests.link.wire import Sender, unpack

# --- Vehicles --------------------------------------------------------------------------


def test_a_quiet_link_needs_no_timer(bench: Bench) -> None:
    assert bench.link.next_timer() == math.inf
    assert bench.link.addresses == {}


def test_the_first_heartbeat_makes_a_vehicle(bench: Bench) -> None:
    bench.receive(Vehicle(1).heartbeat(mode=4, armed=True))
    assert bench.heard == [
        Heartbeat(
            received_s=50.0,
            sysid=1,
            autopilot="ardupilot",
            is_multirotor=True,
            mode=Mode.GUIDED,
            mode_name="GUIDED",
            armed=True,
        )
    ]
    assert bench.link.addresses == {1: AT_1}


def test_telemetry_before_the_first_heartbeat_is_not_used(bench: Bench) -> None:
    bench.receive(Vehicle(1).pack("GLOBAL_POSITION_INT", lat=1, lon=1))
    assert bench.heard == []
    assert bench.link.addresses == {}


def test_other_components_and_ground_stations_make_no_vehicle() -> None:
    bench = Bench(None)
    bench.receive(Sender(1, compid=154).heartbeat())
    bench.receive(Sender(255, compid=190).heartbeat(type=6, autopilot=8))
    bench.receive(Sender(254, compid=1).heartbeat(type=6, autopilot=8))
    bench.receive(Sender(GCS, compid=1).heartbeat())
    assert bench.heard == []
    assert bench.link.addresses == {}
    assert bench.link.messages_in == 4


def test_other_components_of_a_vehicle_are_not_its_autopilot(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, _, _ = two
    gimbal = Sender(1, compid=154)
    bench.receive(gimbal.heartbeat(mode=9), AT_1)
    bench.receive(gimbal.pack("GLOBAL_POSITION_INT", lat=1, lon=1), AT_1)
    bench.receive(Sender(1).heartbeat(type=6, autopilot=8), AT_1)
    assert bench.heard == []


def test_unexpected_vehicles_are_named_once_and_not_used(bench: Bench) -> None:
    stranger = Vehicle(77)
    for _ in range(3):
        bench.receive(stranger.state(), ELSEWHERE)
        bench.receive(stranger.pack("GLOBAL_POSITION_INT", lat=1, lon=1), ELSEWHERE)
    assert bench.heard == [
        InputRejected(
            received_s=50.0,
            source="mavlink",
            kind="unexpected_vehicle",
            detail="System id 77 at 10.0.0.9:40000 is no vehicle of this mission: give it an id "
            "of the mission's, or keep it off this port.",
        )
    ]
    assert bench.link.rejected == {"unexpected_vehicle": 3}
    assert bench.link.addresses == {}


def test_without_a_list_any_vehicle_is_used_but_the_broadcast_id() -> None:
    bench = Bench(None)
    bench.receive(Vehicle(200).state(), AT_1)
    bench.receive(Vehicle(0).state(), AT_2)
    assert bench.link.addresses == {200: AT_1}
    assert bench.rejected() == ["unexpected_vehicle"]


@pytest.mark.parametrize(
    ("fields", "autopilot", "is_multirotor"),
    [({"autopilot": 0}, "other", True), ({"type": 1}, "ardupilot", False)],
    ids=str,
)
def test_what_is_of_an_unknown_kind_is_heard_but_not_commanded(
    bench: Bench, fields: dict[str, Any], autopilot: str, is_multirotor: bool
) -> None:
    bench.receive(Vehicle(1).heartbeat(mode=4, **fields))
    (heartbeat,) = bench.of(Heartbeat)
    assert (heartbeat.autopilot, heartbeat.is_multirotor) == (autopilot, is_multirotor)
    assert (heartbeat.mode, heartbeat.mode_name) == (Mode.OTHER, "4")
    bench.link.send(Arm(sysid=1), 50.0)
    bench.link.send(goto(1), 50.0)
    bench.drain()
    (outcome,) = bench.of(CommandOutcome)
    assert outcome.result == "refused"
    assert outcome.detail == "its HEARTBEAT says that it is no multirotor with ArduCopter or PX4"
    assert (bench.link.setpoints_out, bench.link.setpoints_dropped) == (0, 1)
    assert bench.sent == []


# --- Addresses -------------------------------------------------------------------------


def test_two_vehicles_behind_one_address(bench: Bench) -> None:
    one, two = Vehicle(1), Vehicle(2)
    bench.receive(one.state() + two.state(), AT_1)
    assert bench.link.addresses == {1: AT_1, 2: AT_1}
    bench.link.send(goto(1), bench.now)
    bench.link.send(goto(2), bench.now)
    bench.drain()
    targets = [m.target_system for m in bench.sent_to(AT_1, "SET_POSITION_TARGET_GLOBAL_INT")]
    assert targets == [1, 2]
    bench.wait(0.0)
    assert len(bench.sent_to(AT_1, "HEARTBEAT")) == 1
    sequence = [unpack(frame).get_seq() for frame, _ in bench.sent]
    assert sequence == [0, 1, 2, 3]


def test_sequence_numbers_count_per_address(two: tuple[Bench, Vehicle, Vehicle]) -> None:
    bench, _, _ = two
    for sysid in (1, 2, 1, 2):
        bench.link.send(goto(sysid), bench.now)
    bench.drain()
    sequence = [(where, unpack(frame).get_seq()) for frame, where in bench.sent]
    assert sequence == [(AT_1, 0), (AT_2, 0), (AT_1, 1), (AT_2, 1)]


def test_a_vehicle_that_falls_silent_may_come_back_elsewhere(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, _ = two
    bench.wait(1.0)
    bench.receive(one.state(), AT_1)
    bench.wait(1.9)
    bench.receive(one.state(), ELSEWHERE)
    assert bench.link.addresses[1] == AT_1
    bench.wait(0.2)
    bench.receive(one.state(), ELSEWHERE)
    assert bench.link.addresses[1] == ELSEWHERE
    bench.receive(one.heartbeat(mode=9), AT_1)  # on its way for long
    bench.receive(one.state(), ELSEWHERE)
    assert bench.link.addresses[1] == ELSEWHERE
    bench.sent.clear()
    bench.link.send(goto(1), bench.now)
    bench.wait(1.0)
    sent = [(unpack(frame).get_type(), where) for frame, where in bench.sent if where != AT_2]
    assert sent == [
        ("SET_POSITION_TARGET_GLOBAL_INT", ELSEWHERE),
        ("HEARTBEAT", ELSEWHERE),
        ("TIMESYNC", ELSEWHERE),
    ]
    assert {heartbeat.mode_name for heartbeat in bench.of(Heartbeat)} == {"STABILIZE"}
    assert len(bench.of(Heartbeat)) == 3


def test_a_vehicle_that_has_moved_is_not_its_own_double(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, _ = two
    for _ in range(10):
        bench.wait(0.5)
        bench.receive(one.state(), ELSEWHERE)
    assert bench.link.addresses[1] == ELSEWHERE
    assert bench.rejected() == []


def test_a_system_id_from_two_addresses_is_named_once_and_the_first_is_used(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, _ = two
    double = Vehicle(1)
    for _ in range(5):
        bench.wait(0.5)
        bench.receive(one.heartbeat(mode=4), AT_1)
        bench.receive(one.heartbeat(mode=4), AT_1)
        bench.receive(double.heartbeat(mode=9), ELSEWHERE)
    assert {heartbeat.mode for heartbeat in bench.of(Heartbeat)} == {Mode.GUIDED}
    (named,) = bench.of(InputRejected)
    assert named.kind == "duplicate_sysid"
    assert named.detail == (
        "System id 1 speaks from 10.0.0.1:14550 and from 10.0.0.9:40000 at the same time: only "
        "the first is used; give each vehicle its own id."
    )
    assert bench.link.rejected == {"duplicate_sysid": 4}
    assert bench.link.addresses[1] == AT_1
