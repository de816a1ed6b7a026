"""Whole filters, from a common prior and common measurements to a common answer.

Each is a frozen description without a state of its own: ``start`` makes a :class:`Belief`,
``step`` makes the next one, ``track`` reads it. All arrays carry leading axes of runs, so one
object filters one flight or a thousand. To add one, write a class with these three methods and
the attribute ``relative`` (:class:`Filter`); nothing needs to be inherited.

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
from typing import Literal, NamedTuple, Protocol

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import as_covariance, as_finite
from swarmctl.estimation.kernels import ekf as ekf_kernel
from swarmctl.estimation.kernels import ncrkf as ncrkf_kernel
from swarmctl.estimation.model.motion import ConstantAcceleration, ConstantVelocity, Motion
from swarmctl.estimation.model.range_difference import (
    effective_covariance,
    effective_relative_covariance,
)
from swarmctl.study import paper_filters
from swarmctl.units import Array, Mask


class Prior(NamedTuple):
    """What is known before the first measurement, in the paper's state.

    Attributes:
        mean: Emitter relative to the reference UAV: [position, range, and their first and
            second derivatives], (..., 3(d + 1)), SI.
        covariance: Of it, (3(d + 1), 3(d + 1)).
        reference: Position and velocity of the reference UAV by navigation, (..., 2d), SI.
    """

    mean: Array
    covariance: Array
    reference: Array


class Truth(NamedTuple):
    """What is measured, without noise. Only the OKF looks.

    Attributes:
        baselines: (..., N, d), m.
        rd: (..., N), m.
    """

    baselines: Array
    rd: Array


class Scan(NamedTuple):
    """What one epoch gives a filter.

    Attributes:
        dt: Since the previous epoch, s; 0 at the first.
        reference: Measured position of the reference UAV, (..., d), m.
        velocity: Its mean velocity since the previous epoch, by navigation, (..., d), m/s.
        companions: Measured positions, (..., N, d), m.
        rd: Measured range differences, (..., N), m.
        rd_covariance: Of the receivers' noise, (N, N), m².
        sigma_p: 1-sigma of every measured position per axis, m.
        truth: For filters that are told.
    """

    dt: float
    reference: Array
    velocity: Array
    companions: Array
    rd: Array
    rd_covariance: Array
    sigma_p: float
    truth: Truth


class Belief(NamedTuple):
    """A filter's state, in coordinates of its own.

    Attributes:
        x: (..., n).
        P: (..., n, n).
        guarded: Whether the guard of P fired at the last step, (...).
    """

    x: Array
    P: Array
    guarded: Mask | None = None


class Track(NamedTuple):
    """A filter's answer.

    Attributes:
        x: Position and velocity of the emitter, (..., 2d), SI; relative to the reference UAV
            if the filter is ``relative``.
        P: Covariance, (..., 2d, 2d).
    """

    x: Array
    P: Array


class Filter(Protocol):
    """Anything that tracks an emitter through scans."""

    @property
    def relative(self) -> bool:
        """Whether it tracks the emitter relative to the reference UAV."""

    def start(self, prior: Prior) -> Belief:
        """The belief before the first scan.

        Raises:
            EstimationError: The prior does not fit the filter.
        """

    def step(self, belief: Belief, scan: Scan) -> Belief:
        """Predict over ``scan.dt``, then use the measurements."""

    def track(self, belief: Belief, scan: Scan) -> Track:
        """Position and velocity at the epoch of ``scan``, the last one used."""


State = Literal["absolute", "relative", "accelerated"]
"""Coordinates of the consistent filters:

- ``absolute``: the emitter in a fixed frame, constant velocity;
- ``relative``: relative to the reference UAV, constant velocity, own motion subtracted;
- ``accelerated``: relative, constant acceleration, own motion unknown (the paper's choice).
"""


def ncrkf(
    variant: Literal["consistent", "paper"] = "consistent",
    *,
    state: State = "absolute",
    process_noise: Sequence[float] = (0.0, 0.0),
) -> Filter:
    """The non-conservative robust Kalman filter.

    Args:
        variant: ``consistent``, see :mod:`~swarmctl.estimation.kernels.ncrkf`, or ``paper``, as
            printed, see :mod:`~swarmctl.study.paper_filters`.
        state: Coordinates of the consistent one; the paper's has its own.
        process_noise: Of the consistent one. Spectral density of the emitter's acceleration
            per axis (two by default), m²/s³; with state ``accelerated`` the variance of the
            acceleration's jump per step, (m/s²)². The paper's has Table 1's.

    Raises:
        EstimationError: variant or state is unknown.
    """
    if variant == "paper":
        return _PaperNcrkf()
    if variant != "consistent":
        raise EstimationError(f"variant must be 'consistent' or 'paper', not {variant!r}.")
    return _ConsistentNcrkf(_coordinates(state, process_noise))


def okf() -> Filter:
    """The paper's "optimal" Kalman filter, which is told the true H."""
    return _Okf()


def ekf() -> Filter:
    """The EKF of Table 1: relative, constant acceleration, R = sigma_r² I."""
    return _PaperEkf()


def iterated_ekf(
    iterations: int = 10,
    *,
    state: State = "absolute",
    process_noise: Sequence[float] = (0.0, 0.0),
) -> Filter:
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
    return _IteratedEkf(_coordinates(state, process_noise), iterations)


# --- Coordinates -----------------------------------------------------------------------


class _Geometry(NamedTuple):
    """Where an update's RDs are computed, and their covariance about the computed ones."""

    reference: Array
    companions: Array
    covariance: Array


@dataclass(frozen=True)
class _Coordinates:
    """How a state is made of a prior, predicted, and read."""

    motion: Motion
    relative: bool
    accelerated: bool

    def start(self, prior: Prior) -> Belief:
        d = prior.reference.shape[-1] // 2
        blocks = 3 if self.accelerated else 2
        picked = [block * (d + 1) + axis for block in range(blocks) for axis in range(d)]
        mean, covariance = _checked(prior)
        x = mean[..., picked]
        if self.motion.size != len(picked):
            raise EstimationError(
                f"process_noise must have {d} entries, one per axis of the prior, not "
                f"{self.motion.size // blocks}."
            )
        if not self.accelerated:
            # The velocity is the emitter's own: known motion is no part of it.
            x[..., d:] += prior.reference[..., d:]
        if not self.relative:
            x[..., :d] += prior.reference[..., :d]
        P = covariance[np.ix_(picked, picked)]
        return Belief(x, np.broadcast_to(P, (*x.shape, x.shape[-1])))

    def predict(self, belief: Belief, scan: Scan) -> tuple[Array, Array]:
        x, P = belief.x, belief.P
        if scan.dt == 0.0:
            return x, P
        F, Q = self.motion.step(scan.dt)
        Ft = F.T.copy()  # in order in memory: twice as fast
        x, P = x @ Ft, F @ P @ Ft + Q
        if self.relative and not self.accelerated:
            x[..., : scan.velocity.shape[-1]] -= scan.velocity * scan.dt
        return x, P

    def geometry(self, x: Array, scan: Scan) -> _Geometry:
        if not self.relative:
            C = effective_covariance(scan.rd_covariance, scan.sigma_p)
            return _Geometry(scan.reference, scan.companions, C)
        d = scan.reference.shape[-1]
        baselines = scan.companions - scan.reference[..., None, :]
        C = effective_relative_covariance(scan.rd_covariance, scan.sigma_p, x[..., :d], baselines)
        return _Geometry(np.zeros_like(scan.reference), baselines, C)

    def track(self, belief: Belief, scan: Scan) -> Track:
        d = scan.reference.shape[-1]
        x = belief.x[..., : 2 * d]
        if self.relative and not self.accelerated:
            x = x.copy()
            x[..., d:] -= scan.velocity
        return Track(x, belief.P[..., : 2 * d, : 2 * d])


def _checked(prior: Prior) -> tuple[Array, Array]:
    """Mean and covariance of a prior that can be one."""
    size = 3 * (prior.reference.shape[-1] // 2 + 1)
    return (
        as_finite("prior.mean", prior.mean, size),
        as_covariance("prior.covariance", prior.covariance, size, size),
    )


def _coordinates(state: State, process_noise: Sequence[float]) -> _Coordinates:
    noise = tuple(process_noise)
    match state:
        case "absolute":
            return _Coordinates(ConstantVelocity(noise), relative=False, accelerated=False)
        case "relative":
            return _Coordinates(ConstantVelocity(noise), relative=True, accelerated=False)
        case "accelerated":
            return _Coordinates(ConstantAcceleration(noise), relative=True, accelerated=True)
    raise EstimationError(f"state must be 'absolute', 'relative' or 'accelerated', not {state!r}.")


# --- Filters ---------------------------------------------------------------------------


@dataclass(frozen=True)
class _InCoordinates:
    coordinates: _Coordinates

    @property
    def relative(self) -> bool:
        return self.coordinates.relative

    def start(self, prior: Prior) -> Belief:
        return self.coordinates.start(prior)

    def track(self, belief: Belief, scan: Scan) -> Track:
        return self.coordinates.track(belief, scan)


@dataclass(frozen=True)
class _ConsistentNcrkf(_InCoordinates):
    def step(self, belief: Belief, scan: Scan) -> Belief:
        x, P = self.coordinates.predict(belief, scan)
        at = self.coordinates.geometry(x, scan)
        # The positions' noise is in the covariance already: sigma_p 0 adds nothing.
        result = ncrkf_kernel.update(
            x, P, at.reference, at.companions, scan.rd, at.covariance, sigma_p=0.0
        )
        return Belief(result.x, result.P, result.guarded)


@dataclass(frozen=True)
class _IteratedEkf(_InCoordinates):
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

    def start(self, prior: Prior) -> Belief:
        return self._in(prior.reference.shape[-1] // 2).start(prior)

    def step(self, belief: Belief, scan: Scan) -> Belief:
        x, P = self._in(scan.reference.shape[-1]).predict(belief, scan)
        baselines = scan.companions - scan.reference[..., None, :]
        R = np.diag(np.diag(scan.rd_covariance))
        return Belief(
            *ekf_kernel.update(x, P, np.zeros_like(scan.reference), baselines, scan.rd, R)
        )

    def track(self, belief: Belief, scan: Scan) -> Track:
        return self._in(scan.reference.shape[-1]).track(belief, scan)

    @staticmethod
    @cache
    def _in(d: int) -> _Coordinates:
        return _coordinates("accelerated", (_JUMP,) * d)


@cache
def _paper_s_motion(d: int) -> ConstantAcceleration:
    return ConstantAcceleration((*(_JUMP,) * d, 2.0 * _JUMP))


@dataclass(frozen=True)
class _PaperState:
    """The paper's state: position and range, and their derivatives."""

    relative: bool = True

    @staticmethod
    def start(prior: Prior) -> Belief:
        x, P = _checked(prior)
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
    def track(belief: Belief, scan: Scan) -> Track:
        d = scan.reference.shape[-1]
        picked = [*range(d), *range(d + 1, 2 * d + 1)]
        return Track(belief.x[..., picked], belief.P[..., picked, :][..., picked])


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
