"""What the simulated ArduCopter does when it loses its ground station, battery or GPS."""

from __future__ import annotations

from collections.abc import Callable

from sim.autopilots.ardupilot_modes import AUTO, BRAKE, GUIDED, LAND, LOITER, POSHOLD, RTL
from sim.autopilots.flight_modes import FlightMode
from sim.autopilots.onboard_state import OnboardState
from sim.mavlink import dialect

GPS_LOSS_S = 8.0
"""It lands after this long without GPS, s."""

GCS_ACTIONS = {1: RTL, 2: RTL, 3: RTL, 4: LAND, 5: LAND, 7: BRAKE}
"""By FS_GCS_ENABLE. It has no SmartRTL: where that comes first, this is the second choice."""
BATTERY_ACTIONS = {1: LAND, 2: RTL, 3: RTL, 4: LAND}
"""By BATT_FS_LOW_ACT and BATT_FS_CRT_ACT, without SmartRTL as above."""

_NEED_POSITION = {AUTO, GUIDED, LOITER, RTL, POSHOLD, BRAKE}


class ArduPilotFailsafes:
    """The failsafes of one ArduCopter, its fence apart.

    Args:
        onboard: State of the autopilot.
        say: Sends a STATUSTEXT of a severity.
        enter: Changes the flight mode.
    """

    def __init__(
        self,
        onboard: OnboardState,
        say: Callable[[str, int], None],
        enter: Callable[[FlightMode], int],
    ) -> None:
        self._me = onboard
        self._say = say
        self._enter = enter
        self._gcs_lost = self._battery_low = self._battery_critical = False
        self._low_since_s: float | None = None
        self._critical_since_s: float | None = None
        self._gps_lost_since_s: float | None = None

    @property
    def active(self) -> bool:
        """Whether a failsafe that HEARTBEAT shows has acted and its cause lasts."""
        return self._gcs_lost or self._battery_low or self._battery_critical

    def watch(self, gcs_silent_s: float) -> None:
        """Act on what fails, once per step.

        Args:
            gcs_silent_s: Time since the ground station was last heard, s; 0 if it never was.
        """
        self._watch_gcs(gcs_silent_s)
        self._watch_battery()
        self._watch_gps()

    def _watch_gcs(self, silent_s: float) -> None:
        parameters = self._me.parameters
        enabled = int(parameters["FS_GCS_ENABLE"])
        lost = enabled != 0 and silent_s > parameters["FS_GCS_TIMEOUT"]
        if lost and not self._gcs_lost and self._me.armed:
            self._fail(GCS_ACTIONS.get(enabled), "GCS Failsafe")
        elif self._gcs_lost and not lost:
            self._say("GCS Failsafe Cleared", dialect.MAV_SEVERITY_WARNING)
        self._gcs_lost = lost and (self._gcs_lost or self._me.armed)

    def _watch_battery(self) -> None:
        me, battery, parameters = self._me, self._me.battery, self._me.parameters
        voltage_v, left_mah = battery.voltage_v, battery.left_mah
        low = voltage_v < parameters["BATT_LOW_VOLT"] or left_mah < parameters["BATT_LOW_MAH"]
        critical = voltage_v < parameters["BATT_CRT_VOLT"] or left_mah < parameters["BATT_CRT_MAH"]
        self._low_since_s = _since(self._low_since_s, low, me.now_s)
        self._critical_since_s = _since(self._critical_since_s, critical, me.now_s)
        timer_s = parameters["BATT_LOW_TIMER"]
        if not me.armed:
            self._battery_low = self._battery_critical = False
            return
        if not self._battery_critical and _for(self._critical_since_s, me.now_s, timer_s):
            self._battery_critical = self._battery_low = True
            action = BATTERY_ACTIONS.get(int(parameters["BATT_FS_CRT_ACT"]))
            self._fail(action, "Battery 1 is critical")
        if not self._battery_low and _for(self._low_since_s, me.now_s, timer_s):
            self._battery_low = True
            self._fail(BATTERY_ACTIONS.get(int(parameters["BATT_FS_LOW_ACT"])), "Battery 1 is low")

    def _watch_gps(self) -> None:
        me = self._me
        lost = me.armed and not me.gps_ok
        self._gps_lost_since_s = _since(self._gps_lost_since_s, lost, me.now_s)
        if me.mode in _NEED_POSITION and _for(self._gps_lost_since_s, me.now_s, GPS_LOSS_S):
            self._fail(LAND, "EKF Failsafe: changed to LAND Mode")

    def _fail(self, mode: FlightMode | None, text: str) -> None:
        """Say what failed and enter a mode; on the ground, disarm instead."""
        self._say(text, dialect.MAV_SEVERITY_CRITICAL)
        if mode is None:
            return
        if self._me.landed:
            self._me.armed = False
        elif self._me.mode is not LAND:
            self._enter(mode)


def _since(since_s: float | None, holds: bool, now_s: float) -> float | None:
    """Simulation time since which something holds, s; None while it does not."""
    if not holds:
        return None
    return now_s if since_s is None else since_s


def _for(since_s: float | None, now_s: float, duration_s: float) -> bool:
    """Whether something has held for a duration (s)."""
    return since_s is not None and now_s - since_s >= duration_s
