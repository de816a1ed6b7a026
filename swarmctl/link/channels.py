"""Where the vehicles are spoken to: one encoder per address, and who is called unasked."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

from swarmctl.link.codec.encoding import Encoder
from swarmctl.link.codec.messages import Address
from swarmctl.link.signing import Signing

SILENT_LINK_S = 10.0
"""An endpoint on which nothing sound was heard this long after its opening is named."""

_TIMESYNC_PERIODS = 2
"""TIMESYNC is asked for with every so many of our heartbeats."""
_ASKED_KEPT = 8
"""Questions at one address that an answer may still come to."""


class Channels:
    """The addresses of one link.

    Args:
        gcs_sysid: Our own system id.
        signing: Signs what is sent; None without a key.
    """

    def __init__(self, gcs_sysid: int, signing: Signing | None) -> None:
        self._gcs_sysid = gcs_sysid
        self._signing = signing
        # One per address, because sequence numbers count per channel.
        self._encoders: dict[Address, Encoder] = {}
        self._called: list[Address] = []
        # Endpoints on which nothing was heard yet: their URLs, and when to say so.
        self._unheard: dict[int, tuple[str, float]] = {}
        self._asked_ns: dict[Address, deque[int]] = {}
        self._periods = 0

    def encoder(self, address: Address) -> Encoder:
        """What writes our frames to an address."""
        if address not in self._encoders:
            link_id = len(self._encoders) & 0xFF
            self._encoders[address] = Encoder(self._gcs_sysid, self._signing, link_id)
        return self._encoders[address]

    def call(self, address: Address) -> None:
        """Send heartbeats to an address before anybody was heard there."""
        self.hang_up(address)
        self._called.append(address)

    def hang_up(self, address: Address) -> None:
        """Call an address no longer."""
        if address in self._called:
            self._called.remove(address)

    def listen(self, urls: Sequence[str], now: float) -> None:
        """Watch endpoints for silence; the place of each URL is its addresses' ``endpoint``."""
        self._unheard = {i: (url, now + SILENT_LINK_S) for i, url in enumerate(urls)}

    def heard(self, address: Address) -> None:
        """Something sound came from an address."""
        if self._unheard:
            self._unheard.pop(address.endpoint, None)

    def silent(self, now: float) -> list[str]:
        """URLs of the endpoints on which nothing was heard for too long, each once."""
        late = [i for i, (_, deadline_s) in self._unheard.items() if now >= deadline_s]
        return [self._unheard.pop(i)[0] for i in late]

    def period(self, vehicles: Iterable[Address], now: float) -> list[tuple[bytes, Address]]:
        """What is sent once a second: our heartbeat, and sometimes a question for the time.

        Args:
            vehicles: Where vehicles are.
            now: Monotonic time, s.
        """
        there = dict.fromkeys(vehicles)
        everywhere = dict.fromkeys((*there, *self._called))
        frames = [(self.encoder(address).heartbeat(), address) for address in everywhere]
        if self._periods % _TIMESYNC_PERIODS == 0:
            asked_ns = round(now * 1e9)
            for address in there:
                self._asked_ns.setdefault(address, deque(maxlen=_ASKED_KEPT)).append(asked_ns)
                frames.append((self.encoder(address).timesync(asked_ns), address))
        self._periods += 1
        return frames

    def has_asked(self, address: Address, asked_ns: int) -> bool:
        """Whether a TIMESYNC answers a question of ours: other stations ask, too."""
        return asked_ns in self._asked_ns.get(address, ())
