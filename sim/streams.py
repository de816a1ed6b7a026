"""Which messages an autopilot sends unasked, and when."""

from __future__ import annotations

import math

from sim.mavlink import dialect

DEFAULT_INTERVALS_S = {dialect.MAVLINK_MSG_ID_HEARTBEAT: 1.0}
"""As in ArduCopter everything but HEARTBEAT is off until asked for."""

MIN_INTERVAL_S, MAX_INTERVAL_S = 1e-3, 60.0

_EARLY_S = 1e-6


class Streams:
    """The message intervals of one link.

    Due times are kept on the interval's own grid, so that the mean rate is exact; no message
    comes more than once in a call of :meth:`due`.

    Args:
        start_s: Simulation time of power-up, when the defaults are first due, s.
    """

    __slots__ = ("_due_s", "_interval_s", "_next_s")

    def __init__(self, start_s: float) -> None:
        self._interval_s = dict(DEFAULT_INTERVALS_S)
        self._due_s = dict.fromkeys(DEFAULT_INTERVALS_S, start_s)
        self._next_s = start_s

    def set_interval(self, message_id: int, interval_us: float, now_s: float) -> None:
        """Take the interval of MAV_CMD_SET_MESSAGE_INTERVAL.

        Args:
            message_id: A message that can be sent.
            interval_us: Interval, µs; 0 restores the default, negative turns it off.
            now_s: Simulation time, s.
        """
        if interval_us > 0.0:
            interval_s = min(max(interval_us * 1e-6, MIN_INTERVAL_S), MAX_INTERVAL_S)
        else:
            interval_s = DEFAULT_INTERVALS_S.get(message_id, 0.0) if interval_us == 0.0 else 0.0
        self._interval_s.pop(message_id, None)
        self._due_s.pop(message_id, None)
        if interval_s > 0.0:
            self._interval_s[message_id] = interval_s
            self._due_s[message_id] = now_s + interval_s
        self._next_s = min(self._due_s.values(), default=math.inf)

    def due(self, now_s: float) -> list[int]:
        """Ids of the messages due at a simulation time (s), each counted as sent."""
        if now_s < self._next_s - _EARLY_S:
            return []
        messages = []
        for message_id, due_s in self._due_s.items():
            if due_s <= now_s + _EARLY_S:
                messages.append(message_id)
                self._due_s[message_id] = due_s + self._interval_s[message_id]
        self._next_s = min(self._due_s.values(), default=math.inf)
        return messages
