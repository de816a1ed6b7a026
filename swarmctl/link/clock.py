"""A vehicle's time since boot mapped to UTC."""

from __future__ import annotations

_REORDERING_S = 2.0
"""Packets overtake each other by less than this; boot time further back means a reboot."""


class BootClock:
    """Offset between UTC and one vehicle's time since boot, from its SYSTEM_TIME.

    Both times of a SYSTEM_TIME belong to one instant of the vehicle, so the link's delay does
    not enter; what remains is the millisecond to which the boot time is cut. The latest pair
    counts: it follows the drift of the vehicle's oscillator and a step of its UTC.
    """

    def __init__(self) -> None:
        self._offset_s: float | None = None
        self._boot_s = 0.0

    def update(self, utc_s: float, boot_s: float) -> None:
        """Take the two times (s) of one SYSTEM_TIME; one that was overtaken is ignored."""
        if not self._boot_s - _REORDERING_S <= boot_s < self._boot_s:
            self._offset_s = utc_s - boot_s
            self._boot_s = boot_s

    def to_utc(self, boot_s: float) -> float | None:
        """UTC (s) of a time since boot (s); None until a SYSTEM_TIME came since the last boot.

        A boot time well before the last SYSTEM_TIME shows a reboot, and the offset is dropped.
        """
        if self._offset_s is None:
            return None
        if boot_s < self._boot_s - _REORDERING_S:
            self._offset_s = None
            self._boot_s = 0.0
            return None
        return boot_s + self._offset_s
