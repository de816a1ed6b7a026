"""From a design to slots in space, and which companion takes which."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from swarmctl.errors import FormationError
from swarmctl.units import Array


def level_design(design: Array, heights_m: Array) -> Array:
    """Horizontal distances that leave each slot at its design's 3-D distance.

    Args:
        design: (N, 2) of (theta rad, 3-D distance m).
        heights_m: (N,) height of each slot above the reference UAV, m.

    Returns:
        (N, 2) of (theta rad, horizontal distance m).

    Raises:
        FormationError: If a companion's height alone exceeds its slot's distance.
    """
    squared = design[:, 1] ** 2 - np.square(heights_m)
    if (squared <= 0.0).any():
        j = int(np.argmin(squared))
        raise FormationError(
            f"a slot {design[j, 1]:g} m from the reference cannot be flown"
            f" {abs(heights_m[j]):g} m above or below it: bring the altitudes closer together"
            " or raise limits.d_max_m."
        )
    return np.column_stack((design[:, 0], np.sqrt(squared)))


def assign(positions: Array, slots: Array) -> list[int]:
    """Which slot each companion takes: the assignment of least total squared path.

    Squared paths forbid that two companions swap sides for a small gain, and the paths of the
    optimum do not cross.

    Args:
        positions: (N, 2) companions' positions east, north, m.
        slots: (N, 2) slots' positions, m.

    Returns:
        Index of the slot of each companion.
    """
    delta = positions[:, None, :] - slots[None, :, :]
    _, columns = linear_sum_assignment((delta**2).sum(axis=2))
    return [int(c) for c in columns]
