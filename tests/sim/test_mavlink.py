"""Codec of the simulated vehicles."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.mavlink import Codec
from swarmctl.link.codec.encoding import Encoder
from swarmctl.link.codec.framing import split
from swarmctl.link.signing import Signing, timestamp_at

KEY, OTHER_KEY = bytes(range(32)), bytes(range(1, 33))
UTC_S = 1_790_000_000.0


def setpoint(sysid: int = 1) -> bytes:
    encoder = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    message = mavlink.MAVLink_set_position_target_global_int_message(
        1, sysid, 1, 5, 0b110111000000, 470000000, 80000000, 450.0, 1, 2, 3, 0, 0, 0, 0, 0
    )
    return bytes(message.pack(encoder))


def names(codec: Codec, datagram: bytes) -> list[str]:
    return [message.get_type() for message in codec.decode(datagram)]


def test_sends_mavlink_2_with_a_running_sequence() -> None:
    codec = Codec(42)
    for _ in range(300):
        codec.send(mavlink.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3))
    datagrams = codec.drain()
    assert codec.drain() == []
    decoder = mavlink.MAVLink(None)
    for i, datagram in enumerate(datagrams):
        assert datagram[0] == mavlink.PROTOCOL_MARKER_V2
        (message,) = decoder.parse_buffer(datagram)
        assert message.get_srcSystem() == 42
        assert message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1
        assert message.get_seq() == i % 256


def test_takes_several_messages_from_a_datagram() -> None:
    assert names(Codec(1), setpoint() + setpoint()) == 2 * ["SET_POSITION_TARGET_GLOBAL_INT"]


def test_a_truncated_datagram_harms_none_of_those_after_it() -> None:
    codec = Codec(1)
    whole = setpoint()
    for length in range(len(whole)):
        assert names(codec, whole[:length]) == []
        assert names(codec, whole) == ["SET_POSITION_TARGET_GLOBAL_INT"]


def test_damaged_and_unknown_messages_are_dropped() -> None:
    codec = Codec(1)
    damaged = bytearray(setpoint())
    damaged[15] ^= 1
    assert names(codec, bytes(damaged)) == []
    # A message id no dialect has, with whatever checksum.
    assert names(codec, bytes([0xFD, 1, 0, 0, 0, 255, 190, 0xFE, 0xFF, 0xFE, 7, 1, 2])) == []
    assert names(codec, b"\x00\x01garbage" + setpoint()) == ["SET_POSITION_TARGET_GLOBAL_INT"]


@given(st.binary(max_size=64))
def test_no_bytes_upset_it(noise: bytes) -> None:
    codec = Codec(1)
    codec.decode(noise)
    assert names(codec, setpoint()) == ["SET_POSITION_TARGET_GLOBAL_INT"]


def test_a_signing_vehicle_is_heard_with_its_key_and_hears_with_its_key_alone() -> None:
    """Both ways against the controller's own signing, which shares no code with it."""
    codec = Codec(1, KEY)
    codec.advance(UTC_S)
    codec.send(mavlink.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3))
    codec.advance(UTC_S - 3600.0)
    codec.send(mavlink.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3))
    ours = {key: Signing(key, timestamp_at(UTC_S), 0.0) for key in (KEY, OTHER_KEY)}
    for datagram in codec.drain():
        (frame,), faults = split(datagram)
        assert faults == []
        assert ours[KEY].check(frame) is None
        wrong = ours[OTHER_KEY].check(frame)
        assert wrong is not None
        assert wrong.kind == "wrongly_signed"
    right, wrongly = (Encoder(245, signing).heartbeat() for signing in ours.values())
    assert names(codec, right) == ["HEARTBEAT"]
    assert names(codec, right) == []  # said twice
    assert names(codec, wrongly) == []
    assert names(codec, Encoder(245).heartbeat()) == []
