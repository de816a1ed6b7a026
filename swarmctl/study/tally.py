"""Sums over Monte Carlo runs at every epoch, and the statistics made of them.

Sums add, so runs may be reduced as they come, in any number of chunks; memory does not grow
with the number of runs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import NamedTuple, Self

import numpy as np
from scipy.special import betaincinv, gammaincinv

from swarmctl.units import CHI2_95_2DOF, Array, Mask

NORMAL_95 = 1.959964
"""Two-sided 95 % quantile of the normal distribution."""

BROKEN = 1e9
"""An error (m, m/s) beyond this, or a claimed variance beyond its square, is no number: the
filter broke down. Powers of what remains do not overflow."""
LOST_ERROR_M = 500.0
LOST_NEES = 30.0
"""A track with a greater error or NEES counts as lost (chi-squared: 3e-7 by chance)."""


@dataclass
class Tally:
    """Sums over runs; K epochs, the state is position and velocity east and north.

    Attributes:
        runs: Runs in all.
        finite: Runs whose numbers are below :data:`BROKEN`, (K,); the sums are over these.
        error: Σ error, (K, 4).
        square: Σ error², (K, 4).
        position_square: Σ |position error|², (K,).
        position_fourth: Σ |position error|⁴, (K,).
        variance: Σ variance claimed by the filter, (K, 4).
        proper: Runs whose position covariance is positive definite, (K,); NEES needs one.
        nees: Σ position NEES, (K,).
        nees_square: Σ NEES², (K,).
        inside: Runs with the truth inside the claimed 95 % ellipse, (K,).
        lost: Runs lost, (K,).
        guarded: Updates in which the filter's guard fired, over all runs, (K,).
    """

    runs: int
    finite: Array
    error: Array
    square: Array
    position_square: Array
    position_fourth: Array
    variance: Array
    proper: Array
    nees: Array
    nees_square: Array
    inside: Array
    lost: Array
    guarded: Array

    @classmethod
    def of(cls, error: Array, variance: Array, covariance: Array, guarded: Array) -> Self:
        """Add up runs.

        Args:
            error: Estimate less truth, (K, runs, 4).
            variance: Claimed, (K, runs, 4).
            covariance: Claimed, of east with north, (K, runs).
            guarded: Firings of the guard, (K,).
        """
        # Written so that NaN fails too.
        finite: Mask = (np.abs(error).max(-1) < BROKEN) & (np.abs(variance).max(-1) < BROKEN**2)
        finite &= np.abs(covariance) < BROKEN**2
        error = np.where(finite[..., None], error, 0.0)
        variance = np.where(finite[..., None], variance, 0.0)
        covariance = np.where(finite, covariance, 0.0)
        squares = error * error
        position = squares[..., 0] + squares[..., 1]
        east, north = variance[..., 0], variance[..., 1]
        determinant = east * north - covariance * covariance
        proper = finite & (east > 0.0) & (determinant > 0.0)
        form = north * squares[..., 0] + east * squares[..., 1]
        form -= 2.0 * covariance * error[..., 0] * error[..., 1]
        nees = np.where(proper, form / np.where(proper, determinant, 1.0), 0.0)
        lost = ~proper | (position > LOST_ERROR_M**2) | (nees > LOST_NEES)
        return cls(
            runs=error.shape[1],
            finite=finite.sum(1, dtype=float),
            error=error.sum(1),
            square=squares.sum(1),
            position_square=position.sum(1),
            position_fourth=(position * position).sum(1),
            variance=variance.sum(1),
            proper=proper.sum(1, dtype=float),
            nees=nees.sum(1),
            nees_square=(nees * nees).sum(1),
            inside=(proper & (nees < CHI2_95_2DOF)).sum(1, dtype=float),
            lost=lost.sum(1, dtype=float),
            guarded=guarded.astype(float),
        )

    def __iadd__(self, other: Self) -> Self:
        for field in fields(self):
            setattr(self, field.name, getattr(self, field.name) + getattr(other, field.name))
        return self

    @property
    def mean_error(self) -> Array:
        """Mean of the errors, (K, 4): the paper's Figs. 4 and 6."""
        return _mean(self.error, self.finite[:, None])

    @property
    def standard_deviation(self) -> Array:
        """Standard deviation of the errors about their mean, (K, 4): Figs. 5 and 7."""
        mean_square = _mean(self.square, self.finite[:, None])
        deviation: Array = np.sqrt(np.maximum(mean_square - self.mean_error**2, 0.0))
        return deviation

    @property
    def claimed(self) -> Array:
        """Root of the mean variance the filter claims, (K, 4)."""
        claimed: Array = np.sqrt(np.maximum(_mean(self.variance, self.finite[:, None]), 0.0))
        return claimed

    @property
    def rmse(self) -> Array:
        """Root mean square of the position's error, (K,), m."""
        rmse: Array = np.sqrt(_mean(self.position_square, self.finite))
        return rmse

    @property
    def velocity_rmse(self) -> Array:
        """Root mean square of the velocity's error, (K,), m/s."""
        rmse: Array = np.sqrt(_mean(self.square[:, 2] + self.square[:, 3], self.finite))
        return rmse

    @property
    def rmse_interval(self) -> Array:
        """95 % confidence interval of the RMSE, (K, 2), m.

        The interval of the mean square by the central limit theorem, then its root.
        """
        low, high = _interval(self.position_square, self.position_fourth, self.finite)
        interval: Array = np.sqrt(np.stack([np.maximum(low, 0.0), high], axis=-1))
        return interval

    @property
    def mean_nees(self) -> Array:
        """Mean position NEES over the runs, (K,); 2 is right."""
        return _mean(self.nees, self.proper)

    @property
    def nees_interval(self) -> Array:
        """95 % confidence interval of the mean NEES, (K, 2), by the central limit theorem."""
        return np.stack(_interval(self.nees, self.nees_square, self.proper), axis=-1)

    @property
    def coverage(self) -> Array:
        """Share of runs with the truth inside the claimed 95 % ellipse, (K,)."""
        share: Array = self.inside / self.runs
        return share


@dataclass
class BoundTally:
    """Cramér-Rao bounds, added up over the runs they were computed for.

    Attributes:
        count: How many.
        variance: Σ of the bound's diagonal, (K, 4): position and velocity.
    """

    count: int
    variance: Array

    def __iadd__(self, other: Self) -> Self:
        self.count += other.count
        self.variance = self.variance + other.variance
        return self

    @property
    def standard_deviation(self) -> Array:
        """Root of the mean bound, (K, 4)."""
        deviation: Array = np.sqrt(self.variance / self.count)
        return deviation

    @property
    def rmse(self) -> Array:
        """Bound of the position's RMSE, (K,), m."""
        rmse: Array = np.sqrt((self.variance[:, 0] + self.variance[:, 1]) / self.count)
        return rmse


def _mean(total: Array, count: Array) -> Array:
    """Mean of ``count`` numbers that add up to ``total``; NaN where there are none."""
    mean: Array = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0.0)
    return mean


def _interval(total: Array, square: Array, count: Array) -> tuple[Array, Array]:
    mean = _mean(total, count)
    variance = np.maximum(_mean(square, count) - mean**2, 0.0)
    half = NORMAL_95 * np.sqrt(variance / np.maximum(count - 1.0, 1.0))
    return mean - half, mean + half


# --- Intervals of counts and means -------------------------------------------------------


class Interval(NamedTuple):
    """A mean over runs with its 95 % confidence interval."""

    value: float
    low: float
    high: float


def mean_of(values: Array) -> Interval:
    """Mean of independent numbers, (runs,), by the central limit theorem."""
    mean = float(values.mean())
    half = NORMAL_95 * float(values.std(ddof=1)) / math.sqrt(len(values))
    return Interval(mean, mean - half, mean + half)


def root_ratio(squares: Array, others: Array) -> Interval:
    """Root of the ratio of two means over the same runs, (runs,), by the delta method."""
    ratio = float(squares.mean() / others.mean())
    off = mean_of(squares - ratio * others)
    half = (off.high - off.value) / float(others.mean())
    return Interval(math.sqrt(ratio), math.sqrt(max(ratio - half, 0.0)), math.sqrt(ratio + half))


def share(count: int, runs: int) -> Interval:
    """Share of the runs, with the exact interval of Clopper and Pearson."""
    low = float(betaincinv(count, runs - count + 1, 0.025)) if count else 0.0
    high = float(betaincinv(count + 1, runs - count, 0.975)) if count < runs else 1.0
    return Interval(count / runs, low, high)


def poisson_rate(count: int, hours: float) -> Interval:
    """Events an hour, with the exact interval."""
    low = float(gammaincinv(count, 0.025)) if count else 0.0
    return Interval(count / hours, low / hours, float(gammaincinv(count + 1, 0.975)) / hours)
