"""What is sent once a second: our heartbeat, and a question for each vehicle's clock."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from swarmctl.link.address import Address
from swarmctl.link.codec.encoding import Encoders

_TIMESYNC_PERIODS = 2
"""TIMESYNC is asked for once in so many periods."""
_ASKED_KEPT = 8
"""Questions at one address that may still be answered."""


class Heartbeats:
    """Our heartbeat and TIMESYNC questions, to every address of one link.

    Args:
        encoders: Write our frames.
    """

    def __init__(self, encoders: Encoders) -> None:
        self._encoders = encoders
        self._called: list[Address] = []
        self._asked_ns: dict[Address, deque[int]] = {}
        self._periods = 0

    def call(self, address: Address) -> None:
        """Send heartbeats to an address before anybody was heard there."""
        self.hang_up(address)
        self._called.append(address)

    def hang_up(self, address: Address) -> None:
        """Stop calling an address."""
        if address in self._called:
            self._called.remove(address)

    def period(self, vehicles: Iterable[Address], now: float) -> list[tuple[bytes, Address]]:
        """Frames to send now, and where to.

        Args:
            vehicles: Where vehicles are.
            now: Monotonic time, s.
        """
        there = dict.fromkeys(vehicles)
        everywhere = dict.fromkeys((*there, *self._called))
        frames = [(self._encoders.to(address).heartbeat(), address) for address in everywhere]
        if self._periods % _TIMESYNC_PERIODS == 0:
            asked_ns = round(now * 1e9)
            for address in there:
                self._asked_ns.setdefault(address, deque(maxlen=_ASKED_KEPT)).append(asked_ns)
                frames.append((self._encoders.to(address).timesync(asked_ns), address))
        self._periods += 1
        return frames

    def has_asked(self, address: Address, asked_ns: int) -> bool:
        """Whether a TIMESYNC answers a question of ours: other stations ask, too."""
        return asked_ns in self._asked_ns.get(address, ())
