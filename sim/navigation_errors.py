"""The navigation (GPS) errors of a vehicle: in the positions it reports and flies by."""

from __future__ import annotations

import numpy as np

from sim.config import NavigationConfig
from sim.noise import GaussMarkov, Normals
from swarmctl.units import Vector


class NavigationErrors:
    """Position errors of one vehicle: a correlated part that it flies, a white part per report.

    Args:
        config: Standard deviations and correlation time, per axis.
        step_s: Time between calls of :meth:`advance`, s.
        rng: Generator that nothing else uses.
    """

    __slots__ = ("_correlated", "_normals", "_white_sigma_m")

    def __init__(self, config: NavigationConfig, step_s: float, rng: np.random.Generator) -> None:
        self._normals = Normals(rng)
        self._white_sigma_m = config.white_sigma_m
        self._correlated = GaussMarkov(
            config.correlated_sigma_m, config.correlated_tau_s, step_s, self._normals
        )

    @property
    def correlated_enu(self) -> Vector:
        """Error of the autopilot's own solution now, m."""
        return self._correlated.value

    def advance(self) -> None:
        """Move on by one step."""
        self._correlated.advance()

    def report_enu(self) -> Vector:
        """Error of one reported position, m: a fresh white part on top of the correlated one."""
        sigma, draw = self._white_sigma_m, self._normals.draw
        x, y, z = self._correlated.value
        return (x + sigma * draw(), y + sigma * draw(), z + sigma * draw())
