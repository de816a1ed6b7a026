"""filterpy's extended Kalman filter as a track's filter: what most people would use.

It is there to compare with. It begins at the prior's mean, linearises once an epoch, and takes
all errors for white.
"""

from __future__ import annotations

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from swarmctl.errors import EstimationError
from swarmctl.estimation.integrity.gate import Screened
from swarmctl.estimation.kernels.augmented import linearise
from swarmctl.estimation.model import motion
from swarmctl.estimation.model.rows import Rows
from swarmctl.estimation.track.single_mode_kernel import SingleModeKernel
from swarmctl.units import Array


class EkfKernel(SingleModeKernel):
    """Predicts and updates by :class:`filterpy.kalman.ExtendedKalmanFilter`."""

    def __init__(self, process_noise: Array) -> None:
        super().__init__(process_noise)
        self._filter = ExtendedKalmanFilter(dim_x=2 * process_noise.size, dim_z=1)

    def tells_echoes(self, S: Array, rows: Rows) -> bool:
        """Always: an EKF is as sure of its prior as of any state."""
        return True

    def predicted(self, x: Array, P: Array, dt: float) -> tuple[Array, Array]:
        """Time update by ``dt`` seconds, >= 0."""
        ekf = self._filter
        ekf.x, ekf.P = x, P
        ekf.F = motion.transition(dt, self.process_noise.size)
        ekf.Q = motion.process_noise(dt, self.process_noise)
        ekf.predict()
        return ekf.x, ekf.P

    def use(self, x: Array, P: Array, rows: Rows, screened: Screened) -> tuple[Array, Array]:
        """Measurement update; a receiver set aside has a very uncertain arrival.

        Raises:
            EstimationError: The rows' numbers have no finite result.
        """
        expected, H = linearise(x, rows, {}, self._layout)
        ekf = self._filter
        ekf.x, ekf.P = x, P
        try:
            ekf.update(rows.rd, lambda _: H, lambda _: expected, R=screened.covariance)
        except ValueError:  # scipy, of numbers that are not finite
            raise EstimationError("The rows' numbers have no finite result.") from None
        if not np.isfinite(ekf.x.sum() + ekf.P.sum()):
            raise EstimationError("The update has no finite result: its numbers exceed float64.")
        return ekf.x, ekf.P
