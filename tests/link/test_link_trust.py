"""Whom the link believes, calls and tells: signing, identity, versions, other stations."""

from __future__ import annotations

from typing import Any

import pytest

from swarmctl.commands import Arm, ReadParameter, RequestHome
from swarmctl.events import CommandOutcome, Heartbeat, InputRejected, LinkQuality, VehiclePosition
from swarmctl.link.address import Address
from swarmctl.link.signing import Signing, timestamp_at
from swarmctl.link.silent_endpoints import SILENT_LINK_S
from tests.link.bench import AT_1, AT_2, ELSEWHERE, GCS, Bench, Vehicle, goto
from tests.link.signers import KEY, Signer, receiver
from tests.link.wire import Sender

UTC_S = 1_790_000_000.0
QGC = Address("127.0.0.1", 14551, 1)


def known(bench: Bench, vehicle: Vehicle, address: Address = AT_1, uid: int = 0xA) -> None:
    """Let the bench hear a vehicle and its hardware id; what that caused is cleared away."""
    bench.receive(vehicle.state(), address)
    bench.receive(vehicle.pack("AUTOPILOT_VERSION", uid=uid), address)
    bench.wait(0.0)
    bench.heard.clear()
    bench.sent.clear()


# --- Signing ---------------------------------------------------------------------------


def test_with_a_key_everything_sent_is_signed_and_everything_unsigned_refused() -> None:
    bench = Bench(signing=Signing(KEY, 0, UTC_S))
    start = timestamp_at(UTC_S + bench.now)
    signed = Signer(1, timestamp=start)
    bench.receive(Vehicle(1).state())
    assert (bench.heard[0], bench.link.addresses) == (
        InputRejected(
            received_s=50.0,
            source="mavlink",
            kind="unsigned",
            detail="It holds message 0 of system 1 without a signature, but "
            "swarm.signing_key_file asks for one, in a datagram of 19 bytes from 10.0.0.1:14550.",
        ),
        {},
    )
    heartbeat = signed.heartbeat()
    for _ in range(3):
        bench.receive(heartbeat)
        bench.receive(Signer(1, key=bytes(32), timestamp=start + 9).heartbeat())
    assert len(bench.of(Heartbeat)) == 1
    assert bench.link.rejected == {"unsigned": 1, "replayed": 2, "wrongly_signed": 3}
    assert bench.rejected() == ["unsigned", "wrongly_signed", "replayed"]
    bench.link.send(goto(1), bench.now)
    bench.link.send(RequestHome(sysid=1), bench.now)
    bench.wait(2.0)
    mav = receiver(timestamp=start)
    for raw, _ in bench.sent:  # pymavlink checks signature and order
        assert mav.decode(bytearray(raw)).get_signed()
    assert len(bench.sent) > 5


def test_without_a_key_a_signed_vehicle_is_understood() -> None:
    bench = Bench()
    bench.receive(Signer(1).heartbeat())
    assert len(bench.of(Heartbeat)) == 1


# --- MAVLink 1 -------------------------------------------------------------------------


class OldVehicle(Vehicle):
    """A vehicle that speaks and understands MAVLink 1 only."""

    def _pack(self, name: str, fields: dict[str, Any], *, v1: bool) -> bytes:
        return super()._pack(name, fields, v1=True)

    def answer(self, datagram: bytes) -> list[bytes]:
        return super().answer(datagram) if datagram[0] == 0xFE else []


def test_a_vehicle_that_speaks_mavlink_1_is_answered_in_kind() -> None:
    bench, old = Bench(), OldVehicle(1)
    bench.receive(old.state())
    bench.receive(old.pack("GLOBAL_POSITION_INT", lat=450_000_000, lon=1, alt=120_500))
    bench.link.send(Arm(sysid=1), bench.now)
    bench.link.send(goto(1), bench.now)
    bench.drain()
    assert all(raw[0] == 0xFE for raw, _ in bench.sent)
    for raw, _ in bench.sent:
        for answer in old.answer(raw):
            bench.receive(answer)
    (position,) = bench.of(VehiclePosition)
    assert position.alt_amsl_m == 120.5
    assert [outcome.result for outcome in bench.of(CommandOutcome)] == ["accepted"]
    assert old.received[-1].get_type() == "SET_POSITION_TARGET_GLOBAL_INT"


def test_the_first_frame_in_mavlink_2_ends_mavlink_1() -> None:
    bench, vehicle = Bench(), Vehicle(1)
    bench.receive(OldVehicle(1).state())
    bench.receive(vehicle.state())
    bench.receive(vehicle.pack_v1("ATTITUDE"))
    bench.link.send(goto(1), bench.now)
    bench.drain()
    assert bench.sent[-1][0][0] == 0xFD


# --- Identity --------------------------------------------------------------------------


def test_another_vehicle_under_a_known_id_is_named_once_not_heard_and_not_commanded() -> None:
    bench, ours, other = Bench(), Vehicle(1), Vehicle(1)
    known(bench, ours)
    for _ in range(2):
        bench.receive(other.pack("AUTOPILOT_VERSION", uid=0xB), AT_1)
        bench.receive(other.state(), AT_1)
    bench.link.send(goto(1), bench.now)
    bench.link.send(Arm(sysid=1), bench.now)
    bench.link.send(ReadParameter(sysid=1, parameter="RTL_ALT"), bench.now)
    bench.drain()
    named, outcome = bench.heard
    assert isinstance(named, InputRejected)
    assert (named.kind, bench.link.rejected) == ("changed_uid", {"changed_uid": 2})
    assert named.detail == (
        "System id 1 at 10.0.0.1:14550 had the hardware id 0xa and now has 0xb: another vehicle, "
        "which is not commanded; give each vehicle its own system id."
    )
    assert isinstance(outcome, CommandOutcome)
    assert (outcome.result, outcome.detail) == (
        "refused",
        "another vehicle answers under its system id",
    )
    assert bench.sent == []
    assert bench.link.setpoints_dropped == 1
    bench.receive(ours.pack("AUTOPILOT_VERSION", uid=0xA), AT_1)  # the first is back
    bench.receive(ours.state(), AT_1)
    bench.link.send(goto(1), bench.now)
    bench.drain()
    assert len(bench.sent_to(AT_1, "SET_POSITION_TARGET_GLOBAL_INT")) == 1
    assert len(bench.of(Heartbeat)) == 1


def test_a_command_under_way_is_not_repeated_to_another_vehicle() -> None:
    bench, ours = Bench(), Vehicle(1)
    known(bench, ours)
    bench.link.send(Arm(sysid=1), bench.now)
    bench.wait(0.5)
    bench.receive(Vehicle(1).pack("AUTOPILOT_VERSION", uid=0xB), AT_1)
    bench.wait(20.0)
    assert len(bench.sent_to(AT_1, "COMMAND_LONG")) == 1
    assert [outcome.result for outcome in bench.of(CommandOutcome)] == ["no_answer"]


@pytest.mark.parametrize("address", [AT_1, ELSEWHERE], ids=["same address", "another address"])
def test_a_vehicle_that_was_silent_is_asked_who_it_is(address: Address) -> None:
    bench, ours = Bench(), Vehicle(1)
    known(bench, ours)
    bench.receive(ours.state(), AT_1)
    bench.wait(1.5)
    bench.receive(ours.state(), AT_1)
    bench.wait(0.1)
    assert bench.sent_to(AT_1, "COMMAND_LONG") == []
    bench.wait(2.0)
    bench.receive(ours.state(), address)
    (asked,) = bench.sent_to(address, "COMMAND_LONG")
    assert (asked.command, asked.param1) == (512, 148)  # REQUEST_MESSAGE, AUTOPILOT_VERSION


def test_a_vehicle_that_does_not_know_its_hardware_id_is_nobody_else() -> None:
    bench, ours = Bench(), Vehicle(1)
    known(bench, ours)
    bench.receive(ours.pack("AUTOPILOT_VERSION", uid=0), AT_1)
    bench.receive(ours.state(), AT_1)
    assert bench.rejected() == []
    assert len(bench.of(Heartbeat)) == 1


# --- Endpoints -------------------------------------------------------------------------


def test_an_endpoint_that_calls_gets_heartbeats_until_it_is_lost() -> None:
    bench = Bench()
    tcp = Address("10.0.0.7", 5760, 1)
    bench.link.open(tcp, bench.now)
    bench.wait(2.0)
    assert len(bench.sent_to(tcp, "HEARTBEAT")) == 3
    bench.receive(Vehicle(1).state(), tcp)
    bench.wait(1.0)
    assert len(bench.sent_to(tcp, "HEARTBEAT")) == 4  # one, not two
    bench = Bench()
    bench.link.open(tcp, bench.now)
    bench.wait(1.0)
    bench.link.close(tcp)
    bench.wait(2.0)
    assert len(bench.sent_to(tcp, "HEARTBEAT")) == 2


def test_each_endpoint_on_which_nothing_is_heard_is_named_once() -> None:
    bench = Bench()
    urls = ["udpin://0.0.0.0:14550", "tcp://10.0.0.7:5760", "serial:///dev/ttyUSB0:57600"]
    bench.link.listen(urls, bench.now)
    bench.wait(SILENT_LINK_S - 0.5)
    bench.receive(b"login: ", Address("10.0.0.7", 5760, 1))  # a word, but no MAVLink
    bench.receive(Vehicle(1).state(), AT_1)
    bench.wait(60.0)
    named = [event.detail for event in bench.of(InputRejected) if event.kind == "silent_link"]
    assert [detail[:44] for detail in named] == [
        "Nothing was heard on tcp://10.0.0.7:5760 for",
        "Nothing was heard on serial:///dev/ttyUSB0:5",
    ]
    assert bench.link.rejected["silent_link"] == 2


# --- Clocks ----------------------------------------------------------------------------


def test_link_quality_tells_latency_and_the_vehicles_clock() -> None:
    """The vehicle booted 40 s before our time began; 30 ms there, 50 ms back."""
    bench, vehicle = Bench(), Vehicle(1)
    bench.receive(vehicle.state())
    for _ in range(6):
        bench.wait(0.0)
        questions = bench.sent_to(AT_1, "TIMESYNC")
        bench.sent.clear()
        bench.wait(0.08)
        for question in questions:
            assert question.tc1 == 0
            answer = vehicle.pack(
                "TIMESYNC", tc1=round((question.ts1 / 1e9 + 0.03 + 40.0) * 1e9), ts1=question.ts1
            )
            bench.receive(answer)
            bench.receive(vehicle.pack("TIMESYNC", tc1=1, ts1=12345))  # another station asked
            bench.receive(vehicle.pack("TIMESYNC", tc1=0, ts1=99))  # the vehicle asks itself
        bench.wait(0.92)
    for boot_ms, utc_us in ((91_000, 1_000_000), (92_000, 2_000_400)):
        bench.receive(
            vehicle.pack(
                "SYSTEM_TIME",
                time_unix_usec=1_790_000_000_000_000 + utc_us,
                time_boot_ms=boot_ms,
            )
        )
    bench.wait(2.0)
    quality = bench.of(LinkQuality)[-1]
    assert quality.rtt_s == pytest.approx(0.08, abs=1e-6)
    # The two ways take 30 and 50 ms: the offset errs by the 10 ms between, less than half a trip.
    assert quality.boot_offset_s == pytest.approx(40.0 - 0.01, abs=1e-6)
    assert quality.boot_offset_error_s == pytest.approx(0.04, abs=1e-6)
    assert quality.utc_error_s == pytest.approx(1e-3)
    assert bench.of(LinkQuality)[0].rtt_s is None


# --- Other ground stations -------------------------------------------------------------


@pytest.fixture
def forwarding() -> tuple[Bench, Vehicle, Vehicle]:
    """Two vehicles that a second station listens in to; what it was told so far is cleared."""
    bench, one, two = Bench(stations=[QGC]), Vehicle(1), Vehicle(2)
    known(bench, one, AT_1, 0xA)
    known(bench, two, AT_2, 0xB)
    return bench, one, two


def test_what_vehicles_say_is_passed_on_byte_for_byte(
    forwarding: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, _ = forwarding
    said = [
        one.state(),
        one.pack("ATTITUDE"),
        Sender(1, compid=154).heartbeat(),
        Signer(1).pack("STATUSTEXT", text=b"signed"),
    ]
    for raw in said:
        bench.receive(raw, AT_1)
    assert [raw for raw, address in bench.sent if address == QGC] == said


def test_our_own_frames_and_impostors_are_not_passed_on(
    forwarding: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, _ = forwarding
    bench.link.send(goto(1), bench.now)
    bench.receive(one.state(), AT_1)
    bench.sent.clear()
    bench.receive(Vehicle(1).state(), ELSEWHERE)  # the same id from another address
    bench.receive(Sender(1, compid=154).heartbeat(), ELSEWHERE)
    bench.wait(1.0)
    assert [raw for raw, address in bench.sent if address == QGC] == []


def test_a_stations_command_reaches_the_vehicle_it_names_and_the_answer_comes_back(
    forwarding: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, _, two = forwarding
    station = Sender(255, compid=190)
    command = station.pack("COMMAND_LONG", command=400, param1=1.0, target_system=2)
    bench.receive(command, QGC)
    assert bench.sent == [(command, AT_2)]
    assert (bench.now, command) in bench.link.traffic()
    bench.sent.clear()
    ack = two.pack("COMMAND_ACK", command=400, target_system=255)
    bench.receive(ack, AT_2)
    assert bench.sent == [(ack, QGC)]


def test_a_station_is_no_vehicle_and_its_mistakes_are_named_once(
    forwarding: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, _, _ = forwarding
    for _ in range(2):
        bench.receive(Vehicle(1).state(), QGC)
        bench.receive(Sender(GCS, compid=190).heartbeat(), QGC)
        bench.receive(b"nonsense", QGC)
    assert bench.sent == []
    assert bench.of(Heartbeat) == []
    assert bench.rejected() == ["forwarding_loop", "our_sysid", "not_mavlink"]
    assert set(bench.link.rejected.values()) == {2}


def test_refused_frames_are_not_passed_on() -> None:
    bench = Bench(signing=Signing(KEY, 0, UTC_S), stations=[QGC])
    bench.receive(Sender(7, compid=154).heartbeat())
    signed = Signer(7, timestamp=timestamp_at(UTC_S + bench.now)).heartbeat()
    bench.receive(signed)
    assert bench.sent == [(signed, QGC)]
