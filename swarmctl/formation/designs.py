"""Formation designs: at which angle and distance from the reference each companion stands.

A design is an array of shape (N, 2), one row (theta rad, d m) per companion: theta from the
LOS counter-clockwise, d the 3-D distance from the reference UAV.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from swarmctl.errors import FormationError

Array = NDArray[np.float64]


def perpendicular(companions: int, d_m: float, separation_m: float) -> Array:
    """The paper's optimal formation: perpendicular to the LOS, as far out as d allows.

    Eq. (29) for odd N and Eq. (31) for even N: companions alternate between theta = +90° and
    -90°; the odd one stands on the LOS axis, at 180° (behind the reference) instead of the
    paper's 0°: in the far field it informs the same there and stays farther from the emitter.
    Eqs. (29) and (31) put several companions at one point; here each further one of an arm
    stands ``separation_m`` nearer to the reference.

    Args:
        companions: N, at least 1.
        d_m: Distance of the outermost slots from the reference, m.
        separation_m: Least distance between two slots, m.

    Returns:
        Array (N, 2) of (theta rad, d m).

    Raises:
        FormationError: If N < 1 or the slots do not fit.
    """
    _check_count(companions)
    rows = []
    for j in range(companions - companions % 2):
        side, rank = (1.0 if j % 2 == 0 else -1.0), j // 2
        rows.append((side * math.pi / 2.0, d_m - rank * separation_m))
    if companions % 2:
        rows.append((math.pi, d_m))
    design = np.array(rows)
    nearest = float(design[:, 1].min())
    if nearest < separation_m:
        raise FormationError(
            f"{companions} companions do not fit within {d_m:g} m of the reference: at"
            f" {separation_m:g} m apart the innermost would stand {nearest:g} m from it. Raise"
            " limits.d_max_m, lower limits.min_separation_m or fly fewer vehicles."
        )
    return design


def uniform(companions: int, d_m: float, separation_m: float) -> Array:
    """The uniform circle of the paper's Remark 2 and Table 1: theta_j = -120° + 360°(j-1)/N.

    Args and returns as :func:`perpendicular`.

    Raises:
        FormationError: If N < 1 or neighbours on the circle are nearer than ``separation_m``.
    """
    _check_count(companions)
    theta = -2.0 * math.pi / 3.0 + 2.0 * math.pi * np.arange(companions) / companions
    chord = 2.0 * d_m * math.sin(math.pi / companions) if companions > 1 else d_m
    if min(chord, d_m) < separation_m:
        raise FormationError(
            f"{companions} companions on a circle of {d_m:g} m are {chord:.1f} m apart, less than"
            f" the minimum separation of {separation_m:g} m."
        )
    return np.column_stack((theta, np.full(companions, d_m)))


def _check_count(companions: int) -> None:
    if companions < 1:
        raise FormationError(f"a formation needs at least one companion, not {companions}.")


DESIGNS = {"perpendicular": perpendicular, "uniform": uniform}
"""Designs by the name a mission file uses."""
