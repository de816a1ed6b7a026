"""Coordinates in which a study's filter may follow the emitter.

``absolute``
    The emitter in a fixed frame, with constant velocity.
``relative``
    The emitter relative to the reference UAV, with constant velocity, own motion subtracted.
``accelerated``
    The emitter relative to the reference UAV, with constant acceleration, own motion unknown:
    the paper's choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import as_covariance, as_finite
from swarmctl.estimation.model.motion import ConstantAcceleration, ConstantVelocity, Motion
from swarmctl.estimation.model.range_difference import (
    effective_covariance,
    effective_relative_covariance,
)
from swarmctl.study.batch_filter import BatchEstimate, Belief, RelativePrior, Scan
from swarmctl.units import Array

CoordinatesName = Literal["absolute", "relative", "accelerated"]
"""Their names; see the module."""


class Geometry(NamedTuple):
    """Where an update's RDs are computed, and their covariance about the computed ones.

    Attributes:
        reference: Position of the reference UAV, (..., d), m.
        companions: Positions, (..., N, d), m.
        covariance: (..., N, N) or (N, N), m².
    """

    reference: Array
    companions: Array
    covariance: Array


@dataclass(frozen=True)
class Coordinates:
    """How a state is made of a prior, predicted, and read.

    Attributes:
        motion: How the emitter moves.
        relative: Whether the position is relative to the reference UAV.
        accelerated: Whether the state has an acceleration.
    """

    motion: Motion
    relative: bool
    accelerated: bool

    def start(self, prior: RelativePrior) -> Belief:
        """The belief before the first scan.

        Raises:
            EstimationError: The prior is none, or has other axes than the process noise.
        """
        d = prior.reference.shape[-1] // 2
        blocks = 3 if self.accelerated else 2
        picked = [block * (d + 1) + axis for block in range(blocks) for axis in range(d)]
        mean, covariance = checked(prior)
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
        """State and covariance at the epoch of a scan, before its measurements."""
        x, P = belief.x, belief.P
        if scan.dt == 0.0:
            return x, P
        F, Q = self.motion.step(scan.dt)
        Ft = F.T.copy()  # in order in memory: twice as fast
        x, P = x @ Ft, F @ P @ Ft + Q
        if self.relative and not self.accelerated:
            x[..., : scan.velocity.shape[-1]] -= scan.velocity * scan.dt
        return x, P

    def geometry(self, x: Array, scan: Scan) -> Geometry:
        """Where the RDs of a scan are computed for predicted states x, (..., n)."""
        if not self.relative:
            C = effective_covariance(scan.rd_covariance, scan.sigma_p)
            return Geometry(scan.reference, scan.companions, C)
        d = scan.reference.shape[-1]
        baselines = scan.companions - scan.reference[..., None, :]
        C = effective_relative_covariance(scan.rd_covariance, scan.sigma_p, x[..., :d], baselines)
        return Geometry(np.zeros_like(scan.reference), baselines, C)

    def estimate(self, belief: Belief, scan: Scan) -> BatchEstimate:
        """Position and velocity at the epoch of a scan."""
        d = scan.reference.shape[-1]
        x = belief.x[..., : 2 * d]
        if self.relative and not self.accelerated:
            x = x.copy()
            x[..., d:] -= scan.velocity
        return BatchEstimate(x, belief.P[..., : 2 * d, : 2 * d])


def checked(prior: RelativePrior) -> tuple[Array, Array]:
    """Mean and covariance of a prior.

    Raises:
        EstimationError: They have the wrong shape, are not finite, or are no covariance.
    """
    size = 3 * (prior.reference.shape[-1] // 2 + 1)
    return (
        as_finite("prior.mean", prior.mean, size),
        as_covariance("prior.covariance", prior.covariance, size, size),
    )


def coordinates_named(state: CoordinatesName, process_noise: Sequence[float]) -> Coordinates:
    """Coordinates by name, with the process noise of their motion.

    Raises:
        EstimationError: There are no such coordinates.
    """
    noise = tuple(process_noise)
    match state:
        case "absolute":
            return Coordinates(ConstantVelocity(noise), relative=False, accelerated=False)
        case "relative":
            return Coordinates(ConstantVelocity(noise), relative=True, accelerated=False)
        case "accelerated":
            return Coordinates(ConstantAcceleration(noise), relative=True, accelerated=True)
    raise EstimationError(f"state must be 'absolute', 'relative' or 'accelerated', not {state!r}.")


@dataclass(frozen=True)
class InCoordinates:
    """The part of a filter that its coordinates settle: how it starts, and how it is read.

    Attributes:
        coordinates: Its own.
    """

    coordinates: Coordinates

    @property
    def relative(self) -> bool:
        """As :attr:`~swarmctl.study.batch_filter.BatchFilter.relative`."""
        return self.coordinates.relative

    def start(self, prior: RelativePrior) -> Belief:
        """As :meth:`~swarmctl.study.batch_filter.BatchFilter.start`."""
        return self.coordinates.start(prior)

    def estimate(self, belief: Belief, scan: Scan) -> BatchEstimate:
        """As :meth:`~swarmctl.study.batch_filter.BatchFilter.estimate`."""
        return self.coordinates.estimate(belief, scan)
