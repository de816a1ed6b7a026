"""The numerical search for the best formation design within the limits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from swarmctl.formation.information import slots_in_los_frame
from swarmctl.formation.objectives import Objective
from swarmctl.formation.requirements import Requirements
from swarmctl.units import Array

SLACK = 1e-9
"""Share of a limit that rounding may take."""
MARGIN = 1e-6
"""Share of the separation a search keeps in hand, so that its result needs no slack."""
STEP = 1e-5
"""Step of the central differences, as a share of the greatest slot distance."""
ITERATIONS = 60
TOLERANCE = 1e-7
"""A search ends when a step changes the objective by less than this share."""


def feasible(requirements: Requirements, designs: Array) -> Array:
    """Whether designs keep the greatest slot distance, and the separation of all UAVs.

    Args:
        requirements: The limits.
        designs: (..., N, 2) of (theta rad, d m).

    Returns:
        (...), bool.
    """
    slots = slots_in_los_frame(designs)
    swarm = np.concatenate([np.zeros_like(slots[..., :1, :]), slots], axis=-2)
    i, j = np.triu_indices(swarm.shape[-2], 1)
    delta = swarm[..., i, :] - swarm[..., j, :]
    nearest = np.sqrt(np.vecdot(delta, delta).min(axis=-1))
    farthest = designs[..., 1].max(axis=-1)
    kept: Array = (nearest >= requirements.separation_m * (1.0 - SLACK)) & (
        farthest <= requirements.max_slot_distance_m * (1.0 + SLACK)
    )
    return kept


def worst(objective: Objective, designs: Array, offsets_rad: Array) -> Array:
    """The greatest value of an objective if the line of sight is off by any of some angles.

    Args:
        objective: The objective.
        designs: (..., N, 2) of (theta rad, d m).
        offsets_rad: Angles of the true line of sight from the one designed for, (M,), rad.

    Returns:
        (...), m.
    """
    value: Array = objective(turned(designs, offsets_rad)).max(axis=-1)
    return value


def turned(designs: Array, offsets_rad: Array) -> Array:
    """The designs as seen from lines of sight off by some angles, (..., M, N, 2)."""
    theta = designs[..., None, :, 0] - offsets_rad[:, None]
    return np.stack(np.broadcast_arrays(theta, designs[..., None, :, 1]), axis=-1)


def first_of_best(values: Array) -> int:
    """Index of the least of (M,) values; the first of values that are equal but for rounding."""
    return int(np.argmax(values <= values.min() * (1.0 + SLACK)))


def refine(
    requirements: Requirements,
    objective: Objective,
    starts: Sequence[Array],
    offsets_rad: ArrayLike = (0.0,),
) -> Array:
    """The best feasible design found by sequential quadratic programming from some starts.

    Minimises the greatest value over the offsets of the line of sight: one offset is the
    objective itself. Never worse than any start. Deterministic.

    Args:
        requirements: The limits.
        objective: What to minimise.
        starts: Feasible designs (N, 2), at least one; of equally good ones the first is taken.
        offsets_rad: Angles of the true line of sight from the one designed for, (M,), rad.

    Returns:
        (N, 2) of (theta rad, d m), theta in (-pi, pi].
    """
    search = _Search(requirements, objective, np.asarray(offsets_rad, dtype=np.float64))
    found = list(starts)
    for start in starts:
        refined = search.run(start)
        if refined is not None and feasible(requirements, refined):
            found.append(refined)
    return found[first_of_best(worst(objective, np.stack(found), search.offsets_rad))]


class _Search:
    """One problem for scipy's SLSQP: the variables z are the slots' coordinates.

    They are shares of the greatest slot distance.

    The objective is taken as a logarithm, so that tolerances are shares of it; its greatest
    value over several offsets is minimised as a bound t on all of them, the last variable.
    """

    def __init__(
        self, requirements: Requirements, objective: Objective, offsets_rad: Array
    ) -> None:
        self.offsets_rad = offsets_rad
        self._objective = objective
        self._reach_m = requirements.max_slot_distance_m
        self._separation = (
            requirements.separation_m / requirements.max_slot_distance_m * (1.0 + MARGIN)
        )
        self._size = 2 * requirements.companions
        # The reference is a UAV, too: the last, at the origin.
        uav = np.eye(self._size + 2)[:, :-2].reshape(-1, 2, self._size)
        i, j = np.triu_indices(len(uav), 1)
        self._between = uav[i] - uav[j]
        self._last: tuple[bytes, Array, Array] = (b"", np.empty(0), np.empty(0))

    def run(self, start: Array) -> Array | None:
        """The design found from a start; None if the objective is not finite there."""
        z = slots_in_los_frame(start).ravel() / self._reach_m
        values = self._values(z)[0]
        if not np.isfinite(values).all():
            return None
        constraints = [{"type": "ineq", "fun": self._limits, "jac": self._limits_slope}]
        bounds = self._sides(z)
        if self.offsets_rad.size > 1:
            z = np.append(z, values.max())
            bounds.append((None, None))
            constraints.append({"type": "ineq", "fun": self._below, "jac": self._below_slope})
        with np.errstate(all="ignore"):  # a step too far may observe nothing
            result = minimize(
                self._cost,
                z,
                jac=self._cost_slope,
                method="SLSQP",
                bounds=bounds,
                constraints=constraints,
                options={"maxiter": ITERATIONS, "ftol": TOLERANCE},
            )
        if not np.isfinite(result.x).all():
            return None
        design = self._designs(result.x[: self._size])
        design[:, 1] = np.minimum(design[:, 1], self._reach_m)
        return design

    def _sides(self, z: Array) -> list[tuple[float | None, float | None]]:
        """Bounds that keep a slot near the axis on the side, behind or ahead, it starts on.

        To the objective the two sides are all but equal; which it is, is up to the start.
        """
        bounds: list[tuple[float | None, float | None]] = []
        for x, y in z.reshape(-1, 2):
            near = abs(y) < self._separation
            bounds += [(0.0 if near and x > 0.0 else None, 0.0 if near and x <= 0.0 else None)]
            bounds += [(None, None)]
        return bounds

    def _designs(self, z: Array) -> Array:
        slots = z.reshape(*z.shape[:-1], -1, 2) * self._reach_m
        theta = np.arctan2(slots[..., 1], slots[..., 0])
        return np.stack([theta, np.sqrt(np.vecdot(slots, slots))], axis=-1)

    def _values(self, z: Array) -> tuple[Array, Array]:
        """Logarithms of the objective at the offsets, (M,), and their gradients, (M, n)."""
        key = z.tobytes()
        if key != self._last[0]:
            steps = STEP * np.eye(self._size)
            candidates = z + np.concatenate([np.zeros((1, self._size)), steps, -steps])
            designs = turned(self._designs(candidates), self.offsets_rad)
            values = np.log(self._objective(designs))
            plus, minus = values[1 : self._size + 1], values[self._size + 1 :]
            with np.errstate(invalid="ignore"):  # infinite where nothing is observed
                self._last = (key, values[0], (plus - minus).T / (2.0 * STEP))
        return self._last[1:]

    def _cost(self, z: Array) -> float:
        return float(z[-1] if z.size > self._size else self._values(z)[0][0])

    def _cost_slope(self, z: Array) -> Array:
        slope: Array = np.eye(z.size)[-1] if z.size > self._size else self._values(z)[1][0]
        return slope

    def _below(self, z: Array) -> Array:
        below: Array = z[-1] - self._values(z[:-1])[0]
        return below

    def _below_slope(self, z: Array) -> Array:
        slope = self._values(z[:-1])[1]
        return np.column_stack((-slope, np.ones(len(slope))))

    # A pair's limit as the logarithm of a ratio: its slope is small where the pair is far apart.
    def _limits(self, z: Array) -> Array:
        between: Array = self._between @ z[: self._size]
        near = np.maximum(np.vecdot(between, between), 1e-300) / self._separation**2
        out = z[: self._size].reshape(-1, 2)
        return np.concatenate([0.5 * np.log(near), 1.0 - np.vecdot(out, out)])

    def _limits_slope(self, z: Array) -> Array:
        between = self._between @ z[: self._size]
        squared = np.maximum(np.vecdot(between, between), 1e-300)
        near = (between[:, None, :] @ self._between)[:, 0] / squared[:, None]
        companions = np.arange(self._size // 2)
        out = np.zeros((companions.size, self._size // 2, 2))
        out[companions, companions] = -2.0 * z[: self._size].reshape(-1, 2)
        slope = np.concatenate([near, out.reshape(companions.size, -1)])
        return np.pad(slope, ((0, 0), (0, z.size - self._size)))
