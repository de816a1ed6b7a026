"""What ArduCopter makes of its fences: which breaches are new, and what may not be done meanwhile.

By AC_Fence.cpp and ArduCopter's fence.cpp and mode.cpp (4.7 in development).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

MAX_ALT, CIRCLE, POLYGON = "Max Alt", "Circle", "Polygon"
"""Its words for its fences; what was uploaded is the polygon, circles or not."""
AGAIN_M = 20.0
"""A vehicle so much farther out than at its last breach breaches the fence again."""
GIVE_UP_M = 100.0
"""A vehicle farther out than this lands, whatever is set."""
MANUAL_RECOVERY_S = 10.0
"""After a change of the mode amid a breach, new ones are noted and not acted on for so long."""
NO_MODE_CHANGE = 1
"""Bit of FENCE_OPTIONS: no other mode until the vehicle is back inside."""


class FenceWatch:
    """The breaches of one vehicle.

    Attributes:
        breached: The fences it is on the wrong side of, and how far out the next breach is, m.
        recovering: Whether it flies what the fence had it do.
    """

    def __init__(self) -> None:
        self.breached: dict[str, float] = {}
        self.recovering = False
        self._ignored_until_s = -math.inf

    def look(self, beyond_m: Mapping[str, float], now_s: float) -> list[str]:
        """Take note of where the vehicle is.

        Args:
            beyond_m: The fences it is on the wrong side of, and how far, m.
            now_s: Simulation time, s.

        Returns:
            The fences that are newly breached and to be acted on.
        """
        known, self.breached = self.breached, {}
        fresh = []
        for name, out_m in beyond_m.items():
            again_m = known.get(name)
            if again_m is None or out_m >= again_m:
                fresh.append(name)
                again_m = math.inf if name == POLYGON else out_m + AGAIN_M
            self.breached[name] = again_m
        self.recovering = self.recovering and bool(self.breached)
        return [] if now_s < self._ignored_until_s else fresh

    def mode_changed(self, now_s: float) -> bool:
        """The mode was changed; returns whether that counts as a recovery by hand."""
        self.recovering = False
        if self.breached:
            self._ignored_until_s = now_s + MANUAL_RECOVERY_S
        return bool(self.breached)


def named(fences: Iterable[str]) -> str:
    """Its words for several fences: ``Max Alt and Circle fences``."""
    names = list(fences)
    *first, last = names
    words = " and ".join((", ".join(first), last)) if first else last
    return f"{words} fence{'s' if first else ''}"
