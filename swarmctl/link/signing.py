"""MAVLink 2 message signing: which frames are trusted (no I/O).

https://mavlink.io/en/guide/message_signing.html. The signature is the first 48 bits of the SHA-256
of the key, the frame, the link id and the timestamp, which counts 10 us since 2015-01-01 UTC.
:mod:`swarmctl.link.codec.encoding` writes our own signatures by pymavlink. Received ones are
checked here and not by pymavlink, which remembers the timestamp of a frame before it has checked
the signature: one forged frame from the far future would silence its vehicle.
"""

from __future__ import annotations

import hashlib
import hmac

from swarmctl.link.codec.messages import Fault, Frame

UNITS_PER_S = 100_000
"""A timestamp counts units of 10 us."""
EPOCH_UTC_S = 1_420_070_400
"""2015-01-01T00:00:00 UTC, where timestamps count from."""
MAX_AGE = 60 * UNITS_PER_S
"""The first frame of a stream may be this far behind our own timestamp."""

_MAVLINK_2 = 0xFD
_IS_SIGNED = 0x01
_BLOCK = 13  # link id, timestamp, signature
_SIGNATURE = 6
_RADIO_STATUS = 109
# A stream is remembered only after a frame with a right signature.
_Stream = tuple[int, int, int]


def timestamp_at(utc_s: float) -> int:
    """Timestamp of an instant (UTC s)."""
    return max(0, int((utc_s - EPOCH_UTC_S) * UNITS_PER_S))


class Signing:
    """One key, our own timestamp, and the newest timestamp of every stream.

    Args:
        key: The secret key, 32 bytes.
        timestamp: First timestamp we may use: greater than any used before.
        utc_offset_s: UTC less the caller's monotonic time, s.

    Attributes:
        key: As above.
        timestamp: The next timestamp to sign with.
    """

    def __init__(self, key: bytes, timestamp: int, utc_offset_s: float) -> None:
        self.key = key
        self.timestamp = timestamp
        self._utc_offset_s = utc_offset_s
        self._newest: dict[_Stream, int] = {}

    def advance(self, now: float) -> None:
        """Let our timestamp follow UTC; it never runs backwards.

        Args:
            now: Monotonic time, s.
        """
        self.timestamp = max(self.timestamp, timestamp_at(now + self._utc_offset_s))

    def next_timestamp(self) -> int:
        """A timestamp for one frame; never the same twice."""
        self.timestamp += 1
        return self.timestamp - 1

    def check(self, frame: Frame) -> Fault | None:
        """Check a frame's signature and timestamp.

        RADIO_STATUS is let through unsigned, as is customary: a telemetry radio sends it and
        has no key. It says nothing about a vehicle.

        Returns:
            None if the frame is trusted; else a fault of kind ``unsigned``, ``wrongly_signed``
            or ``replayed``. A frame that was overtaken by a later one of its stream counts as
            replayed.
        """
        raw = frame.raw
        said = f"message {frame.message_id} of system {frame.sysid}"
        if raw[0] != _MAVLINK_2 or not raw[2] & _IS_SIGNED:
            if frame.message_id == _RADIO_STATUS:
                return None
            return Fault(
                "unsigned",
                f"It holds {said} without a signature, but swarm.signing_key_file asks for one",
            )
        signature = hashlib.sha256(self.key + raw[:-_SIGNATURE]).digest()[:_SIGNATURE]
        if not hmac.compare_digest(signature, raw[-_SIGNATURE:]):
            return Fault("wrongly_signed", f"It holds {said}, signed with another key")
        stream = (frame.sysid, frame.compid, raw[-_BLOCK])
        timestamp = int.from_bytes(raw[1 - _BLOCK : -_SIGNATURE], "little")
        newest = self._newest.get(stream)
        if newest is not None and timestamp <= newest:
            behind_s = (newest - timestamp) / UNITS_PER_S
            return Fault("replayed", f"It holds {said}, signed {behind_s:.2f} s before the last")
        if newest is None and timestamp < self.timestamp - MAX_AGE:
            behind_s = (self.timestamp - timestamp) / UNITS_PER_S
            return Fault(
                "replayed",
                f"It holds {said}, signed {behind_s:.0f} s ago by our clock: a recording, or a "
                f"vehicle that has had no GPS time yet",
            )
        self._newest[stream] = timestamp
        self.timestamp = max(self.timestamp, timestamp)
        return None
