"""Objectives: functions that judge formation designs, in metres; lower is better.

An objective takes any number of designs (..., N, 2) of (theta rad, d m) in one call and returns
(...), so that a search can judge all candidates of a step at once. It does not check a design;
``swarmctl.formation.designs`` keeps the limits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swarmctl.errors import FormationError
from swarmctl.estimation.model.motion import transition
from swarmctl.estimation.model.range_difference import jacobian
from swarmctl.formation.information import fisher, noise_covariance, slots_in_los_frame
from swarmctl.formation.requirements import Requirements
from swarmctl.units import Array

Objective = Callable[[Array], Array]


def determinant(requirements: Requirements) -> Objective:
    """det(F)^(-1/4) of one epoch's Fisher information F, m: D-optimal designs minimise it.

    The geometric mean of the error ellipse's half axes. Infinite where the range differences
    do not observe the position.

    Args:
        requirements: The range and the noise count.
    """

    def objective(designs: Array) -> Array:
        F = fisher(designs, requirements.range_m, requirements.noise)
        return np.power(_determinant(F), -0.25, where=_observed(F), out=_infinite(F))

    return objective


def rms(requirements: Requirements) -> Objective:
    """sqrt(tr F^-1) of one epoch's Fisher information F, m: A-optimal designs minimise it.

    The root mean square of the position error. Infinite where the range differences do not
    observe the position.

    Args:
        requirements: The range and the noise count.
    """

    def objective(designs: Array) -> Array:
        F = fisher(designs, requirements.range_m, requirements.noise)
        observed = _observed(F)
        squared = np.divide(
            F[..., 0, 0] + F[..., 1, 1], _determinant(F), where=observed, out=_infinite(F)
        )
        return np.sqrt(squared)

    return objective


class Trajectory(NamedTuple):
    """Who is where while range differences come in.

    Attributes:
        epochs_s: Increasing, (K,), s. The prior holds at the first, the bound at the last.
        emitter: Its true positions, east and north, (K, 2), m.
        reference: The reference UAV's, (K, 2), m.
        weights: How many epochs of measurements each of these stands for, (K,).
        prior_covariance: Covariance of the emitter's position and velocity before the first range
            differences, positive definite, (4, 4), SI.
    """

    epochs_s: Array
    emitter: Array
    reference: Array
    weights: Array
    prior_covariance: Array


def thin(trajectory: Trajectory, epochs: int) -> Trajectory:
    """Fewer epochs that stand for all, by the trapezoidal rule; first and last are kept.

    Args:
        trajectory: K epochs.
        epochs: How many to keep, at least 2; K or more of them leave it as it is.

    Raises:
        FormationError: Fewer than 2 are to be kept.
    """
    if epochs < 2:
        raise FormationError(f"A trajectory needs at least 2 epochs, not {epochs}.")
    last = len(trajectory.epochs_s) - 1
    if epochs > last:
        return trajectory
    kept = np.round(np.linspace(0.0, last, epochs)).astype(int)
    # Each epoch between two kept ones shares its weight among them, by how near they are.
    share = np.interp(np.arange(last + 1), kept, np.arange(epochs))
    below = np.minimum(share.astype(int), epochs - 2)
    above = share - below
    weights: Array = np.zeros(epochs)
    np.add.at(weights, below, trajectory.weights * (1.0 - above))
    np.add.at(weights, below + 1, trajectory.weights * above)
    return Trajectory(
        trajectory.epochs_s[kept],
        trajectory.emitter[kept],
        trajectory.reference[kept],
        weights,
        trajectory.prior_covariance,
    )


def approach(
    range_m: float,
    speed_mps: float,
    duration_s: float,
    rate_hz: float,
    prior_covariance: ArrayLike,
    *,
    emitter_velocity: tuple[float, float] = (0.0, 0.0),
    epochs: int = 30,
) -> Trajectory:
    """A straight flight at constant speed towards where the emitter is at the start, due east.

    Args:
        range_m: From the reference UAV to the emitter at the start, m.
        speed_mps: Speed of the reference UAV, m/s.
        duration_s: Length of the flight, s.
        rate_hz: Rate of the measurements, 1/s.
        prior_covariance: Covariance of the emitter's position and velocity, (4, 4), SI.
        emitter_velocity: East and north, m/s, constant.
        epochs: How many the flight is thinned to.

    Raises:
        FormationError: The flight has less than one period of measurements, or reaches the
            emitter's place.
    """
    periods = round(duration_s * rate_hz)
    if periods < 1:
        raise FormationError(
            f"A flight of {duration_s:g} s at {rate_hz:g} Hz has no two epochs of measurements."
        )
    if speed_mps * duration_s >= range_m:
        raise FormationError(
            f"{duration_s:g} s at {speed_mps:g} m/s reach beyond the emitter, {range_m:g} m away."
        )
    epochs_s = np.arange(periods + 1) / rate_hz
    full = Trajectory(
        epochs_s,
        epochs_s[:, None] * np.array(emitter_velocity),
        np.column_stack((speed_mps * epochs_s - range_m, np.zeros(periods + 1))),
        np.ones(periods + 1),
        np.asarray(prior_covariance, dtype=np.float64),
    )
    return thin(full, epochs)


def track(requirements: Requirements, trajectory: Trajectory) -> Objective:
    """RMS position at the end of a trajectory by the Cramer-Rao bound of a steady emitter, m.

    The emitter keeps its velocity exactly (state: position and velocity, no process noise), so
    that information only adds up. With Phi_k from the last epoch's state to that of epoch k,

        J = Phi_0^T P0^-1 Phi_0 + sum_k w_k (H_k Phi_k)^T C^-1 (H_k Phi_k)

    and the objective is sqrt(tr of J^-1's position block). The design turns with the true line
    of sight of each epoch. The same as :func:`swarmctl.estimation.bounds.pcrb.pcrb`, for any number
    of designs at once.

    Args:
        requirements: N, the greatest slot distance and the noise count; the range is the
            trajectory's.
        trajectory: Who is where.

    Raises:
        FormationError: The emitter comes within the greatest slot distance of the reference UAV,
            the epochs do not increase, a shape is wrong or the prior not positive definite.
    """
    ages, sight = _require_trajectory(trajectory)
    ranges = np.sqrt(np.vecdot(sight, sight))
    if ranges.min() <= requirements.max_slot_distance_m:
        raise FormationError(
            f"The emitter comes within {ranges.min():g} m of the reference UAV; the greatest"
            f" slot distance, {requirements.max_slot_distance_m:g} m, must be less."
        )
    phi = transition(ages[0], 2)
    prior = phi.T @ np.linalg.inv(trajectory.prior_covariance) @ phi
    # Phi_k's position rows are [I, age I]: J has blocks w [[1, age], [age, age²]] (x) F_k.
    # F_k comes in the frame of the line of sight; `turn`'s columns are that frame's axes.
    along = sight / ranges[:, None]
    turn = np.stack((along, np.column_stack((-along[:, 1], along[:, 0]))), axis=-1)
    powers = np.stack((np.ones_like(ages), ages), axis=-1)
    outer = trajectory.weights[:, None, None] * powers[:, :, None] * powers[:, None, :]
    spread = np.einsum("kab,kip,kjq->kpqaibj", outer, turn, turn).reshape(4 * ages.size, 16)
    emitters = np.column_stack((ranges, np.zeros_like(ranges)))
    # All companions are equally good, so C = own I + common 1 1^T has its inverse in closed
    # form (Sherman-Morrison), which spares a product with an (N, N) matrix per epoch.
    C = noise_covariance(requirements.companions + 1, requirements.noise)
    common = C[0, 1]
    own = C[0, 0] - common
    shared = common / (own + requirements.companions * common)

    def objective(designs: Array) -> Array:
        H = jacobian(emitters, np.zeros(2), slots_in_los_frame(designs)[..., None, :, :])
        total = H.sum(axis=-2)
        F = (H.mT @ H - shared * total[..., :, None] * total[..., None, :]) / own
        batch = designs.shape[:-2]
        J = prior + (F.reshape(*batch, -1) @ spread).reshape(*batch, 4, 4)
        P = np.linalg.inv(J)
        result: Array = np.sqrt(P[..., 0, 0] + P[..., 1, 1])
        return result

    return objective


def _require_trajectory(trajectory: Trajectory) -> tuple[Array, Array]:
    """Times of the epochs after the last, (K,), s, and the lines of sight, (K, 2), m."""
    epochs_s, emitter, reference, weights, P = map(np.asarray, trajectory)
    count = epochs_s.size
    shapes = (epochs_s.shape, emitter.shape, reference.shape, weights.shape, P.shape)
    if count == 0 or shapes != ((count,), (count, 2), (count, 2), (count,), (4, 4)):
        raise FormationError(
            "A trajectory must have the shapes (K,), (K, 2), (K, 2), (K,) and (4, 4), not"
            f" {', '.join(map(str, shapes))}."
        )
    if not (np.diff(epochs_s) > 0.0).all():
        raise FormationError("A trajectory's epochs must increase.")
    # Written so that NaN fails too.
    if not (np.linalg.eigvalsh(P) > 0.0).all():
        raise FormationError("A trajectory's prior covariance must be positive definite.")
    return epochs_s - epochs_s[-1], emitter - reference


def _determinant(F: Array) -> Array:
    determinant: Array = F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]
    return determinant


def _observed(F: Array) -> NDArray[np.bool_]:
    # Compared with the product it is a difference of, so that rounding does not pass for
    # information.
    observed: NDArray[np.bool_] = _determinant(F) > 1e-12 * F[..., 0, 0] * F[..., 1, 1]
    return observed


def _infinite(F: Array) -> Array:
    return np.full(F.shape[:-2], np.inf)


OBJECTIVES: dict[str, Callable[..., Objective]] = {
    "determinant": determinant,
    "rms": rms,
    "track": track,
}
"""Objectives by name; "track" asks for a trajectory besides the requirements."""
