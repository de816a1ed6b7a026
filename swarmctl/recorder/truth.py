"""The true emitter's position at any instant, as a simulator publishes it."""

from __future__ import annotations

import math

from swarmctl.units import Vector

MAX_EXTRAPOLATION_S = 2.0
"""The truth is extrapolated this far beyond its last sample, for a flight's last estimates."""


class TruthTrack:
    """The true emitter's position between published samples.

    It keeps only the line through the last two samples. Ask for a position as soon as there is a
    sample at or after its instant.

    Attributes:
        latest_s: UTC epoch of the last sample, s; minus infinity before the first.
    """

    __slots__ = ("_position", "_velocity", "latest_s")

    def __init__(self) -> None:
        self.latest_s = -math.inf
        self._position: Vector = (math.nan, math.nan, math.nan)
        self._velocity: Vector = (math.nan, math.nan, math.nan)

    def add(self, epoch_s: float, position: Vector, velocity: Vector) -> None:
        """Take a sample; it is ignored if it is not newer than the last.

        Args:
            epoch_s: UTC, s.
            position: ENU, m.
            velocity: ENU, m/s; used while there is only one sample.
        """
        elapsed = epoch_s - self.latest_s
        if elapsed <= 0.0:
            return
        if math.isfinite(elapsed):
            (x, y, z), (x0, y0, z0) = position, self._position
            velocity = (x - x0) / elapsed, (y - y0) / elapsed, (z - z0) / elapsed
        self.latest_s, self._position, self._velocity = epoch_s, position, velocity

    def at(self, epoch_s: float) -> Vector:
        """Position at an epoch (UTC, s), ENU m."""
        dt = epoch_s - self.latest_s
        (x, y, z), (vx, vy, vz) = self._position, self._velocity
        return x + vx * dt, y + vy * dt, z + vz * dt
