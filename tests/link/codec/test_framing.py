"""Frames found in datagrams and streams, however the bytes are cut and spoilt."""

from __future__ import annotations

import itertools
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.link.codec import decoding
from swarmctl.link.codec.framing import Framer, split, target_of
from swarmctl.link.codec.messages import Fault, Frame
from tests.link.wire import Sender, frame_by_hand

LONGEST_FRAME = 280


def kinds(datagram: bytes) -> list[str]:
    return [fault.kind for fault in split(datagram)[1]]


def known(datagram: bytes) -> list[bytes]:
    return [frame.raw for frame in split(datagram)[0] if frame.message_id in mavlink.mavlink_map]


# --- Datagrams -------------------------------------------------------------------------


def test_header_of_both_versions() -> None:
    sender = Sender(sysid=7, compid=9)
    sender.mav.seq = 41
    one = sender.pack_v1("ATTITUDE", roll=1.0)
    two = sender.pack("ATTITUDE", roll=1.0)
    frames, faults = split(one + two)
    assert faults == []
    # MAVLink 1 carries the whole payload of 28 bytes, MAVLink 2 cuts trailing zeros.
    payload = struct.pack("<If", 0, 1.0)
    assert frames == [
        Frame(one, 7, 9, 41, 30, payload + bytes(20)),
        Frame(two, 7, 9, 42, 30, payload),
    ]


def test_a_signed_frame_is_taken_whole() -> None:
    sender = Sender()
    sender.mav.signing.secret_key = bytes(32)
    sender.mav.signing.sign_outgoing = True
    signed = sender.heartbeat()
    plain = Sender().heartbeat()
    assert len(signed) == len(plain) + 13
    assert known(signed + plain) == [signed, plain]


@given(st.lists(st.sampled_from(["HEARTBEAT", "ATTITUDE", "STATUSTEXT", "RAW_IMU"]), max_size=5))
def test_every_message_of_a_datagram_is_found(names: list[str]) -> None:
    sender = Sender()
    frames = [
        sender.pack(name, **({"text": b"x"} if name == "STATUSTEXT" else {})) for name in names
    ]
    assert known(b"".join(frames)) == frames


def test_an_unknown_message_between_frames_counts_but_says_nothing() -> None:
    unknown = frame_by_hand(99_999, b"new", 0, seq=3)
    good = Sender().heartbeat()
    frames, faults = split(good + unknown + good)
    assert [frame.raw for frame in frames] == [good, unknown, good]
    assert faults == []
    fault = decoding.read(frames[1], 5.0)
    assert isinstance(fault, Fault)
    assert (fault.kind, frames[1].seq) == ("unknown_message", 3)
    assert "99999" in fault.detail


# --- Corrupt input ---------------------------------------------------------------------

GOOD = Sender().pack("GLOBAL_POSITION_INT", time_boot_ms=1, lat=471_234_567, lon=82_345_678, hdg=9)
OTHER = Sender(sysid=2).pack(
    "ATTITUDE", time_boot_ms=77, roll=0.1, pitch=0.2, yaw=0.3, yawspeed=1.0
)


def test_kinds_of_faults() -> None:
    assert kinds(b"") == ["not_mavlink"]
    assert kinds(b"GET / HTTP/1.1") == ["not_mavlink"]
    assert kinds(GOOD[:5]) == ["truncated"]
    assert kinds(GOOD[:-1]) == ["truncated"]
    assert kinds(b"\xfe\x09\x00") == ["truncated"]
    assert kinds(GOOD[:-1] + bytes((GOOD[-1] ^ 1,))) == ["bad_crc"]
    assert kinds(GOOD[:2] + b"\x04" + GOOD[3:]) == ["unsupported_flags"]
    assert kinds(frame_by_hand(99_999, b"new", 0) + b"junk") == ["unknown_message"]


def test_a_corrupt_stretch_is_one_fault() -> None:
    assert kinds(b"\xfejunk\xfdjunk\xfejunk" + GOOD + b"\xfd") == ["truncated", "truncated"]


@pytest.mark.parametrize("length", range(1, len(GOOD)))
def test_the_part_behind_a_truncated_frame_is_taken(length: int) -> None:
    assert known(OTHER + GOOD[:length] + OTHER) == [OTHER, OTHER]
    assert known(OTHER + GOOD[:length]) == [OTHER]
    assert known(OTHER) == [OTHER]


@given(st.integers(0, len(GOOD) - 1), st.integers(1, 255))
def test_the_parts_around_a_corrupt_byte_are_taken(place: int, mask: int) -> None:
    corrupt = bytearray(GOOD)
    corrupt[place] ^= mask
    assert known(OTHER + corrupt + OTHER) == [OTHER, OTHER]


@given(st.binary(max_size=400))
def test_random_bytes_never_raise(data: bytes) -> None:
    frames, faults = split(data)
    assert faults or frames
    for frame in frames:
        decoding.read(frame, 0.0)
    assert known(OTHER) == [OTHER]


def test_a_datagram_full_of_start_markers_is_given_up() -> None:
    # Each marker could cost a checksum; a sound frame behind 30 of them is found, behind 3000 not.
    assert known(b"\xfe" * 30 + GOOD) == [GOOD]
    assert known(b"\xfe" * 3000 + GOOD) == []


# --- Streams ---------------------------------------------------------------------------


def frames_of(pieces: list[bytes]) -> list[bytes]:
    framer = Framer()
    return [frame.raw for piece in pieces for frame in split(framer.feed(piece))[0] if piece]


def stream() -> tuple[list[bytes], bytes]:
    sender = Sender(1)
    frames = [
        sender.heartbeat(),
        sender.pack_v1("ATTITUDE", roll=1.0),
        sender.pack("STATUSTEXT", text=b"\xfd\xfe in a text", severity=3),
        sender.pack("GLOBAL_POSITION_INT", lat=1, lon=2, alt=3),
    ]
    return frames, b"".join(frames)


@given(st.lists(st.integers(0, 200), max_size=12))
def test_however_a_stream_is_cut_its_frames_come_out(cuts: list[int]) -> None:
    frames, data = stream()
    edges = sorted({0, len(data), *(cut for cut in cuts if cut < len(data))})
    pieces = [data[a:b] for a, b in itertools.pairwise(edges)]
    assert frames_of(pieces) == frames


def test_byte_by_byte() -> None:
    frames, data = stream()
    assert frames_of([bytes((byte,)) for byte in data]) == frames


def test_garbage_is_handed_out_to_be_counted_and_costs_no_frame() -> None:
    frames, data = stream()
    framer = Framer()
    found, faults = split(framer.feed(b"AT+MODE?\r\n" + data))
    assert [frame.raw for frame in found] == frames
    assert [fault.kind for fault in faults] == ["not_mavlink"]


def test_a_start_marker_that_starts_nothing_holds_up_at_most_one_frame_length() -> None:
    """The false marker announces 255 bytes; what follows comes out once those were seen."""
    sender = Sender(1)
    framer = Framer()
    bait = b"\xfd\xff\x01\x00"
    assert framer.feed(bait) == b""
    out, sent = b"", bait
    while not out:
        assert len(sent) <= LONGEST_FRAME + 30
        frame = sender.heartbeat()
        sent += frame
        out = framer.feed(frame)
    assert out == sent
    assert len(split(out)[0]) == (len(sent) - len(bait)) // len(frame)


@given(st.lists(st.binary(max_size=300), max_size=6))
def test_nothing_is_lost_or_kept_but_the_beginning_of_a_frame(pieces: list[bytes]) -> None:
    framer = Framer()
    out = b"".join(framer.feed(piece) for piece in pieces)
    sent = b"".join(pieces)
    assert sent.startswith(out)
    kept = sent[len(out) :]
    assert len(kept) < LONGEST_FRAME
    assert not kept or kept[0] in {0xFD, 0xFE}


# --- Whom a frame is for ---------------------------------------------------------------


@pytest.mark.parametrize(
    "message",
    [m for m in mavlink.mavlink_map.values() if "target_system" in m.fieldnames],
    ids=lambda m: m.msgname,
)
def test_the_target_of_every_message_that_has_one(message: Any) -> None:  # noqa: ANN401 - untyped
    for target in (0, 201):
        raw = Sender().pack(message.msgname, target_system=target)
        (frame,), _ = split(raw)
        assert target_of(frame) == target


def test_a_message_without_a_target_is_for_everybody() -> None:
    (frame,), _ = split(Sender().heartbeat())
    assert target_of(frame) == 0
