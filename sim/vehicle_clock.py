"""The clock of a vehicle: time since power-up by its quartz, UTC by its GPS."""

from __future__ import annotations

import numpy as np

from sim.config import ClockConfig
from sim.noise import Normals
from swarmctl.frames import sped_up_utc_s


class VehicleClock:
    """The clock of one vehicle.

    Args:
        config: Its errors.
        utc_start_s: UTC at simulation time 0, s (see :class:`sim.config.SimConfig`).
        rng: Generator that nothing else uses.
    """

    __slots__ = ("_config", "_normals", "_utc_start_s")

    def __init__(self, config: ClockConfig, utc_start_s: float, rng: np.random.Generator) -> None:
        self._config = config
        self._utc_start_s = utc_start_s
        self._normals = Normals(rng)

    def elapsed_s(self, true_s: float) -> float:
        """Seconds that its quartz counts in a true time span (s)."""
        return true_s * (1.0 + self._config.drift)

    def kept_utc_s(self, now_s: float) -> float:
        """UTC that it keeps at a simulation time (s), with or without GPS."""
        return self._utc_start_s + now_s + self._config.utc_offset_s

    def utc_s(self, now_s: float) -> float:
        """UTC of one report at a simulation time (s); each report has its own jitter."""
        utc_s, jitter_s = self.kept_utc_s(now_s), self._config.utc_jitter_s
        if self._config.speedup != 1.0:
            utc_s = sped_up_utc_s(utc_s, 1.0 / self._config.speedup)
        return utc_s + jitter_s * self._normals.draw() if jitter_s else utc_s
