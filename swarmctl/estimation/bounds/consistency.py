"""Does the covariance tell the truth? NEES and its interval; and the covariance to look at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import gammaincinv

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import as_finite
from swarmctl.units import Array


def nees(error: ArrayLike, covariance: ArrayLike) -> Array:
    """Normalised estimation error squared, ``errorᵀ P⁻¹ error``.

    Chi-squared with n degrees of freedom (mean n) if the estimator is consistent.

    Args:
        error: Estimate less truth, (..., n).
        covariance: The estimator's covariance of it, (..., n, n).

    Returns:
        (...).

    Raises:
        EstimationError: A shape is wrong, a number not finite, or a covariance singular.
    """
    error = as_finite("error", error, None)
    n = error.shape[-1]
    covariance = as_finite("covariance", covariance, n, n)
    try:
        scaled = np.linalg.solve(covariance, error[..., None])[..., 0]
    except np.linalg.LinAlgError:
        raise EstimationError("covariance must not be singular.") from None
    result: Array = np.vecdot(error, scaled)
    return result


def mean_bounds(dof: int, runs: int, probability: float = 0.95) -> tuple[float, float]:
    """Two-sided interval of the mean of independent chi-squared numbers.

    The sum over the runs of chi-squared numbers with ``dof`` degrees of freedom is chi-squared
    with ``runs * dof`` (Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking
    and Navigation", 2001, section 5.4).

    Args:
        dof: Degrees of freedom of one number: the length of the error (NEES) or the number of
            range differences (NIS).
        runs: Independent runs averaged over.
        probability: That of the mean lying inside.

    Returns:
        Lower and upper bound of the mean.

    Raises:
        EstimationError: dof or runs is below 1, or the probability not between 0 and 1.
    """
    if dof < 1 or runs < 1 or not 0.0 < probability < 1.0:
        raise EstimationError(
            "dof and runs must be at least 1 and probability between 0 and 1, "
            f"not {dof}, {runs}, {probability}."
        )
    tail = 0.5 * (1.0 - probability)
    half = 0.5 * dof * runs
    low, high = (2.0 * float(gammaincinv(half, p)) / runs for p in (tail, 1.0 - tail))
    return low, high


class Ellipse(NamedTuple):
    """Horizontal 1-sigma ellipse.

    Attributes:
        major: Semi-major axis, (...).
        minor: Semi-minor axis, (...).
        angle_rad: Direction of the major axis from East, counter-clockwise, (...), in
            (-pi/2, pi/2].
    """

    major: Array
    minor: Array
    angle_rad: Array


def ellipse(covariance: Array) -> Ellipse:
    """Horizontal 1-sigma ellipse of a covariance.

    A 2-D Gaussian lies inside it with probability 39 %; for 95 % scale the axes by 2.4477.

    Args:
        covariance: (..., n, n), n >= 2, positive semi-definite, its first two axes East and
            North. In m² for a position; the axes then are in m.

    Raises:
        EstimationError: It has the wrong shape.
    """
    if covariance.ndim < 2 or covariance.shape[-1] < 2 or covariance.shape[-2] < 2:
        raise EstimationError(f"covariance must be (..., n, n), n >= 2, not {covariance.shape}.")
    east, north, cross = covariance[..., 0, 0], covariance[..., 1, 1], covariance[..., 0, 1]
    middle = 0.5 * (east + north)
    radius = np.hypot(0.5 * (east - north), cross)
    return Ellipse(
        np.sqrt(middle + radius),
        np.sqrt(np.maximum(middle - radius, 0.0)),
        0.5 * np.arctan2(2.0 * cross, east - north),
    )
