"""What a study's filter is given and gives: from a common prior and scans to a common answer.

A filter is a frozen description without a state of its own: ``start`` makes a :class:`Belief`,
``step`` makes the next one, ``estimate`` reads it. All arrays carry leading axes of runs, so one
object filters one run or a thousand. To add a filter, write a class with these three methods and
the attribute ``relative`` (:class:`BatchFilter`); nothing needs to be inherited.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from swarmctl.units import Array, Mask


class RelativePrior(NamedTuple):
    """What is known before the first measurement, in the paper's state.

    Attributes:
        mean: Emitter relative to the reference UAV: [position, range, and their first and
            second derivatives], (..., 3(d + 1)), SI.
        covariance: Covariance of the mean, (3(d + 1), 3(d + 1)).
        reference: Position and velocity of the reference UAV by navigation, (..., 2d), SI.
    """

    mean: Array
    covariance: Array
    reference: Array


class Truth(NamedTuple):
    """What is measured, without noise. Only the OKF looks at it.

    Attributes:
        baselines: (..., N, d), m.
        rd: (..., N), m.
    """

    baselines: Array
    rd: Array


class Scan(NamedTuple):
    """What one epoch gives a filter.

    Attributes:
        dt: Time since the previous epoch, s; 0 at the first.
        reference: Measured position of the reference UAV, (..., d), m.
        velocity: Mean velocity of the reference UAV since the previous epoch, by navigation,
            (..., d), m/s.
        companions: Measured positions, (..., N, d), m.
        rd: Measured range differences, (..., N), m.
        rd_covariance: Covariance of the receivers' noise, (N, N), m².
        sigma_p: 1-sigma of every measured position per axis, m.
        truth: The true values, for filters that are told them.
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


class BatchEstimate(NamedTuple):
    """A filter's answer in all runs.

    Attributes:
        x: Position and velocity of the emitter, (..., 2d), SI; relative to the reference UAV
            if the filter is ``relative``.
        P: Covariance, (..., 2d, 2d).
    """

    x: Array
    P: Array


class BatchFilter(Protocol):
    """Anything that follows an emitter through scans, in all runs at once."""

    @property
    def relative(self) -> bool:
        """Whether it estimates the emitter relative to the reference UAV."""

    def start(self, prior: RelativePrior) -> Belief:
        """The belief before the first scan.

        Raises:
            EstimationError: The prior does not fit the filter.
        """

    def step(self, belief: Belief, scan: Scan) -> Belief:
        """Predict over ``scan.dt``, then use the measurements."""

    def estimate(self, belief: Belief, scan: Scan) -> BatchEstimate:
        """Position and velocity at the epoch of ``scan``, the last one used."""
