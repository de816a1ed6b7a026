"""Frames out of streams, however the bytes are cut."""

from __future__ import annotations

import itertools

from hypothesis import given
from hypothesis import strategies as st

from swarmctl.link import codec
from swarmctl.link.framing import Framer
from tests.link.wire import Sender

LONGEST_FRAME = 280


def frames_of(pieces: list[bytes]) -> list[bytes]:
    framer = Framer()
    return [frame.raw for piece in pieces for frame in codec.split(framer.feed(piece))[0] if piece]


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
    found, faults = codec.split(framer.feed(b"AT+MODE?\r\n" + data))
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
    assert len(codec.split(out)[0]) == (len(sent) - len(bait)) // len(frame)


@given(st.lists(st.binary(max_size=300), max_size=6))
def test_nothing_is_lost_or_kept_but_the_beginning_of_a_frame(pieces: list[bytes]) -> None:
    framer = Framer()
    out = b"".join(framer.feed(piece) for piece in pieces)
    sent = b"".join(pieces)
    assert sent.startswith(out)
    kept = sent[len(out) :]
    assert len(kept) < LONGEST_FRAME
    assert not kept or kept[0] in {0xFD, 0xFE}
