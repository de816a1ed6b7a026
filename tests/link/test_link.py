"""The whole link in virtual time, with vehicles made of pymavlink at the other end."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any, TypeVar

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.events import (
    Arm,
    CommandOutcome,
    GoTo,
    GpsFix,
    Heartbeat,
    HomePosition,
    InputRejected,
    LandedState,
    LinkQuality,
    Mode,
    Observation,
    RequestHome,
    SetMode,
    StatusText,
    StreamTelemetry,
    TakeOff,
    VehicleAttitude,
    VehicleClock,
    VehiclePosition,
    VehicleStatus,
    VehicleVersion,
)
from swarmctl.link.facts import Address, MessageId
from swarmctl.link.link import MavlinkLink
from swarmctl.link.signing import Signing
from tests.link.wire import Sender, frame_by_hand, unpack

GCS = 245
AT_1 = Address("10.0.0.1", 14550)
AT_2 = Address("10.0.0.2", 14550)
ELSEWHERE = Address("10.0.0.9", 40000)

Kind = TypeVar("Kind", bound=Observation)


class Vehicle(Sender):
    """A vehicle that acknowledges commands and shows what they did, as ArduCopter does."""

    def __init__(self, sysid: int) -> None:
        super().__init__(sysid)
        self.mode = 0
        self.armed = False
        self.received: list[Any] = []

    def state(self) -> bytes:
        return self.heartbeat(mode=self.mode, armed=self.armed)

    def answer(self, datagram: bytes) -> list[bytes]:
        message = unpack(datagram)
        self.received.append(message)
        if message.get_type() != "COMMAND_LONG" or message.target_system != self.mav.srcSystem:
            return []
        ack = self.pack("COMMAND_ACK", command=message.command, target_system=GCS)
        if message.command == 176:
            self.mode = int(message.param2)
        if message.command == 400:
            self.armed = message.param1 == 1.0
        return [ack, self.state()]

    @property
    def commands(self) -> list[int]:
        return [m.command for m in self.received if m.get_type() == "COMMAND_LONG"]


class Bench:
    """A link, a clock, and what the link said."""

    def __init__(
        self,
        vehicles: Collection[int] | None = (1, 2),
        signing: Signing | None = None,
        stations: Sequence[Address] = (),
    ) -> None:
        self.link = MavlinkLink(
            gcs_sysid=GCS, vehicles=vehicles, signing=signing, stations=stations
        )
        self.now = 50.0
        self.heard: list[Observation] = []
        self.sent: list[tuple[bytes, Address]] = []

    def receive(self, datagram: bytes, address: Address = AT_1) -> None:
        self.link.receive_datagram(datagram, address, self.now)
        self.drain()

    def drain(self) -> None:
        self.heard += self.link.events()
        self.sent += self.link.datagrams()

    def wait(self, seconds: float) -> None:
        """Let time pass, serving timers when they are due and never otherwise."""
        end = self.now + seconds
        while self.link.next_timer() <= end:
            self.now = self.link.next_timer()
            self.link.handle_timer(self.now)
            self.drain()
        self.now = end

    def of(self, kind: type[Kind]) -> list[Kind]:
        return [event for event in self.heard if isinstance(event, kind)]

    def rejected(self) -> list[str]:
        return [event.kind for event in self.of(InputRejected)]

    def sent_to(self, address: Address, name: str) -> list[Any]:
        messages = [unpack(frame) for frame, where in self.sent if where == address]
        return [message for message in messages if message.get_type() == name]


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def two(bench: Bench) -> tuple[Bench, Vehicle, Vehicle]:
    """A link that knows two vehicles; what their first heartbeats caused is cleared away."""
    one, two = Vehicle(1), Vehicle(2)
    bench.receive(one.state(), AT_1)
    bench.receive(two.state(), AT_2)
    bench.heard.clear()
    bench.sent.clear()
    bench.link.traffic()
    return bench, one, two


def goto(sysid: int, alt_amsl_m: float = 100.0) -> GoTo:
    return GoTo(
        sysid=sysid, lat_rad=0.8, lon_rad=0.1, alt_amsl_m=alt_amsl_m, velocity_enu=(1.0, 2.0, 0.0)
    )


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


# --- Facts become events ---------------------------------------------------------------


def test_every_observation_of_a_vehicle(two: tuple[Bench, Vehicle, Vehicle]) -> None:
    bench, one, _ = two
    messages: dict[str, dict[str, Any]] = {
        "SYSTEM_TIME": {"time_unix_usec": 1_790_000_000_000_000, "time_boot_ms": 60_000},
        "GLOBAL_POSITION_INT": {"lat": 1, "lon": 1},
        "ATTITUDE": {},
        "SYS_STATUS": {},
        "GPS_RAW_INT": {},
        "HOME_POSITION": {"latitude": 1},
        "AUTOPILOT_VERSION": {},
        "EXTENDED_SYS_STATE": {},
        "STATUSTEXT": {"text": b"hello"},
    }
    for name, fields in messages.items():
        bench.receive(one.pack(name, **fields))
    assert [type(event) for event in bench.heard] == [
        VehicleClock,
        VehiclePosition,
        VehicleAttitude,
        VehicleStatus,
        GpsFix,
        HomePosition,
        VehicleVersion,
        LandedState,
        StatusText,
    ]
    assert all(getattr(event, "sysid", None) == 1 for event in bench.heard)
    assert {event.received_s for event in bench.heard} == {50.0}


def test_positions_get_their_utc_from_their_own_vehicles_clock(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, two_ = two
    bench.receive(one.pack("GLOBAL_POSITION_INT", lat=1, lon=1, time_boot_ms=59_000), AT_1)
    bench.receive(
        one.pack("SYSTEM_TIME", time_unix_usec=1_790_000_000_500_000, time_boot_ms=60_000), AT_1
    )
    bench.receive(
        two_.pack("SYSTEM_TIME", time_unix_usec=1_790_000_000_500_000, time_boot_ms=9_000), AT_2
    )
    bench.receive(one.pack("GLOBAL_POSITION_INT", lat=1, lon=1, time_boot_ms=60_200), AT_1)
    bench.receive(two_.pack("GLOBAL_POSITION_INT", lat=1, lon=1, time_boot_ms=9_300), AT_2)
    bench.receive(one.pack("GLOBAL_POSITION_INT", lat=1, lon=1, time_boot_ms=2_000), AT_1)
    before, after, other, rebooted = (
        position.epoch_utc_s for position in bench.of(VehiclePosition)
    )
    assert before is None
    assert after == pytest.approx(1_790_000_000.7, abs=1e-6)
    assert other == pytest.approx(1_790_000_000.8, abs=1e-6)
    assert rebooted is None


def test_a_position_carries_all_its_fields(two: tuple[Bench, Vehicle, Vehicle]) -> None:
    bench, _, two_ = two
    bench.receive(
        two_.pack(
            "GLOBAL_POSITION_INT",
            time_boot_ms=1500,
            lat=450_000_000,
            lon=-900_000_000,
            alt=120_500,
            vx=100,
            vy=-200,
            vz=300,
        ),
        AT_2,
    )
    (position,) = bench.of(VehiclePosition)
    assert (position.received_s, position.sysid, position.boot_s) == (50.0, 2, 1.5)
    assert position.lat_rad == pytest.approx(math.pi / 4, abs=1e-15)
    assert position.lon_rad == pytest.approx(-math.pi / 2, abs=1e-15)
    assert position.alt_amsl_m == 120.5
    assert position.velocity_enu == (-2.0, 1.0, -3.0)


# --- Faults ----------------------------------------------------------------------------


def test_each_kind_of_fault_is_named_once_and_then_counted(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, _ = two
    good = one.state()
    for _ in range(3):
        bench.receive(good[:-1], AT_1)
        bench.receive(b"GET / HTTP/1.1", ELSEWHERE)
        bench.receive(one.pack("GLOBAL_POSITION_INT", lat=2**31 - 1), AT_1)
    assert bench.rejected() == ["truncated", "not_mavlink", "implausible"]
    assert bench.link.rejected == {"truncated": 3, "not_mavlink": 3, "implausible": 3}
    assert bench.of(InputRejected)[1].detail == (
        "It has 0x47 where a frame should start, in a datagram of 14 bytes from 10.0.0.9:40000."
    )
    assert bench.of(VehiclePosition) == []
    bench.receive(good)
    assert len(bench.of(Heartbeat)) == 1


NAMES = st.sampled_from(sorted(message.name for message in MessageId))


@given(
    st.lists(st.tuples(NAMES, st.binary(max_size=255), st.integers(0, 255)), max_size=8),
    st.booleans(),
)
def test_no_payload_of_any_message_raises_or_stops_the_next(
    messages: list[tuple[str, bytes, int]], known: bool
) -> None:
    """Sound frames with any payload of any length, from any system: hostile, not corrupt."""
    bench = Bench(stations=[ELSEWHERE])
    vehicle = Vehicle(1)
    if known:
        bench.receive(vehicle.state(), AT_1)
    for name, payload, sysid in messages:
        message_id = MessageId[name]
        crc_extra = mavlink.mavlink_map[message_id].crc_extra
        for sender in (1, sysid):
            frame = frame_by_hand(message_id, payload, crc_extra, sysid=sender)
            bench.receive(frame, AT_1)
            bench.receive(frame, ELSEWHERE)
    bench.wait(3.0)
    bench.receive(vehicle.state(), AT_1)
    assert bench.of(Heartbeat)[-1].sysid == 1
    for position in bench.of(VehiclePosition):
        assert abs(position.lat_rad) <= math.pi / 2
        assert math.isfinite(position.alt_amsl_m + sum(position.velocity_enu))


@given(st.lists(st.binary(max_size=80), max_size=5), st.integers(0, 40), st.integers(0, 255))
def test_nothing_that_arrives_raises_or_stops_the_next(
    junk: list[bytes], place: int, value: int
) -> None:
    bench = Bench(stations=[AT_2])
    vehicle = Vehicle(1)
    frame = bytearray(vehicle.pack("STATUSTEXT", text=b"a text of some length", severity=3))
    frame[place % len(frame)] = value
    for data in (*junk, bytes(frame)):
        bench.receive(data, ELSEWHERE)
        bench.receive(data, AT_2)
    bench.receive(vehicle.state(), AT_1)
    assert bench.of(Heartbeat)[-1].sysid == 1


# --- Our own heartbeat, statistics, traffic --------------------------------------------


def test_heartbeats_and_link_quality_at_1_hz(bench: Bench) -> None:
    vehicle = Vehicle(1)
    bench.receive(vehicle.state())
    bench.wait(0.0)
    for _ in range(20):
        bench.wait(0.25)
        bench.receive(vehicle.pack("ATTITUDE"))
        vehicle.pack("ATTITUDE")  # lost on the way
    heartbeats = bench.sent_to(AT_1, "HEARTBEAT")
    assert len(heartbeats) == 6
    assert {(m.get_srcSystem(), m.get_srcComponent(), m.type) for m in heartbeats} == {
        (GCS, 190, 6)
    }
    qualities = bench.of(LinkQuality)
    assert [quality.received_s for quality in qualities] == [50.0, 51.0, 52.0, 53.0, 54.0, 55.0]
    # At 51.0 the report is made before the message that arrives at the same instant.
    assert [quality.rate_hz for quality in qualities] == [0.0, 3.0, 4.0, 4.0, 4.0, 4.0]
    assert (qualities[-1].messages_in, qualities[-1].lost) == (20, 18)


def test_a_silent_vehicle_still_has_a_link_quality(two: tuple[Bench, Vehicle, Vehicle]) -> None:
    bench, _, _ = two
    bench.wait(3.0)
    assert [quality.sysid for quality in bench.of(LinkQuality)] == [1, 2] * 4
    assert bench.of(LinkQuality)[-1].rate_hz == 0.0
    assert len(bench.sent_to(AT_2, "HEARTBEAT")) == 4


def test_a_late_timer_call_neither_drifts_nor_makes_up_with_a_burst(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, _, _ = two
    bench.link.handle_timer(50.3)
    assert bench.link.next_timer() == 51.0
    bench.link.handle_timer(52.0)
    assert bench.link.next_timer() == 53.0
    bench.link.handle_timer(60.0)
    bench.drain()
    assert len(bench.sent_to(AT_1, "HEARTBEAT")) == 3
    assert bench.link.next_timer() == 61.0


def test_traffic_is_every_sound_frame_in_and_out(bench: Bench) -> None:
    vehicle, stranger = Vehicle(1), Sender(9, compid=42)
    first, second = vehicle.state(), vehicle.pack("ATTITUDE")
    other = stranger.heartbeat()
    bench.receive(first + second, AT_1)
    bench.now = 51.0
    bench.receive(other + b"junk", AT_1)
    bench.link.send(goto(1), 52.0)
    bench.link.handle_timer(52.5)
    bench.drain()
    (setpoint, _), (heartbeat, _), (timesync, _) = bench.sent
    assert bench.link.traffic() == [
        (50.0, first),
        (50.0, second),
        (51.0, other),
        (52.0, setpoint),
        (52.5, heartbeat),
        (52.5, timesync),
    ]
    assert bench.link.traffic() == []
    assert bench.link.messages_in == 3


# --- Setpoints -------------------------------------------------------------------------


def test_a_setpoint_leaves_at_once(two: tuple[Bench, Vehicle, Vehicle]) -> None:
    bench, _, _ = two
    bench.link.send(goto(2, alt_amsl_m=88.0), 51.5)
    bench.drain()
    (message,) = bench.sent_to(AT_2, "SET_POSITION_TARGET_GLOBAL_INT")
    assert (message.target_system, message.alt, message.time_boot_ms) == (2, 88.0, 51_500)
    assert len(bench.sent) == 1
    assert (bench.link.setpoints_out, bench.link.setpoints_dropped) == (1, 0)


def test_setpoints_for_nobody_or_of_no_number_are_dropped_and_counted(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, _, _ = two
    bench.link.send(goto(99), 51.0)
    bench.link.send(goto(1, alt_amsl_m=math.nan), 51.0)
    bench.drain()
    assert (bench.sent, bench.heard) == ([], [])
    assert (bench.link.setpoints_out, bench.link.setpoints_dropped) == (0, 2)


# --- Commands --------------------------------------------------------------------------


def test_a_command_for_nobody_has_no_answer(bench: Bench) -> None:
    bench.link.send(Arm(sysid=1), 50.0)
    bench.drain()
    assert bench.heard == [
        CommandOutcome(
            received_s=50.0,
            sysid=1,
            command="Arm",
            result="no_answer",
            detail="no HEARTBEAT was heard from it",
        )
    ]
    assert bench.sent == []


def exchange(bench: Bench, vehicles: dict[Address, Vehicle], seconds: float) -> None:
    """Let time pass while the vehicles answer everything they are sent."""
    for _ in range(round(seconds / 0.1)):
        bench.wait(0.1)
        while bench.sent:
            frame, address = bench.sent.pop(0)
            for answer in vehicles[address].answer(frame):
                bench.receive(answer, address)


def test_two_vehicles_are_readied_side_by_side(two: tuple[Bench, Vehicle, Vehicle]) -> None:
    bench, one, other = two
    for sysid in (1, 2):
        bench.receive(
            (one if sysid == 1 else other).pack("HOME_POSITION", latitude=1, altitude=50_000),
            AT_1 if sysid == 1 else AT_2,
        )
        for command in (
            StreamTelemetry(sysid=sysid, position_hz=10.0),
            RequestHome(sysid=sysid),
            SetMode(sysid=sysid, mode=Mode.GUIDED),
            Arm(sysid=sysid),
            TakeOff(sysid=sysid, alt_amsl_m=70.0),
        ):
            bench.link.send(command, bench.now)
    bench.drain()
    exchange(bench, {AT_1: one, AT_2: other}, 2.0)
    for sysid, vehicle in ((1, one), (2, other)):
        outcomes = [outcome for outcome in bench.of(CommandOutcome) if outcome.sysid == sysid]
        assert [(outcome.command, outcome.result) for outcome in outcomes] == [
            ("StreamTelemetry", "accepted"),
            ("RequestHome", "accepted"),
            ("SetMode", "accepted"),
            ("Arm", "accepted"),
            ("TakeOff", "accepted"),
        ]
        assert vehicle.commands == [511] * 7 + [512, 176, 400, 22]
        assert (vehicle.mode, vehicle.armed) == (4, True)
        (take_off,) = (m for m in vehicle.received if getattr(m, "command", 0) == 22)
        assert take_off.param7 == 20.0


def test_take_off_without_a_known_home_is_refused_before_it_leaves(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, _, _ = two
    bench.link.send(TakeOff(sysid=1, alt_amsl_m=70.0), bench.now)
    bench.drain()
    (outcome,) = bench.of(CommandOutcome)
    assert (outcome.command, outcome.result) == ("TakeOff", "refused")
    assert "HOME_POSITION" in outcome.detail
    assert bench.sent == []


def test_a_command_is_tried_again_by_the_links_own_timer(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, _, _ = two
    bench.link.send(RequestHome(sysid=1), bench.now)
    bench.drain()
    bench.wait(10.0)
    tries = bench.sent_to(AT_1, "COMMAND_LONG")
    assert [message.confirmation for message in tries] == list(range(8))
    (outcome,) = bench.of(CommandOutcome)
    assert (outcome.result, outcome.received_s) == ("no_answer", 58.0)


def test_an_answer_to_another_ground_station_is_not_ours(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, _ = two
    bench.link.send(RequestHome(sysid=1), bench.now)
    bench.receive(one.pack("COMMAND_ACK", command=512, result=4, target_system=255), AT_1)
    bench.wait(0.9)
    assert bench.of(CommandOutcome) == []


@pytest.mark.parametrize("target_system", [0, GCS])
def test_an_answer_to_us_or_to_nobody_in_particular_is_ours(
    two: tuple[Bench, Vehicle, Vehicle], target_system: int
) -> None:
    bench, one, _ = two
    bench.link.send(RequestHome(sysid=1), bench.now)
    bench.receive(one.pack("COMMAND_ACK", command=512, target_system=target_system), AT_1)
    assert [outcome.result for outcome in bench.of(CommandOutcome)] == ["accepted"]


def test_a_refusal_carries_what_the_vehicle_said(two: tuple[Bench, Vehicle, Vehicle]) -> None:
    bench, one, other = two
    bench.link.send(Arm(sysid=1), bench.now)
    bench.receive(other.pack("STATUSTEXT", text=b"of another vehicle"), AT_2)
    bench.receive(one.pack("COMMAND_ACK", command=400, result=4, target_system=GCS), AT_1)
    bench.receive(one.pack("STATUSTEXT", text=b"Arm: Need Position Estimate", severity=2), AT_1)
    (outcome,) = bench.of(CommandOutcome)
    assert (outcome.result, outcome.detail) == ("refused", "FAILED: Arm: Need Position Estimate")


def test_a_mode_is_accepted_when_the_heartbeat_shows_it(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, _ = two
    bench.link.send(SetMode(sysid=1, mode=Mode.RETURN), bench.now)
    bench.receive(one.pack("COMMAND_ACK", command=176, target_system=GCS), AT_1)
    bench.receive(one.heartbeat(mode=4), AT_1)
    assert bench.of(CommandOutcome) == []
    bench.receive(one.heartbeat(mode=6), AT_1)
    last_two = bench.heard[-2:]
    assert isinstance(last_two[0], Heartbeat)
    assert isinstance(last_two[1], CommandOutcome)
    assert last_two[1].result == "accepted"


def test_a_take_off_whose_ack_was_lost_is_accepted_when_it_flies(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, _ = two
    bench.receive(one.pack("HOME_POSITION", latitude=1, altitude=50_000), AT_1)
    bench.link.send(TakeOff(sysid=1, alt_amsl_m=70.0), bench.now)
    bench.wait(0.5)
    bench.receive(one.pack("EXTENDED_SYS_STATE", landed_state=3), AT_1)
    assert [outcome.result for outcome in bench.of(CommandOutcome)] == ["accepted"]


# --- PX4 -------------------------------------------------------------------------------

OFFBOARD, POSCTL, AUTO_LOITER = 0x00060000, 0x00030000, 0x03040000


def px4_beat(vehicle: Vehicle, mode: int, **fields: Any) -> bytes:  # noqa: ANN401 - MAVLink fields
    return vehicle.heartbeat(mode=mode, autopilot=12, **fields)


def test_px4_is_known_by_its_heartbeat_and_so_are_its_modes_and_failsafes(bench: Bench) -> None:
    vehicle = Vehicle(1)
    bench.receive(px4_beat(vehicle, OFFBOARD, system_status=4))
    bench.receive(px4_beat(vehicle, POSCTL, system_status=5))
    one, two = bench.of(Heartbeat)
    assert (one.mode, one.mode_name, one.failsafe) == (Mode.GUIDED, "OFFBOARD", False)
    assert (two.mode, two.mode_name, two.failsafe) == (Mode.OTHER, "POSCTL", True)
    assert one.guided_by_stream
    bench.receive(vehicle.heartbeat(mode=4))
    assert not bench.of(Heartbeat)[-1].guided_by_stream


def test_px4_takes_our_setpoints_in_a_frame_it_knows(bench: Bench) -> None:
    bench.receive(px4_beat(Vehicle(1), OFFBOARD))
    bench.link.send(goto(1), 50.0)
    bench.drain()
    (message,) = bench.sent_to(AT_1, "SET_POSITION_TARGET_GLOBAL_INT")
    assert message.coordinate_frame == 5  # not 0 or 3, which it rejects
    position_and_velocity, everything = 0b0000_0011_1111, 0b1101_1111_1111
    assert message.type_mask & position_and_velocity == 0
    assert message.type_mask & everything != everything


def test_an_ack_of_px4_for_offboard_is_believed_only_with_the_heartbeat(bench: Bench) -> None:
    vehicle = Vehicle(1)
    bench.receive(px4_beat(vehicle, AUTO_LOITER))
    bench.link.send(SetMode(sysid=1, mode=Mode.GUIDED), bench.now)
    bench.drain()
    (command,) = bench.sent_to(AT_1, "COMMAND_LONG")
    assert (command.command, command.param1, command.param2, command.param3) == (176, 1, 6, 0)
    bench.receive(vehicle.pack("COMMAND_ACK", command=176, target_system=GCS))
    for _ in range(6):
        bench.receive(px4_beat(vehicle, AUTO_LOITER))
        assert bench.of(CommandOutcome) == []
        bench.wait(1.0)
    (outcome,) = bench.of(CommandOutcome)
    assert outcome.result == "refused"
    assert "HEARTBEAT shows AUTO.LOITER and disarmed" in outcome.detail


def test_px4_that_is_not_ready_to_arm_is_asked_again(bench: Bench) -> None:
    vehicle = Vehicle(1)
    bench.receive(px4_beat(vehicle, OFFBOARD))
    bench.link.send(Arm(sysid=1), bench.now)
    for _ in range(2):
        bench.receive(vehicle.pack("COMMAND_ACK", command=400, result=1, target_system=GCS))
        bench.wait(1.0)
    bench.receive(vehicle.pack("COMMAND_ACK", command=400, target_system=GCS))
    bench.receive(px4_beat(vehicle, OFFBOARD, base_mode=0x81))
    assert len(bench.sent_to(AT_1, "COMMAND_LONG")) == 3
    assert [outcome.result for outcome in bench.of(CommandOutcome)] == ["accepted"]


def test_px4s_take_off_altitude_crosses_the_wire_as_amsl(bench: Bench) -> None:
    vehicle = Vehicle(1)
    bench.receive(px4_beat(vehicle, AUTO_LOITER))
    bench.receive(vehicle.pack("HOME_POSITION", latitude=1, altitude=50_000))
    bench.link.send(TakeOff(sysid=1, alt_amsl_m=70.0), bench.now)
    bench.drain()
    (command,) = bench.sent_to(AT_1, "COMMAND_LONG")
    assert (command.command, command.param7) == (22, 70.0)
    assert math.isnan(command.param5)
    assert math.isnan(command.param6)
