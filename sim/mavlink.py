"""The MAVLink 2 codec of the simulated vehicles, on pymavlink, not the controller's."""

from __future__ import annotations

from typing import Any, TypeAlias

from pymavlink.dialects.v20 import ardupilotmega as dialect

__all__ = [
    "ACCEPTED",
    "AUTOPILOT_COMPONENT",
    "DENIED",
    "FAILED",
    "TEMPORARILY_REJECTED",
    "UNSUPPORTED",
    "Codec",
    "Message",
    "dialect",
]

Message: TypeAlias = Any
"""A pymavlink message object; pymavlink ships no type information."""

AUTOPILOT_COMPONENT: int = dialect.MAV_COMP_ID_AUTOPILOT1

ACCEPTED: int = dialect.MAV_RESULT_ACCEPTED
TEMPORARILY_REJECTED: int = dialect.MAV_RESULT_TEMPORARILY_REJECTED
DENIED: int = dialect.MAV_RESULT_DENIED
UNSUPPORTED: int = dialect.MAV_RESULT_UNSUPPORTED
FAILED: int = dialect.MAV_RESULT_FAILED


SIGNING_EPOCH_UTC_S = 1_420_070_400
"""2015-01-01T00:00:00 UTC, the zero of signature timestamps."""
SIGNING_UNITS_PER_S = 100_000


class _Outbox:
    """The file that pymavlink writes to: one entry per message."""

    __slots__ = ("datagrams", "write")

    def __init__(self) -> None:
        self.datagrams: list[bytes] = []
        self.write = self.datagrams.append


class Codec:
    """Encodes and decodes for one vehicle.

    Args:
        sysid: System id to send as.
        signing_key: Key of 32 bytes that signs what is sent; what is received without its
            signature is dropped (https://mavlink.io/en/guide/message_signing.html). None for no
            signing.
    """

    __slots__ = ("_mav", "_outbox")

    def __init__(self, sysid: int, signing_key: bytes | None = None) -> None:
        self._outbox = _Outbox()
        self._mav = dialect.MAVLink(self._outbox, srcSystem=sysid, srcComponent=AUTOPILOT_COMPONENT)
        self._mav.robust_parsing = True
        self._mav.signing.secret_key = signing_key
        self._mav.signing.sign_outgoing = signing_key is not None

    def advance(self, utc_s: float) -> None:
        """Set the timestamp of signatures to a UTC (s), unless that would turn it back."""
        units = int((utc_s - SIGNING_EPOCH_UTC_S) * SIGNING_UNITS_PER_S)
        self._mav.signing.timestamp = max(self._mav.signing.timestamp, units)

    def send(self, message: Message) -> None:
        """Queue a message as a datagram of its own."""
        # Only send() increments the sequence number; pack() does not.
        self._mav.send(message)

    def drain(self) -> list[bytes]:
        """The datagrams queued since the last call, in order."""
        datagrams = self._outbox.datagrams[:]
        self._outbox.datagrams.clear()
        return datagrams

    def decode(self, datagram: bytes) -> list[Message]:
        """The well-formed, known messages in a datagram; the rest is dropped."""
        mav = self._mav
        # Messages do not span datagrams: the rest of a truncated one must not swallow the
        # beginning of the next.
        mav.buf = bytearray()
        mav.buf_index = 0
        messages = mav.parse_buffer(datagram) or ()  # None where nothing was complete
        return [
            message
            for message in messages
            if not isinstance(message, dialect.MAVLink_bad_data | dialect.MAVLink_unknown)
        ]
