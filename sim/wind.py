"""The wind that a vehicle flies in: a mean velocity of the air and gusts."""

from __future__ import annotations

from sim.config import WindConfig
from sim.noise import GaussMarkov, Normals
from swarmctl.units import Vector


class Wind:
    """The wind at one vehicle.

    Args:
        config: Mean wind and gusts.
        step_s: Time between calls of :meth:`advance`, s.
        normals: Source of the gusts' deviates.
    """

    __slots__ = ("_gust", "_mean_enu")

    def __init__(self, config: WindConfig, step_s: float, normals: Normals) -> None:
        self._mean_enu = config.mean_enu
        self._gust = GaussMarkov(config.gust_sigma_mps, config.gust_tau_s, step_s, normals)

    def advance(self) -> Vector:
        """Move on by one step; returns the velocity of the air, m/s."""
        self._gust.advance()
        (wx, wy, wz), (gx, gy, gz) = self._mean_enu, self._gust.value
        return (wx + gx, wy + gy, wz + gz)
