"""What is drawn before a run begins: the filter's prior, and the emitter's true motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from swarmctl.study.batch_filter import RelativePrior
from swarmctl.study.engagement import Engagement, prior_at, relative_state
from swarmctl.units import Array

CV = (0, 1, 3, 4)
"""Entries of the paper's state that a constant-velocity state has."""
CA = (0, 1, 3, 4, 6, 7)
"""Entries of the paper's state that a constant-acceleration state has."""

JUMP = (0.1**2, 0.1**2)
"""Variance of an acceleration's jump per step, Table 1's Q, (m/s²)²."""


def table_1_covariance(scale: float = 1.0) -> Array:
    """P0 of Table 1 for the paper's state, (9, 9), times ``scale``².

    Position 33 m, velocity 10 m/s, acceleration 3.3 m/s² per axis; twice the variance for the
    range and its derivatives.
    """
    sigmas = np.repeat([100.0, 30.0, 10.0], 3) / 3.0 * scale
    return np.diag(sigmas**2 * np.tile([1.0, 1.0, 2.0], 3))


class Draw(NamedTuple):
    """The beginning of some runs.

    Attributes:
        prior: Its mean is (runs, 9).
        emitter: True position and velocity at the start: (4,) if the same in all runs, or
            (runs, 4).
        disturbed: Whether the emitter's velocity is disturbed by the case's process noise.
    """

    prior: RelativePrior
    emitter: Array
    disturbed: bool


def fixed_frame(prior: RelativePrior) -> tuple[Array, Array]:
    """Position and velocity of a prior in the fixed frame: own motion is known.

    Returns:
        Means (runs, 4) and their covariance (4, 4).
    """
    return prior.mean[:, CV] + prior.reference, prior.covariance[np.ix_(CV, CV)]


class Start(Protocol):
    """A way to begin a run."""

    def covariance(self) -> Array:
        """Covariance of the prior, in the paper's state, (9, 9)."""

    def draw(self, engagement: Engagement, rng: np.random.Generator, runs: int) -> Draw:
        """Begin ``runs`` runs."""


@dataclass(frozen=True)
class DrawnEstimate:
    """As in the paper: the emitter moves as in Table 1, x^_0 ~ N(x_0, scale² P0)."""

    scale: float = 1.0

    def covariance(self) -> Array:
        """As :meth:`Start.covariance`."""
        return table_1_covariance(self.scale)

    def draw(self, engagement: Engagement, rng: np.random.Generator, runs: int) -> Draw:
        """As :meth:`Start.draw`."""
        P = self.covariance()
        truth = relative_state(engagement, engagement.emitter)
        mean = truth + rng.standard_normal((runs, 9)) * np.sqrt(np.diag(P))
        return Draw(prior_at(mean, P, engagement), engagement.emitter, disturbed=False)


@dataclass(frozen=True)
class DrawnTruth:
    """As a Bayesian means it: x^_0 is fixed, the truth is drawn N(x^_0, P0) and disturbed.

    Only position and velocity of x^_0 are fixed, which is all the truth has. The paper's
    filters also start with a range and an acceleration; those are drawn as in Table 1.
    """

    @staticmethod
    def covariance() -> Array:
        """As :meth:`Start.covariance`."""
        return table_1_covariance()

    def draw(self, engagement: Engagement, rng: np.random.Generator, runs: int) -> Draw:
        """As :meth:`Start.draw`."""
        P = self.covariance()
        sigmas = np.sqrt(np.diag(P))
        errors = rng.standard_normal((runs, 9)) * sigmas
        emitter = engagement.emitter - errors[:, CV]
        mean = relative_state(engagement, emitter) + errors
        # The same in all runs, but for rounding, which would tell runs apart.
        mean[:, CV] = relative_state(engagement, engagement.emitter)[list(CV)]
        return Draw(prior_at(mean, P, engagement), emitter, disturbed=True)


@dataclass(frozen=True)
class RangeIgnorant:
    """The bearing is known, the range is not: x^_0 at 10 km +- 5 km, the emitter at 5 km.

    Across the line of sight the prior's sigma is 500 m; velocity and acceleration are drawn
    as in Table 1.
    """

    assumed_range_m: float = 10_000.0
    range_sigma_m: float = 5_000.0
    cross_sigma_m: float = 500.0

    def covariance(self) -> Array:
        """As :meth:`Start.covariance`."""
        P = table_1_covariance()
        P[0, 0] = P[2, 2] = self.range_sigma_m**2
        P[1, 1] = self.cross_sigma_m**2
        return P

    def draw(self, engagement: Engagement, rng: np.random.Generator, runs: int) -> Draw:
        """As :meth:`Start.draw`."""
        P = self.covariance()
        mean = relative_state(engagement, engagement.emitter) + np.zeros((runs, 9))
        mean[:, 3:] += rng.standard_normal((runs, 6)) * np.sqrt(np.diag(P))[3:]
        # The true bearing at the start is due east.
        mean[:, 0] = mean[:, 2] = self.assumed_range_m
        return Draw(prior_at(mean, P, engagement), engagement.emitter, disturbed=False)


@dataclass(frozen=True)
class Anywhere:
    """Nothing is known: neither where the emitter is round the swarm nor its velocity.

    The mean is at the reference UAV, where no filter can linearise.
    """

    reach_m: float = 15_000.0
    speed_mps: float = 30.0

    def covariance(self) -> Array:
        """As :meth:`Start.covariance`, for a place that is uniform over the disc."""
        P = table_1_covariance()
        P[:3, :3] = np.diag([0.25, 0.25, 0.5]) * self.reach_m**2
        P[3:6, 3:6] = np.diag([1.0, 1.0, 2.0]) * self.speed_mps**2
        return P

    def draw(self, engagement: Engagement, rng: np.random.Generator, runs: int) -> Draw:
        """As :meth:`Start.draw`; nothing is drawn."""
        del rng
        prior = prior_at(np.zeros((runs, 9)), self.covariance(), engagement)
        prior.mean[:, 3:5] = -prior.reference[2:]
        return Draw(prior, engagement.emitter, disturbed=False)
