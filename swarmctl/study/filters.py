"""The filters that the studies compare, each in a batch of runs.

==================================  ======================================================
``ncrkf()``                         the consistent NCRKF, the default of this system
``ncrkf(variant="paper")``          the paper's Eqs. (8)-(11) as printed
``okf()``                           the paper's "optimal" filter, which is told the true H
``ekf()``                           the paper's EKF of Table 1
``iterated_ekf()``                  Gauss-Newton, full covariances: the strong baseline
==================================  ======================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.kernels import ncrkf as ncrkf_kernel
from swarmctl.estimation.model.motion import ConstantAcceleration
from swarmctl.study import ekf_update as ekf_kernel
from swarmctl.study import paper_filters
from swarmctl.study.batch_filter import BatchEstimate, BatchFilter, Belief, RelativePrior, Scan
from swarmctl.study.filter_coordinates import (
    Coordinates,
    CoordinatesName,
    InCoordinates,
    checked,
    coordinates_named,
)
from swarmctl.units import Array


def ncrkf(
    variant: Literal["consistent", "paper"] = "consistent",
    *,
    state: CoordinatesName = "absolute",
    process_noise: Sequence[float] = (0.0, 0.0),
) -> BatchFilter:
    """The non-conservative robust Kalman filter.

    Args:
        variant: ``consistent``, see :mod:`~swarmctl.estimation.kernels.ncrkf`, or ``paper``, as
            printed, see :mod:`~swarmctl.study.paper_filters`.
        state: Coordinates of the consistent filter; the paper's has its own.
        process_noise: Spectral density of the emitter's acceleration per axis (two by default),
            m²/s³; with state ``accelerated`` the variance of the acceleration's jump per step,
            (m/s²)². It is for the consistent filter; the paper's has Table 1's.

    Raises:
        EstimationError: variant or state is unknown.
    """
    if variant == "paper":
        return _PaperNcrkf()
    if variant != "consistent":
        raise EstimationError(f"variant must be 'consistent' or 'paper', not {variant!r}.")
    return _ConsistentNcrkf(coordinates_named(state, process_noise))


def okf() -> BatchFilter:
    """The paper's "optimal" Kalman filter, which is told the true H."""
    return _Okf()


def ekf() -> BatchFilter:
    """The EKF of Table 1: relative, constant acceleration, R = sigma_r² I."""
    return _PaperEkf()


def iterated_ekf(
    iterations: int = 10,
    *,
    state: CoordinatesName = "absolute",
    process_noise: Sequence[float] = (0.0, 0.0),
) -> BatchFilter:
    """The iterated EKF with full covariances.

    Args:
        iterations: At most so many linearisations a scan, >= 1.
        state: Coordinates.
        process_noise: As for :func:`ncrkf`.

    Raises:
        EstimationError: iterations is below 1 or state is unknown.
    """
    if iterations < 1:
        raise EstimationError(f"iterations must be at least 1, not {iterations}.")
    return _IteratedEkf(coordinates_named(state, process_noise), iterations)


@dataclass(frozen=True)
class _ConsistentNcrkf(InCoordinates):
    def step(self, belief: Belief, scan: Scan) -> Belief:
        x, P = self.coordinates.predict(belief, scan)
        at = self.coordinates.geometry(x, scan)
        # The positions' noise is in the covariance already: sigma_p 0 adds nothing.
        result = ncrkf_kernel.update(
            x, P, at.reference, at.companions, scan.rd, at.covariance, sigma_p=0.0
        )
        return Belief(result.x, result.P, result.guarded)


@dataclass(frozen=True)
class _IteratedEkf(InCoordinates):
    iterations: int

    def step(self, belief: Belief, scan: Scan) -> Belief:
        x, P = self.coordinates.predict(belief, scan)
        return Belief(*ekf_kernel.update(x, P, *self._arguments(x, scan), self.iterations))

    def _arguments(self, x: Array, scan: Scan) -> tuple[Array, Array, Array, Array]:
        at = self.coordinates.geometry(x, scan)
        return at.reference, at.companions, scan.rd, at.covariance


_JUMP = 0.1**2
"""Variance of an acceleration's jump per step in Table 1, (m/s²)²."""


@dataclass(frozen=True)
class _PaperEkf:
    relative: bool = True

    def start(self, prior: RelativePrior) -> Belief:
        return self._in(prior.reference.shape[-1] // 2).start(prior)

    def step(self, belief: Belief, scan: Scan) -> Belief:
        x, P = self._in(scan.reference.shape[-1]).predict(belief, scan)
        baselines = scan.companions - scan.reference[..., None, :]
        R = np.diag(np.diag(scan.rd_covariance))
        return Belief(
            *ekf_kernel.update(x, P, np.zeros_like(scan.reference), baselines, scan.rd, R)
        )

    def estimate(self, belief: Belief, scan: Scan) -> BatchEstimate:
        return self._in(scan.reference.shape[-1]).estimate(belief, scan)

    @staticmethod
    @cache
    def _in(d: int) -> Coordinates:
        return coordinates_named("accelerated", (_JUMP,) * d)


@cache
def _paper_s_motion(d: int) -> ConstantAcceleration:
    return ConstantAcceleration((*(_JUMP,) * d, 2.0 * _JUMP))


@dataclass(frozen=True)
class _PaperState:
    """The paper's state: position and range, and their derivatives."""

    relative: bool = True

    @staticmethod
    def start(prior: RelativePrior) -> Belief:
        x, P = checked(prior)
        return Belief(x, np.broadcast_to(P, (*x.shape, x.shape[-1])))

    @staticmethod
    def predict(belief: Belief, scan: Scan) -> tuple[Array, Array]:
        if scan.dt == 0.0:
            return belief.x, belief.P
        d = scan.reference.shape[-1]
        F, Q = _paper_s_motion(d).step(scan.dt)
        Ft = F.T.copy()
        return belief.x @ Ft, F @ belief.P @ Ft + Q

    @staticmethod
    def estimate(belief: Belief, scan: Scan) -> BatchEstimate:
        d = scan.reference.shape[-1]
        picked = [*range(d), *range(d + 1, 2 * d + 1)]
        return BatchEstimate(belief.x[..., picked], belief.P[..., picked, :][..., picked])


@dataclass(frozen=True)
class _PaperNcrkf(_PaperState):
    def step(self, belief: Belief, scan: Scan) -> Belief:
        x, P = self.predict(belief, scan)
        baselines = scan.companions - scan.reference[..., None, :]
        variance = np.diag(scan.rd_covariance)
        return Belief(*paper_filters.ncrkf_update(x, P, baselines, scan.rd, variance, scan.sigma_p))


@dataclass(frozen=True)
class _Okf(_PaperState):
    def step(self, belief: Belief, scan: Scan) -> Belief:
        x, P = self.predict(belief, scan)
        baselines = scan.companions - scan.reference[..., None, :]
        variance = np.diag(scan.rd_covariance)
        return Belief(
            *paper_filters.okf_update(x, P, *scan.truth, baselines, scan.rd, variance, scan.sigma_p)
        )
