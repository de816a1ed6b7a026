"""A vehicle's time since boot, mapped to UTC and to our time, each with its uncertainty."""

from __future__ import annotations

import math
from collections import deque

from swarmctl.frames import sped_up_utc_s

_REORDERING_S = 2.0
"""Packets overtake each other by less than this; boot time further back means a reboot."""
_PAIRS = 10
"""Number of SYSTEM_TIMEs from which the uncertainty is taken."""
_BOOT_RESOLUTION_S = 1e-3
"""SYSTEM_TIME cuts the boot time to the millisecond."""
_JUDGED_AFTER_S = 1.5
"""Time since boot after which the rate of a vehicle's UTC is judged, s."""
_ROUND_TRIPS = 10
"""Number of round trips among which the shortest is chosen."""


class BootClock:
    """Offset between UTC and one vehicle's time since boot, from its SYSTEM_TIME.

    Both times of a SYSTEM_TIME belong to one instant of the vehicle, so the link's delay does
    not matter; the error is the millisecond to which the boot time is cut. The latest pair
    counts: it follows the drift of the vehicle's oscillator and a step of its UTC.

    A simulator with a speed-up may tell simulated UTC, as ArduPilot's SITL does, or the
    computer's, as PX4's does. The rate of UTC against the time since boot shows which it is, and
    that holds until the vehicle boots again. The computer's UTC is then sped up
    (:func:`swarmctl.frames.sped_up_utc_s`). Between two pairs, the slope of the last pairs follows
    a simulator that runs somewhat slower or faster than it should.

    Args:
        speedup: Seconds of the controller's time in a second of the computer's.
    """

    def __init__(self, speedup: float = 1.0) -> None:
        self._speedup = speedup
        self._pairs: deque[tuple[float, float]] = deque(maxlen=_PAIRS)
        self._boot_s = 0.0
        self._is_sped_up = None if speedup != 1.0 else False

    def update(self, utc_s: float, boot_s: float) -> None:
        """Take the two times (s) of one SYSTEM_TIME; an overtaken one is ignored."""
        if not self._boot_s - _REORDERING_S <= boot_s < self._boot_s:
            if boot_s < self._boot_s:
                self._forget()
            self._pairs.append((boot_s, utc_s))
            self._boot_s = boot_s
            if self._is_sped_up is None:
                self._judge()

    def to_utc(self, boot_s: float) -> float | None:
        """UTC (s) of a time since boot (s), sped up where the class says so.

        None until a SYSTEM_TIME has come since the last boot, at a speed-up until several have.
        A boot time well before the last SYSTEM_TIME shows a reboot: then the offset is dropped.
        """
        if not self._pairs or self._is_sped_up is None:
            return None
        if boot_s < self._boot_s - _REORDERING_S:
            self._forget()
            self._boot_s = 0.0
            return None
        last_boot_s, last_utc_s = self._pairs[-1]
        return self._base(last_utc_s) + (boot_s - last_boot_s) * self._slope

    @property
    def error_s(self) -> float | None:
        """How far the mapping may be off, s; None while there is none.

        It is the greatest disagreement among the last pairs, but at least the resolution of the
        boot time. An error of the vehicle's UTC itself does not show.
        """
        if not self._pairs or self._is_sped_up is None:
            return None
        slope = self._slope
        offsets_s = [self._base(utc_s) - slope * boot_s for boot_s, utc_s in self._pairs]
        return max(_BOOT_RESOLUTION_S, max(offsets_s) - min(offsets_s))

    @property
    def _slope(self) -> float:
        """Seconds of the time base per second of the time since boot."""
        if not self._is_sped_up:
            return 1.0
        (first_boot_s, first_utc_s), (last_boot_s, last_utc_s) = self._pairs[0], self._pairs[-1]
        if last_boot_s == first_boot_s:
            return 1.0
        return self._speedup * (last_utc_s - first_utc_s) / (last_boot_s - first_boot_s)

    def _base(self, utc_s: float) -> float:
        return sped_up_utc_s(utc_s, self._speedup) if self._is_sped_up else utc_s

    def _judge(self) -> None:
        """Find out whether UTC runs at the rate of the time since boot or of the computer."""
        (first_boot_s, first_utc_s), (last_boot_s, last_utc_s) = self._pairs[0], self._pairs[-1]
        if last_boot_s - first_boot_s >= _JUDGED_AFTER_S and last_utc_s > first_utc_s:
            rate = (last_boot_s - first_boot_s) / (last_utc_s - first_utc_s)
            self._is_sped_up = abs(math.log(rate / self._speedup)) < abs(math.log(rate))

    def _forget(self) -> None:
        self._pairs.clear()
        self._is_sped_up = None if self._speedup != 1.0 else False


class RoundTrips:
    """Latency of a link, and a vehicle's time since boot against ours, from TIMESYNC.

    The vehicle answers between our question and the arrival of its answer: its clock read what
    it says at the middle of the two, give or take half the round trip. The shortest of the last
    round trips is the most certain (the minimum filter of NTP, RFC 5905, section 10).
    """

    def __init__(self) -> None:
        self._trips: deque[tuple[float, float]] = deque(maxlen=_ROUND_TRIPS)

    def add(self, asked_s: float, boot_s: float, answered_s: float) -> None:
        """Take an answer.

        Args:
            asked_s: Our monotonic time when we asked, s.
            boot_s: The vehicle's time since boot when it answered, s.
            answered_s: Our monotonic time when its answer arrived, s.
        """
        trip_s = answered_s - asked_s
        offset_s = boot_s - (asked_s + answered_s) / 2.0
        if self._trips:
            best_trip_s, best_offset_s = min(self._trips)
            if abs(offset_s - best_offset_s) > (trip_s + best_trip_s) / 2.0 + _BOOT_RESOLUTION_S:
                self._trips.clear()  # it has booted again
        self._trips.append((trip_s, offset_s))

    @property
    def latest_s(self) -> float | None:
        """The latest round trip, s; None before the first."""
        return self._trips[-1][0] if self._trips else None

    @property
    def boot_offset_s(self) -> tuple[float, float] | None:
        """The vehicle's time since boot less our monotonic time, and its possible error, s.

        None before the first answer.
        """
        if not self._trips:
            return None
        trip_s, offset_s = min(self._trips)
        return offset_s, trip_s / 2.0
