"""The target: the estimate of the emitter as guidance sees it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from swarmctl.units import Array, Vector

TRUSTED_SPEED_SIGMA_MPS = 0.5
"""The emitter's estimated velocity is fed forward once its 1-sigma is below this."""


@dataclass(frozen=True)
class Target:
    """The estimate as guidance sees it: ENU, m and m/s; sigmas are 1-sigma larger axes.

    ``covariance`` is the horizontal position's: east, east with north, north, m².
    ``track_covariance`` is that of horizontal position and velocity, (4, 4); without it the
    approach is straight.
    """

    position_enu: Vector
    velocity_enu: Vector
    sigma_m: float
    speed_sigma_mps: float
    covariance: tuple[float, float, float]
    track_covariance: Array | None = None

    def los_sigma_rad(self, east: float, north: float) -> float:
        """1-sigma of the line of sight from a place, rad; a half turn at the most."""
        along_e, along_n = self.position_enu[0] - east, self.position_enu[1] - north
        squared = along_e * along_e + along_n * along_n
        ee, en, nn = self.covariance
        across = along_n * along_n * ee - 2.0 * along_n * along_e * en + along_e * along_e * nn
        return min(math.pi, math.sqrt(max(across, 0.0)) / max(squared, 1.0))

    @property
    def trusted_velocity(self) -> tuple[float, float]:
        """Horizontal velocity to feed forward: zero until it is known well enough."""
        if self.speed_sigma_mps > TRUSTED_SPEED_SIGMA_MPS:
            return (0.0, 0.0)
        return self.velocity_enu[:2]
