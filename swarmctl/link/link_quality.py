"""How well a vehicle is heard: messages, losses by sequence number, rate."""

from __future__ import annotations

from swarmctl.events import LinkQuality
from swarmctl.link.vehicle_clock import BootClock, RoundTrips

_WINDOW = 64
"""How many of the newest messages are remembered one by one."""
_WINDOW_MASK = (1 << _WINDOW) - 1


class LinkStatistics:
    """Counts the messages of one component by their MAVLink sequence numbers.

    A skipped number counts as lost until it arrives late; a repeated number changes nothing. A
    number up to 127 ahead means losses, a number up to 63 behind is late, and any other means
    that the sender has started anew.

    Attributes:
        messages_in: Messages counted.
        lost: Messages missing.
    """

    def __init__(self, now: float) -> None:
        self.messages_in = 0
        self.lost = 0
        self._next_seq = -1
        # Bit k: the message k before the newest has come.
        self._received = 0
        self._reported = 0
        self._reported_s = now

    def count(self, seq: int) -> None:
        """Count a message with its sequence number, 0..255."""
        self.messages_in += 1
        if seq == self._next_seq:
            self._received = (self._received << 1 | 1) & _WINDOW_MASK
            self._next_seq = (seq + 1) & 0xFF
        else:
            self._count_out_of_order(seq)

    def _count_out_of_order(self, seq: int) -> None:
        ahead = (seq - self._next_seq) & 0xFF
        behind = 0xFF - ahead
        if self._next_seq < 0 or (ahead >= 128 and behind >= _WINDOW):
            self._received = _WINDOW_MASK
            self._next_seq = (seq + 1) & 0xFF
        elif ahead < 128:
            self.lost += ahead
            self._received = (self._received << (ahead + 1) | 1) & _WINDOW_MASK
            self._next_seq = (seq + 1) & 0xFF
        elif not self._received >> behind & 1:
            self.lost -= 1
            self._received |= 1 << behind

    def report(
        self, sysid: int, now: float, clock: BootClock, round_trips: RoundTrips
    ) -> LinkQuality:
        """The counts so far, the rate since the last report (or the start), and the clocks.

        Args:
            sysid: System id of the sender.
            now: Monotonic time, s.
            clock: Its time since boot against UTC.
            round_trips: Its time since boot against ours.
        """
        elapsed_s = now - self._reported_s
        rate_hz = (self.messages_in - self._reported) / elapsed_s if elapsed_s > 0.0 else 0.0
        self._reported = self.messages_in
        self._reported_s = now
        boot_offset_s, boot_offset_error_s = round_trips.boot_offset_s or (None, None)
        return LinkQuality(
            received_s=now,
            sysid=sysid,
            messages_in=self.messages_in,
            lost=self.lost,
            rate_hz=rate_hz,
            rtt_s=round_trips.latest_s,
            boot_offset_s=boot_offset_s,
            boot_offset_error_s=boot_offset_error_s,
            utc_error_s=clock.error_s,
        )
