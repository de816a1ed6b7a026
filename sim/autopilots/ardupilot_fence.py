"""What the simulated ArduCopter does about its fences: breaches, actions, recovery.

After AC_Fence.cpp and ArduCopter's fence.cpp and mode.cpp (4.7 in development).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

from sim.autopilots.ardupilot_modes import BRAKE, LAND, RTL
from sim.autopilots.flight_modes import FlightMode
from sim.autopilots.onboard_state import OnboardState
from sim.mavlink import dialect

MAX_ALT, CIRCLE, POLYGON = "Max Alt", "Circle", "Polygon"
"""ArduCopter's names of its fences; every uploaded fence is the polygon, circles too."""
AGAIN_M = 20.0
"""A vehicle this much farther out than at its last breach breaches the fence again, m."""
GIVE_UP_M = 100.0
"""A vehicle farther out than this lands, whatever is set, m."""
MANUAL_RECOVERY_S = 10.0
"""After a change of the mode during a breach, new breaches have no effect for this long, s."""
NO_MODE_CHANGE = 1
"""Bit of FENCE_OPTIONS: no other mode until the vehicle is back inside."""
FENCE_ACTIONS = {1: RTL, 2: LAND, 3: RTL, 4: BRAKE, 5: LAND}
"""By FENCE_ACTION. It has no SmartRTL: where that comes first, this is the second choice."""


class FenceWatch:
    """The breaches of one vehicle and what it does about them.

    Args:
        onboard: State of the autopilot.
        say: Sends a STATUSTEXT of a severity.
        enter: Changes the flight mode.

    Attributes:
        breached: The fences it is on the wrong side of, and how far out the next breach is, m.
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
        self.breached: dict[str, float] = {}
        self._recovering = False
        self._ignored_until_s = -math.inf

    def watch(self, beyond_m: Mapping[str, float]) -> None:
        """Note where the vehicle is and act on new breaches.

        Args:
            beyond_m: The fences it is on the wrong side of, and how far, m.
        """
        me, notice = self._me, dialect.MAV_SEVERITY_NOTICE
        was_breached = bool(self.breached)
        fresh = self._note(beyond_m)
        if not me.armed:
            return
        if was_breached and not self.breached:
            self._say("Fence breach cleared", notice)
        if not fresh:
            return
        if not me.landed:
            self._say(f"{names(fresh)} breached", notice)
        action = FENCE_ACTIONS.get(int(me.parameters["FENCE_ACTION"]))
        if action is None:
            return
        if me.landed:
            me.armed = False
            return
        self._enter(LAND if max(beyond_m[name] for name in fresh) > GIVE_UP_M else action)
        self._recovering = True

    def forbids_mode_change(self) -> bool:
        """Whether the vehicle must finish what the fence made it do."""
        me = self._me
        return (
            self._recovering
            and bool(int(me.parameters["FENCE_OPTIONS"]) & NO_MODE_CHANGE)
            and me.armed
            and not me.landed
        )

    def mode_changed(self) -> None:
        """Note a change of the mode: during a breach it counts as a recovery by hand."""
        if self._me.parameters["FENCE_ACTION"] == 0.0:
            return
        self._recovering = False
        if self.breached:
            self._ignored_until_s = self._me.now_s + MANUAL_RECOVERY_S
            self._say("Manual recovery started", dialect.MAV_SEVERITY_INFO)

    def _note(self, beyond_m: Mapping[str, float]) -> list[str]:
        """Note where the vehicle is; returns the fences that are newly breached."""
        known, self.breached = self.breached, {}
        fresh = []
        for name, out_m in beyond_m.items():
            again_m = known.get(name)
            if again_m is None or out_m >= again_m:
                fresh.append(name)
                again_m = math.inf if name == POLYGON else out_m + AGAIN_M
            self.breached[name] = again_m
        self._recovering = self._recovering and bool(self.breached)
        return [] if self._me.now_s < self._ignored_until_s else fresh


def names(fences: Iterable[str]) -> str:
    """Several fences as ArduCopter names them: ``Max Alt and Circle fences``."""
    *first, last = fences
    words = " and ".join((", ".join(first), last)) if first else last
    return f"{words} fence{'s' if first else ''}"
