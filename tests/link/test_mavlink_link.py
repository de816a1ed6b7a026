"""The whole link in virtual time: faults, its own heartbeat, statistics and traffic."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.events import Heartbeat, InputRejected, LinkQuality, VehiclePosition
from swarmctl.link.codec.messages import MessageId
from tests.link.bench import AT_1, AT_2, ELSEWHERE, GCS, Bench, Vehicle, goto
from tests.link.wire import Sender, frame_by_hand

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
