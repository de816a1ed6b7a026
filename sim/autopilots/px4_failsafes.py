"""What the simulated PX4 does when it loses setpoints, ground station, battery or GPS.

Its fence is among them: PX4 handles a breach like any other failsafe.
"""

from __future__ import annotations

from collections.abc import Callable, Set

from sim.autopilots.flight_modes import FlightMode
from sim.autopilots.onboard_state import OnboardState
from sim.autopilots.px4_modes import LAND, LOITER, OFFBOARD, POSCTL, RTL
from sim.mavlink import dialect

OFFBOARD_ENTRY_S = 0.5
"""Greatest interval between setpoints that opens OFFBOARD, s."""
OFFBOARD_LOSS_EXTRA_S = 0.1
"""It notices a lost stream this much later than COM_OF_LOSS_T, s."""
GPS_LOSS_S = 5.0
"""EKF2_NOAID_TOUT: it has no position after this long without GPS, s."""

OFFBOARD_LOSS_ACTIONS = {0: POSCTL, 1: POSCTL, 2: POSCTL, 3: RTL, 4: LAND, 5: LOITER}
"""By COM_OBL_RC_ACT; without sticks the stick modes do the same."""
RESUMED_FROM = {POSCTL, LOITER}
"""Modes from which it goes back to OFFBOARD when setpoints resume."""
DATALINK_LOSS_ACTIONS = {1: LOITER, 2: RTL, 3: LAND}
"""By NAV_DLL_ACT."""
FENCE_ACTIONS = {2: LOITER, 3: RTL, 5: LAND}
"""By GF_ACTION. 4 terminates the flight; CBRK_FLIGHTTERM turns that off by default."""


class Px4Failsafes:
    """The failsafes of one PX4.

    Args:
        onboard: State of the autopilot.
        say: Sends a STATUSTEXT of a severity.
        enter: Changes the flight mode and leaves these failsafes as they are.

    Attributes:
        breached: The fences it is on the wrong side of.
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
        self._offboard_lost = self._datalink_lost = False
        self.breached: set[str] = set()
        self._battery_stage = 0
        self._gps_lost_since_s: float | None = None

    def watch(self, setpoint_silent_s: float, gcs_silent_s: float, beyond: Set[str]) -> None:
        """Act on what fails, once per step.

        Args:
            setpoint_silent_s: Time since the last setpoint, s.
            gcs_silent_s: Time since a ground station was last heard, s; 0 if none ever was.
            beyond: The fences that the vehicle is on the wrong side of.
        """
        self._watch_offboard(setpoint_silent_s)
        self._watch_datalink(gcs_silent_s)
        self._watch_battery()
        self._watch_gps()
        self._watch_fence(beyond)

    def clear(self) -> None:
        """Forget that a failsafe acts: somebody changed the mode, or it rebooted."""
        self._offboard_lost = self._me.failsafe = False

    def forget_battery(self) -> None:
        """Warn of the battery anew: it was armed."""
        self._battery_stage = 0

    def _watch_offboard(self, silent_s: float) -> None:
        me = self._me
        if self._offboard_lost and silent_s < OFFBOARD_ENTRY_S:
            # Somebody put it in OFFBOARD, and nobody has changed that since.
            self._enter(OFFBOARD)
            self.clear()
        elif (
            me.mode is OFFBOARD
            and silent_s > me.parameters["COM_OF_LOSS_T"] + OFFBOARD_LOSS_EXTRA_S
        ):
            action = OFFBOARD_LOSS_ACTIONS.get(int(me.parameters["COM_OBL_RC_ACT"]), POSCTL)
            self._fail(action, "No offboard signal")
            self._offboard_lost = action in RESUMED_FROM

    def _watch_datalink(self, silent_s: float) -> None:
        me = self._me
        action = DATALINK_LOSS_ACTIONS.get(int(me.parameters["NAV_DLL_ACT"]))
        lost = action is not None and silent_s > me.parameters["COM_DL_LOSS_T"]
        if lost and not self._datalink_lost and me.armed and action is not None:
            self._fail(action, "GCS connection lost")
        self._datalink_lost = lost

    def _watch_battery(self) -> None:
        me, parameters = self._me, self._me.parameters
        thresholds = ("BAT_LOW_THR", "BAT_CRIT_THR", "BAT_EMERGEN_THR")
        stage = sum(me.battery.charge < parameters[name] for name in thresholds)
        if stage <= self._battery_stage or not me.armed:
            return
        self._battery_stage = stage
        what = int(parameters["COM_LOW_BAT_ACT"])
        text = ("", "Low battery", "Critical battery", "Emergency battery level")[stage]
        if (what == 2 and stage >= 2) or (what == 3 and stage == 3):
            self._fail(LAND, text)
        elif what in {1, 3} and stage == 2:
            self._fail(RTL, text)
        else:
            self._say(text, dialect.MAV_SEVERITY_CRITICAL)

    def _watch_gps(self) -> None:
        me = self._me
        if me.gps_ok or not me.armed:
            self._gps_lost_since_s = None
            return
        if self._gps_lost_since_s is None:
            self._gps_lost_since_s = me.now_s
        # It descends blindly, which it shows as landing.
        if me.now_s - self._gps_lost_since_s >= GPS_LOSS_S and me.mode is not LAND:
            self._fail(LAND, "No valid position estimate")

    def _watch_fence(self, beyond: Set[str]) -> None:
        me = self._me
        fresh, self.breached = beyond - self.breached, set(beyond)
        if not me.armed or me.landed:
            return
        action = FENCE_ACTIONS.get(int(me.parameters["GF_ACTION"]))
        for name in sorted(fresh):
            if action is None:
                self._say(f"Geofence: {name}", dialect.MAV_SEVERITY_CRITICAL)
            else:
                self._fail(action, f"Geofence: {name}")

    def _fail(self, mode: FlightMode, text: str) -> None:
        """Say what failed and enter a mode, unless it is landing already."""
        self._say(text, dialect.MAV_SEVERITY_CRITICAL)
        if self._me.mode is LAND:
            return
        self._enter(mode)
        self._offboard_lost = False
        self._me.failsafe = True
