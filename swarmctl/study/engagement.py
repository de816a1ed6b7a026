"""The engagement of the paper's Table 1: who is where, and what is measured.

The paper leaves the guidance open ("guided towards the target"); here the reference UAV flies
pure proportional navigation, and the formation turns with the true line of sight. Two axes,
east and north. Arrays have leading axes of runs where the runs differ.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swarmctl.errors import UsageError
from swarmctl.estimation.model.motion import ConstantVelocity
from swarmctl.estimation.model.range_difference import range_differences, rd_covariance
from swarmctl.study.batch_filter import RelativePrior, Scan, Truth
from swarmctl.units import Array


@dataclass(frozen=True)
class Engagement:
    """Parameters, with the values of Table 1.

    Attributes:
        period_s: Time between two measurements.
        duration_s: Duration of the whole; the closest range is then about 600 m.
        speed_mps: Speed of the reference UAV, constant.
        heading_rad: Heading of the reference UAV at the start.
        gain: Gain of the proportional navigation; not in the paper.
        range_m: Range from the reference UAV to the emitter at the start, due east.
        emitter_speed_mps: Speed of the emitter, constant.
        emitter_heading_rad: Heading of the emitter.
        sigma_r_m: 1-sigma of a range difference.
        sigma_p_m: 1-sigma of a measured UAV position per axis.
        rho: Share of a range difference's variance that comes from the reference receiver.
    """

    period_s: float = 0.02
    duration_s: float = 16.0
    speed_mps: float = 270.0
    heading_rad: float = math.radians(30.0)
    gain: float = 3.0
    range_m: float = 5000.0
    emitter_speed_mps: float = 20.0
    emitter_heading_rad: float = math.radians(135.0)
    sigma_r_m: float = 0.5
    sigma_p_m: float = 0.5
    rho: float = 0.0

    @property
    def epochs_s(self) -> Array:
        """Epochs of measurements, (K,), s."""
        return self.period_s * np.arange(round(self.duration_s / self.period_s) + 1)

    @property
    def emitter(self) -> Array:
        """Position and velocity of the emitter at the start, (4,), SI."""
        heading = self.emitter_heading_rad
        velocity = self.emitter_speed_mps * np.array([math.cos(heading), math.sin(heading)])
        return np.concatenate([np.zeros(2), velocity])

    def rd_covariance(self, companions: int) -> Array:
        """Covariance of the receivers' noise, (N, N), m²."""
        return rd_covariance(np.full(companions, self.sigma_r_m), self.rho)


class Moment(NamedTuple):
    """The truth at one epoch.

    Attributes:
        dt: Time since the previous epoch, s.
        emitter: Position and velocity, (..., 4), SI.
        reference: Position of the reference UAV, (..., 2), m.
        velocity: Mean velocity of the reference UAV since the previous epoch, (..., 2), m/s.
        companions: Positions, (..., N, 2), m.
    """

    dt: float
    emitter: Array
    reference: Array
    velocity: Array
    companions: Array


class Turn(NamedTuple):
    """A sudden change of the emitter's velocity.

    Attributes:
        at_s: Time since the start.
        by_rad: Change of heading, counter-clockwise.
        speed: Speed afterwards as a share of the speed before: 0 is a stop.
    """

    at_s: float
    by_rad: float
    speed: float

    def of(self, emitter: Array) -> Array:
        """Position and velocity afterwards, (..., 4)."""
        c, s = self.speed * math.cos(self.by_rad), self.speed * math.sin(self.by_rad)
        turned = emitter.copy()
        turned[..., 2] = c * emitter[..., 2] - s * emitter[..., 3]
        turned[..., 3] = s * emitter[..., 2] + c * emitter[..., 3]
        return turned


def fly(
    engagement: Engagement,
    formation: Array,
    emitter: Array,
    motion: ConstantVelocity | None = None,
    rng: np.random.Generator | None = None,
    turn: Turn | None = None,
) -> Iterator[Moment]:
    """The truth, epoch by epoch.

    Args:
        engagement: The parameters.
        formation: Angle from the line of sight and distance from the reference UAV of each
            companion, (N, 2), rad and m.
        emitter: Position and velocity of the emitter at the start, (..., 4), SI.
        motion: The model whose noise disturbs the emitter; None for no disturbance.
        rng: Drives the disturbance.
        turn: A change of velocity on the way.

    Raises:
        UsageError: The formation has not the shape (N, 2), or a disturbed emitter no rng.
    """
    if formation.ndim != 2 or formation.shape[1] != 2 or len(formation) == 0:
        raise UsageError(
            "A formation must be (N, 2), one row (angle rad, distance m) per companion, not "
            f"{formation.shape}."
        )
    T = engagement.period_s
    F, Q = (motion or ConstantVelocity((0.0, 0.0))).step(T)
    root = None
    if motion is not None:
        if rng is None:
            raise UsageError("A disturbed emitter needs a random generator.")
        # By eigenvalues: an axis without noise makes Q singular.
        eigenvalues, vectors = np.linalg.eigh(Q)
        root = vectors * np.sqrt(np.maximum(eigenvalues, 0.0))
    heading: Array = np.full(emitter.shape[:-1], engagement.heading_rad)
    reference = np.zeros((*emitter.shape[:-1], 2))
    reference[..., 0] = -engagement.range_m
    velocity = engagement.speed_mps * _direction(heading)
    dt = 0.0
    turn_at = None if turn is None else round(turn.at_s / T)
    for k in range(len(engagement.epochs_s)):
        if turn is not None and k == turn_at:
            emitter = turn.of(emitter)
        sight = emitter[..., :2] - reference
        toward = np.arctan2(sight[..., 1], sight[..., 0])[..., None] + formation[:, 0]
        companions = reference[..., None, :] + formation[:, 1, None] * _direction(toward)
        yield Moment(dt, emitter, reference, velocity, companions)

        dt = T
        closing = emitter[..., 2:] - velocity
        across = sight[..., 0] * closing[..., 1] - sight[..., 1] * closing[..., 0]
        heading = heading + engagement.gain * T * across / np.vecdot(sight, sight)
        velocity = engagement.speed_mps * _direction(heading)
        reference = reference + T * velocity
        emitter = emitter @ F.T
        if root is not None and rng is not None:
            emitter = emitter + rng.standard_normal(emitter.shape) @ root.T


def own_acceleration(engagement: Engagement, emitter: Array) -> Array:
    """Acceleration of the reference UAV at the start, (..., 2), m/s²."""
    heading = engagement.heading_rad
    closing = emitter[..., 2:] - engagement.speed_mps * _direction(np.asarray(heading))
    sight = emitter[..., :2] + [engagement.range_m, 0.0]
    turn = sight[..., 0] * closing[..., 1] - sight[..., 1] * closing[..., 0]
    rate = engagement.gain * turn / np.vecdot(sight, sight)
    across = np.array([-math.sin(heading), math.cos(heading)])
    acceleration: Array = engagement.speed_mps * rate[..., None] * across
    return acceleration


def relative_state(engagement: Engagement, emitter: Array) -> Array:
    """The paper's state of the emitter at the start, (..., 9), SI.

    Position relative to the reference UAV, range, and their first and second derivatives.

    Args:
        engagement: The parameters.
        emitter: Position and velocity at the start, (..., 4), SI.
    """
    p = emitter[..., :2] + [engagement.range_m, 0.0]
    v = emitter[..., 2:] - engagement.speed_mps * _direction(np.asarray(engagement.heading_rad))
    a = -own_acceleration(engagement, emitter)
    D = np.sqrt(np.vecdot(p, p))
    rate = np.vecdot(p, v) / D
    second = (np.vecdot(v, v) + np.vecdot(p, a) - rate * rate) / D
    parts = [p, D[..., None], v, rate[..., None], a, second[..., None]]
    return np.concatenate(parts, axis=-1)


def measure(engagement: Engagement, moment: Moment, rng: np.random.Generator, runs: int) -> Scan:
    """One epoch's measurements for each of ``runs`` runs, white noise."""
    n = moment.companions.shape[-2]
    Cr = engagement.rd_covariance(n)
    noise = rng.standard_normal((runs, n + 2 * (n + 1)))
    of_positions = engagement.sigma_p_m * noise[:, n:].reshape(runs, n + 1, 2)
    rd = range_differences(moment.emitter[..., :2], moment.reference, moment.companions)
    return Scan(
        moment.dt,
        moment.reference + of_positions[:, 0],
        moment.velocity,
        moment.companions + of_positions[:, 1:],
        rd + noise[:, :n] @ np.linalg.cholesky(Cr).T,
        Cr,
        engagement.sigma_p_m,
        Truth(moment.companions - moment.reference[..., None, :], rd),
    )


def prior_at(mean: Array, covariance: Array, engagement: Engagement) -> RelativePrior:
    """A prior at the start, when the place of the reference UAV is known."""
    velocity = engagement.speed_mps * _direction(np.asarray(engagement.heading_rad))
    return RelativePrior(mean, covariance, np.array([-engagement.range_m, 0.0, *velocity]))


def _direction(angle: Array) -> Array:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)
