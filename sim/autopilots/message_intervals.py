"""Which messages a simulated autopilot sends by itself, and at which rates."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim.mavlink import dialect

MIN_INTERVAL_S, MAX_INTERVAL_S = 5e-3, 60.0

_EARLY_S = 1e-6

ARDUPILOT = {
    dialect.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    dialect.MAVLINK_MSG_ID_TIMESYNC: 10.0,
}
"""Interval of each message that ArduCopter sends unasked, s."""
PX4 = {
    dialect.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 1.0 / 50.0,
    dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 1.0 / 30.0,
    dialect.MAVLINK_MSG_ID_ATTITUDE: 1.0 / 20.0,
    dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 1.0 / 20.0,
    dialect.MAVLINK_MSG_ID_TIMESYNC: 1.0 / 10.0,
    dialect.MAVLINK_MSG_ID_VFR_HUD: 1.0 / 10.0,
    dialect.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0 / 5.0,
    dialect.MAVLINK_MSG_ID_SYS_STATUS: 1.0 / 5.0,
    dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0 / 5.0,
    dialect.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
    dialect.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
    dialect.MAVLINK_MSG_ID_BATTERY_STATUS: 2.0,
    dialect.MAVLINK_MSG_ID_HOME_POSITION: 2.0,
}
"""Interval of each message that PX4 sends unasked on its onboard link, s."""
STREAM_GROUPS = {
    dialect.MAV_DATA_STREAM_RAW_SENSORS: (),
    dialect.MAV_DATA_STREAM_EXTENDED_STATUS: (
        dialect.MAVLINK_MSG_ID_MISSION_CURRENT,
        dialect.MAVLINK_MSG_ID_SYS_STATUS,
        dialect.MAVLINK_MSG_ID_GPS_RAW_INT,
    ),
    dialect.MAV_DATA_STREAM_RC_CHANNELS: (),
    dialect.MAV_DATA_STREAM_POSITION: (
        dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    ),
    dialect.MAV_DATA_STREAM_EXTRA1: (dialect.MAVLINK_MSG_ID_ATTITUDE,),
    dialect.MAV_DATA_STREAM_EXTRA2: (dialect.MAVLINK_MSG_ID_VFR_HUD,),
    dialect.MAV_DATA_STREAM_EXTRA3: (
        dialect.MAVLINK_MSG_ID_SYSTEM_TIME,
        dialect.MAVLINK_MSG_ID_BATTERY_STATUS,
        dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    ),
}
"""The messages of each group of REQUEST_DATA_STREAM."""


class MessageIntervals:
    """Intervals and due times of one vehicle's messages.

    Due times stay on the interval's own grid, so that the mean rate is exact. A message that is
    due more often than :meth:`due` is called comes several times at once.

    Args:
        start_s: Simulation time at which the defaults are first due, s.
        defaults_s: Interval of each message that is sent unasked, s.
    """

    __slots__ = ("_defaults_s", "_due_s", "_interval_s", "_next_s")

    def __init__(self, start_s: float, defaults_s: Mapping[int, float]) -> None:
        self._defaults_s = defaults_s
        self._interval_s = dict(defaults_s)
        self._due_s = dict.fromkeys(defaults_s, start_s)
        self._next_s = start_s

    def set_interval(self, message_id: int, interval_us: float, now_s: float) -> None:
        """Set an interval, as MAV_CMD_SET_MESSAGE_INTERVAL does.

        Args:
            message_id: A message that can be sent.
            interval_us: Interval, µs; 0 restores the default, a negative one turns it off.
            now_s: Simulation time, s.
        """
        if interval_us > 0.0:
            interval_s = min(max(interval_us * 1e-6, MIN_INTERVAL_S), MAX_INTERVAL_S)
        else:
            interval_s = self._defaults_s.get(message_id, 0.0) if interval_us == 0.0 else 0.0
        self._interval_s.pop(message_id, None)
        self._due_s.pop(message_id, None)
        if interval_s > 0.0:
            self._interval_s[message_id] = interval_s
            self._due_s[message_id] = now_s + interval_s
        self._next_s = min(self._due_s.values(), default=math.inf)

    def due(self, now_s: float) -> list[int]:
        """Ids of the messages due at a simulation time (s); each counts as sent."""
        if now_s < self._next_s - _EARLY_S:
            return []
        messages = []
        for message_id, due_s in self._due_s.items():
            following_s = due_s
            while following_s <= now_s + _EARLY_S:
                messages.append(message_id)
                following_s += self._interval_s[message_id]
            self._due_s[message_id] = following_s
        self._next_s = min(self._due_s.values(), default=math.inf)
        return messages
