"""Bytes to frames: where a frame begins and ends, whether it is whole, and its target.

It uses pymavlink's tables (checksum seeds, field layouts) and its checksum, but not its stream
parser, which costs three times as much and keeps its state across datagrams. Here nothing is kept,
so a truncated datagram cannot spoil the next one.

MAVLink 1 and 2 are read (https://mavlink.io/en/guide/serialization.html), dialect
``ardupilotmega``, of which ``common`` is a part.
"""

from __future__ import annotations

import re
import struct

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.link.codec.messages import Fault, Frame

_HEADER_V2 = struct.Struct("<xBBxBBBHB")
_HEADER_V1 = struct.Struct("<xBBBBB")
_MARKER = re.compile(rb"[\xfd\xfe]")
_SIGNED = mavlink.MAVLINK_IFLAG_SIGNED
_CRC_EXTRA = {
    message_id: bytes((message.crc_extra,)) for message_id, message in mavlink.mavlink_map.items()
}
_SIZES = {"char": 1, "float": 4, "double": 8} | {
    f"{sign}int{bits}_t": bits // 8 for sign in ("", "u") for bits in (8, 16, 32, 64)
}
_TARGET_PLACES: dict[int, int] = {
    message_id: sum(
        _SIZES[dict(zip(message.fieldnames, message.fieldtypes, strict=True))[name]]
        * max(1, message.array_lengths[place])
        for place, name in enumerate(
            message.ordered_fieldnames[: message.ordered_fieldnames.index("target_system")]
        )
    )
    for message_id, message in mavlink.mavlink_map.items()
    if "target_system" in message.fieldnames
}
# A datagram made of nothing but start markers would otherwise cost a checksum per byte.
_MAX_RESYNCS = 32


def split(datagram: bytes) -> tuple[list[Frame], list[Fault]]:
    """Find and check the frames of one datagram.

    After a fault the search goes on at the next start marker: whole frames after a corrupt one
    are taken. A stretch of unusable bytes counts as one fault, named after its beginning.
    """
    if not datagram:
        return [], [Fault("not_mavlink", "It is empty")]
    frames: list[Frame] = []
    faults: list[Fault] = []
    position = 0
    resyncs = 0
    at_boundary = True
    while position < len(datagram):
        found = _frame_at(datagram, position, at_boundary)
        if isinstance(found, Frame):
            frames.append(found)
            position += len(found.raw)
            at_boundary = True
            continue
        if at_boundary:
            faults.append(found)
            at_boundary = False
        resyncs += 1
        marker = _MARKER.search(datagram, position + 1)
        if marker is None or resyncs > _MAX_RESYNCS:
            break
        position = marker.start()
    return frames, faults


def end_of_whole_frames(data: bytes) -> int:
    """Where in a stream's bytes the first incomplete frame begins.

    Bytes that cannot be a frame are passed over, as in :func:`split`. A start marker among them
    counts as the beginning of a frame until at most 280 bytes have shown that it is none.

    Returns:
        Its index; the number of bytes if no frame is incomplete.
    """
    position = 0
    at_boundary = True
    while position < len(data):
        found = _frame_at(data, position, at_boundary)
        if isinstance(found, Frame):
            position += len(found.raw)
            at_boundary = True
            continue
        if found.kind == "truncated":
            return position
        at_boundary = False
        marker = _MARKER.search(data, position + 1)
        if marker is None:
            break
        position = marker.start()
    return len(data)


def target_of(frame: Frame) -> int:
    """System id that a frame is addressed to; 0 for everybody."""
    place = _TARGET_PLACES.get(frame.message_id)
    if place is None or place >= len(frame.payload):  # MAVLink 2 cuts trailing zeros
        return 0
    return frame.payload[place]


class Framer:
    """Cuts the stream of a TCP connection or serial line between frames.

    What it returns can be treated as a datagram: it holds whole frames, and the bytes between
    them, for :func:`split` to check and to count. It keeps the beginning of an incomplete frame,
    at most 280 bytes. A connection that is opened anew needs a new framer.
    """

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> bytes:
        """Take the bytes that were read; returns the complete ones, perhaps none."""
        data = self._rest + data
        end = end_of_whole_frames(data)
        self._rest = data[end:]
        return data[:end]


def _frame_at(data: bytes, start: int, at_boundary: bool) -> Frame | Fault:
    """The frame that begins at ``start``.

    A message that is unknown to the dialect has no checksum seed. Its frame is taken if it lies
    between frame boundaries, because its sequence number counts.
    """
    marker = data[start]
    left = len(data) - start
    tail = 2
    if marker == mavlink.PROTOCOL_MARKER_V2:
        if left < 12:
            return Fault("truncated", f"Only {left} bytes of a frame's header are there")
        length, flags, seq, sysid, compid, id_low, id_high = _HEADER_V2.unpack_from(data, start)
        message_id = id_low | id_high << 16
        body = start + 10
        if flags:
            if flags != _SIGNED:
                return Fault("unsupported_flags", f"Incompatibility flags {flags:#04x} are unknown")
            tail += mavlink.MAVLINK_SIGNATURE_BLOCK_LEN
    elif marker == mavlink.PROTOCOL_MARKER_V1:
        if left < 8:
            return Fault("truncated", f"Only {left} bytes of a frame's header are there")
        length, seq, sysid, compid, message_id = _HEADER_V1.unpack_from(data, start)
        body = start + 6
    else:
        return Fault("not_mavlink", f"It has {marker:#04x} where a frame should start")
    body_end = body + length
    end = body_end + tail
    if end > len(data):
        return Fault("truncated", f"A frame of {end - start} bytes ends after {left}")
    crc_extra = _CRC_EXTRA.get(message_id)
    if crc_extra is None:
        if not at_boundary or (end < len(data) and _MARKER.match(data, end) is None):
            return Fault("unknown_message", f"What may be message {message_id} is unknown")
    elif (
        mavlink.x25crc(data[start + 1 : body_end] + crc_extra).crc
        != data[body_end] | data[body_end + 1] << 8
    ):
        return Fault("bad_crc", f"A frame with message id {message_id} has a wrong checksum")
    return Frame(data[start:end], sysid, compid, seq, message_id, data[body:body_end])
