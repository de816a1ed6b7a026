"""filterpy's extended Kalman filter: the library that most people know, to compare with.

It follows the emitter in a fixed frame with constant velocity, and is told the full covariance of
the range differences, so that it differs from this system's filters in nothing but its algorithm.
F, Q, H and R are built here. filterpy filters one run at a time and takes some twenty times as long
as a batched filter.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from scipy.linalg import LinAlgWarning

from swarmctl.estimation.model.range_difference import jacobian, range_differences
from swarmctl.study.batch_filter import BatchFilter, Belief, Scan
from swarmctl.study.filter_coordinates import InCoordinates, coordinates_named
from swarmctl.units import Array


def filterpy_ekf(process_noise: Sequence[float] = (0.0, 0.0)) -> BatchFilter:
    """The EKF of filterpy.

    Args:
        process_noise: Spectral density of the emitter's acceleration per axis, m²/s³.
    """
    return _FilterpyEkf(coordinates_named("absolute", process_noise))


@dataclass(frozen=True)
class _FilterpyEkf(InCoordinates):
    def step(self, belief: Belief, scan: Scan) -> Belief:
        """As :meth:`~swarmctl.study.batch_filter.BatchFilter.step`; a run that fails is NaN."""
        size, companions = belief.x.shape[-1], scan.rd.shape[-1]
        x, P = belief.x.reshape(-1, size).copy(), belief.P.reshape(-1, size, size).copy()
        ekf = ExtendedKalmanFilter(dim_x=size, dim_z=companions)
        if scan.dt > 0.0:
            ekf.F, ekf.Q = self.coordinates.motion.step(scan.dt)
            for run in range(len(x)):
                ekf.x, ekf.P = x[run], P[run]
                ekf.predict()
                x[run], P[run] = ekf.x, ekf.P
        H, expected, ekf.R = self._measurement(x.reshape(belief.x.shape), scan)
        measured = np.broadcast_to(scan.rd, expected.shape).reshape(-1, companions)
        H, expected = H.reshape(-1, companions, size), expected.reshape(-1, companions)

        def jacobian_of(_: Array, run: int) -> Array:
            rows: Array = H[run]
            return rows

        def expected_of(_: Array, run: int) -> Array:
            rd: Array = expected[run]
            return rd

        with warnings.catch_warnings():
            # What an ill-conditioned S leads to, the study shows.
            warnings.simplefilter("ignore", LinAlgWarning)
            for run in range(len(x)):
                ekf.x, ekf.P = x[run], P[run]
                try:
                    ekf.update(measured[run], jacobian_of, expected_of, args=(run,), hx_args=(run,))
                    x[run], P[run] = ekf.x, ekf.P
                except (np.linalg.LinAlgError, ValueError):  # S is singular, or not finite
                    x[run], P[run] = np.nan, np.nan
        return Belief(x.reshape(belief.x.shape), P.reshape(belief.P.shape))

    def _measurement(self, x: Array, scan: Scan) -> tuple[Array, Array, Array]:
        """H, the expected range differences and R at predicted states, of all runs at once."""
        at = self.coordinates.geometry(x, scan)
        d = scan.reference.shape[-1]
        emitter = x[..., :d]
        expected = range_differences(emitter, at.reference, at.companions)
        H = np.zeros((*expected.shape, x.shape[-1]))
        H[..., :d] = jacobian(emitter, at.reference, at.companions)
        return H, expected, at.covariance
