"""The side of a vehicle link that faces the sockets: datagrams in, datagrams out, no I/O.

Whoever holds the sockets moves the bytes: :mod:`swarmctl.ops.live` over UDP, TCP and serial
lines, :mod:`swarmctl.ops.in_memory` through lists.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from swarmctl.link.address import Address


class DatagramPort(Protocol):
    """Takes the datagrams that arrive, and hands out those to send.

    The caller drains :meth:`datagrams` and :meth:`traffic` after every call of the port or of
    its link. All times are monotonic seconds.

    An endpoint that listens (``udpin``) needs no :meth:`open`. One that calls (``udpout``, TCP,
    a serial line) is announced by it: our heartbeat is sent there before anybody was heard,
    because the other side may not know of us.
    """

    def listen(self, urls: Sequence[str], now: float) -> None:
        """Take note that endpoints were opened: an endpoint that stays silent is named once.

        Args:
            urls: Their URLs. The place of each is the ``endpoint`` of its addresses.
            now: Monotonic time, s.
        """

    def open(self, address: Address, now: float) -> None:
        """Send our heartbeat from now on to an endpoint that calls: it is connected."""

    def close(self, address: Address) -> None:
        """Stop sending our heartbeat to an endpoint: its connection was lost."""

    def receive_datagram(self, data: bytes, address: Address, now: float) -> None:
        """Take a datagram, or whole frames of a stream, that came from an address."""

    def datagrams(self) -> list[tuple[bytes, Address]]:
        """Drain what is to be sent, and where to."""

    def traffic(self) -> list[tuple[float, bytes]]:
        """Drain every sound frame received or sent, with its time, for the recording."""
