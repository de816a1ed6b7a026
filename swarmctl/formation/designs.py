"""Formation designs: at which angle and distance from the reference each companion stands.

A design is an array of shape (N, 2), one row (theta rad, d m) per companion: theta from the
LOS counter-clockwise, d the distance from the reference UAV. Every design keeps d within
``max_slot_distance_m``, and ``separation_m`` between any two slots and between a slot and the
reference.

The information of a companion depends on nothing but the bearing from its slot to the emitter.
So a slot on the axis of the LOS is worth the same behind the reference as ahead of it, at any
range: it is put behind, farther from the emitter, unless the requirements say ``ahead``.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from swarmctl.errors import FormationError
from swarmctl.formation.design_search import SLACK, feasible, first_of_best, refine, worst
from swarmctl.formation.objectives import Objective
from swarmctl.formation.requirements import Requirements
from swarmctl.units import Array

SECTOR_OFFSETS = 9
"""Angles of the sector at which a worst case is looked for."""
FAN_RAD = math.radians(30.0)
"""Half width of the fans that searches for the worst case start from."""
REFINED = 4
"""Designs that a search starts from, each on its own: the best few."""


def uniform(requirements: Requirements, objective: Objective | None = None) -> Array:
    """The uniform circle of the paper's Remark 2: theta_j = 360° j / N, as far out as allowed.

    For N = 3 the uniform formation of Table 1: -120°, 0° and 120°. A slot at 0° stays where the
    paper has it, whatever the requirements say of slots ahead: its neighbours are ahead, too.

    Args:
        requirements: The limits.
        objective: Not used.

    Returns:
        (N, 2) of (theta rad, d m), theta increasing.

    Raises:
        FormationError: Neighbours on the circle would be nearer than the separation.
    """
    n, d = requirements.companions, requirements.max_slot_distance_m
    design = _circle(n, d)
    if not feasible(requirements, design):
        raise FormationError(
            f"{n} companions on a circle of {d:g} m are {2.0 * d * math.sin(math.pi / n):.1f} m"
            f" apart, less than the minimum separation of {requirements.separation_m:g} m."
        )
    return design


def paper(requirements: Requirements, objective: Objective | None = None) -> Array:
    """The paper's optimal formation: perpendicular to the LOS, as far out as allowed.

    Eq. (29) for odd N and Eq. (31) for even N: N // 2 companions at +90°, as many at -90°, an
    odd one on the axis. The paper puts several companions at one point; here they are spread
    by the separation, along the circle and inwards, whichever costs less.

    Args:
        requirements: The limits.
        objective: Not used.

    Returns:
        (N, 2) of (theta rad, d m): the arm at +90°, the arm at -90°, the axis.

    Raises:
        FormationError: The slots do not fit.
    """
    n = requirements.companions
    arms = _arms(requirements, perpendicular=True)
    if n // 2 < len(arms):
        arm = arms[n // 2]
        design = np.concatenate([arm, arm * [-1.0, 1.0], _axis(requirements)[: n % 2]])
        if feasible(requirements, design):
            return _wrapped(design)
    raise _does_not_fit(requirements, "perpendicular to the line of sight")


def regression(requirements: Requirements, objective: Objective) -> Array:
    """The optimal design of a quadratic regression, for the exact objective.

    With d << R the wavefront is a parabola in the coordinate s across the LOS. The optimal
    designs of a quadratic regression on [-d, d] stand at s = -d, 0 and d (Kiefer, Wolfowitz,
    "Optimum designs in regression problems", Ann. Math. Stat. 30(2), 1959); the reference is
    one UAV at 0. All splits of N between the three are tried, and rings of evenly spaced slots
    besides, in case the swarm is too crowded for any split. At finite range the ends are not
    at 90° but where the emitter's rays touch the circle, at arccos(d/R).

    Args:
        requirements: The limits.
        objective: What to choose the split by.

    Returns:
        (N, 2) of (theta rad, d m).

    Raises:
        FormationError: The slots do not fit in rings, either.
    """
    candidates = _candidates(requirements)
    return _wrapped(candidates[first_of_best(objective(candidates))])


def worst_case(requirements: Requirements, objective: Objective) -> Array:
    """The best design in the worst case over a sector of the LOS, Eq. (23) made definite.

    Minimises the greatest value of the objective while the LOS lies within ``sector_rad`` of
    where the design assumes it. The search is local, from the best few of many splits of N
    between two ends, as they are or fanned out, and the reference's neighbourhood.

    Args:
        requirements: The limits and the sector.
        objective: What to minimise.

    Returns:
        (N, 2) of (theta rad, d m).

    Raises:
        FormationError: The slots do not fit in rings, either.
    """
    sector = requirements.sector_rad
    offsets = np.linspace(-sector, sector, SECTOR_OFFSETS) if sector > 0.0 else np.zeros(1)
    starts = np.concatenate([_candidates(requirements), _fanned_candidates(requirements)])
    order = np.argsort(worst(objective, starts, offsets), kind="stable")
    few = [starts[i] for i in order[:REFINED]]
    return _wrapped(refine(requirements, objective, few, offsets))


def optimal(requirements: Requirements, objective: Objective) -> Array:
    """The best design found: refined numerically from the best few of many simple ones.

    Never worse than :func:`uniform`, :func:`paper` and :func:`regression`, which are among
    those it starts from.

    Args:
        requirements: The limits.
        objective: What to minimise.

    Returns:
        (N, 2) of (theta rad, d m).

    Raises:
        FormationError: The slots do not fit in rings, either.
    """
    candidates = _candidates(requirements)
    starts = list(candidates[np.argsort(objective(candidates), kind="stable")[:REFINED]])
    for rule in (paper, uniform):
        try:
            starts.append(rule(requirements))
        except FormationError:
            continue
    order = np.argsort(objective(np.stack(starts)), kind="stable")
    few = [starts[i] for i in order[:REFINED]]
    return _wrapped(refine(requirements, objective, few))


DESIGNS: dict[str, Callable[[Requirements, Objective], Array]] = {
    "uniform": uniform,
    "paper": paper,
    "regression": regression,
    "worst_case": worst_case,
    "optimal": optimal,
}
"""Designs by the name a mission file uses."""


def _candidates(requirements: Requirements) -> Array:
    """Every split between the two ends and the axis that fits, and the even rings, (M, N, 2)."""
    arms = _arms(requirements)
    designs = _splits(requirements, arms, arms, _axis(requirements))
    rings = _even_rings(requirements)
    if rings is not None:
        designs.append(rings)
    fitting = _fitting(requirements, designs)
    if len(fitting) == 0:
        raise _does_not_fit(requirements, "in any way tried")
    return fitting


def _fanned_candidates(requirements: Requirements) -> Array:
    """Splits whose ends are fanned out, or one of them, (M, N, 2); M may be 0.

    The middle stands close behind the reference: near the axis, wherever that points.
    """
    tight = _arms(requirements)
    end = math.acos(requirements.max_slot_distance_m / requirements.range_m)
    fan = (end - FAN_RAD, end + FAN_RAD)
    halves = [
        np.concatenate([tight[(n + 1) // 2] + [FAN_RAD, 0.0], tight[n // 2] - [FAN_RAD, 0.0]])
        for n in range(len(tight))
    ]
    fans = [
        np.column_stack((np.linspace(*fan, n), np.full(n, requirements.max_slot_distance_m)))
        for n in range(len(tight))
    ]
    shapes = (tight, halves, fans)
    radii = requirements.separation_m * np.arange(1, requirements.companions + 1)
    side = 0.0 if requirements.ahead else math.pi
    near = np.column_stack((np.full_like(radii, side), radii))
    designs = [
        design
        for left in shapes
        for right in shapes
        for design in _splits(requirements, left, right, near)
    ]
    return _fitting(requirements, designs)


def _splits(
    requirements: Requirements, left: list[Array], right: list[Array], axis: Array
) -> list[Array]:
    """Every split of N between the two ends, by their counts both on the left, and the axis."""
    n = requirements.companions
    return [
        np.concatenate([left[k], right[n - middle - k] * [-1.0, 1.0], axis[:middle]])
        for middle in range(min(n, len(axis)) + 1)
        for k in range(n - middle, -1, -1)
        if max(k, n - middle - k) < len(left)
    ]


def _fitting(requirements: Requirements, designs: list[Array]) -> Array:
    every = np.stack(designs) if designs else np.empty((0, requirements.companions, 2))
    fitting: Array = every[feasible(requirements, every)]
    return fitting


def _rings(requirements: Requirements) -> tuple[Array, Array]:
    """Radii of rings a separation apart, outermost first, and the angles between neighbours."""
    d, separation = requirements.max_slot_distance_m, requirements.separation_m
    count = min(math.floor(d / separation * (1.0 + SLACK)), requirements.companions)
    radii = d - separation * np.arange(count)
    return radii, 2.0 * np.arcsin(np.minimum(0.5 * separation / radii, 0.5))


def _arms(requirements: Requirements, *, perpendicular: bool = False) -> list[Array]:
    """Arms on the left of 0, 1, ... slots, as many as fit, spread by the separation.

    Information falls with the square of the distance s from the axis. On each ring slots stand
    side by side round the ray that touches it (or round 90°); each further slot goes onto the
    ring where the sum of s² grows most.
    """
    n = requirements.companions
    radii, spacing = _rings(requirements)
    tangent = np.arccos(radii / requirements.range_m)
    centre = np.full_like(radii, 0.5 * math.pi) if perpendicular else tangent
    # The sum of s² of k slots side by side has a closed form; its growth falls with k.
    k = np.arange(n + 1)
    width = spacing[:, None]
    sums = 0.5 * radii[:, None] ** 2 * (k + np.sin(k * width) / np.sin(width))
    growth = np.where((k[1:] - 1) * width < math.pi, np.diff(sums), -np.inf).ravel()
    order = np.argsort(-growth, kind="stable")[:n]
    ring_of = order[np.isfinite(growth[order])] // n
    arms = []
    for count in range(ring_of.size + 1):
        rings = []
        for ring, on_ring in enumerate(np.bincount(ring_of[:count], minlength=1)):
            slots = np.full((on_ring, 2), radii[ring])
            aside = np.arange(on_ring) - 0.5 * (on_ring - 1)
            slots[:, 0] = centre[ring] + aside * spacing[ring]
            rings.append(slots)
        arms.append(np.concatenate(rings))
    return arms


def _axis(requirements: Requirements) -> Array:
    """Slots on the axis, in the order they are taken: on its other side only when one is full."""
    radii, _ = _rings(requirements)
    behind = np.column_stack((np.full_like(radii, math.pi), radii))
    ahead = np.column_stack((np.zeros_like(radii), radii))
    return np.concatenate([ahead, behind] if requirements.ahead else [behind, ahead])


def _even_rings(requirements: Requirements) -> Array | None:
    """All on rings, the outermost first, each evenly spaced and full; None if they do not fit."""
    left = requirements.companions
    rings = []
    for radius, spacing in zip(*_rings(requirements), strict=True):
        on_ring = min(left, math.floor(2.0 * math.pi / spacing * (1.0 + SLACK)))
        ring = _circle(on_ring, radius)
        rings.append(ring if requirements.ahead else [math.pi, 0.0] + ring * [-1.0, 1.0])
        left -= on_ring
        if left == 0:
            return _wrapped(np.concatenate(rings))
    return None


def _circle(count: int, radius_m: float) -> Array:
    """Evenly spaced slots, one of them at 0°, theta increasing in (-pi, pi]."""
    turns = (np.arange(count) - (count - 1) // 2) / count
    return np.column_stack((2.0 * math.pi * turns, np.full(count, radius_m)))


def _wrapped(design: NDArray[np.floating]) -> Array:
    """With theta in (-pi, pi]."""
    theta = math.pi - (math.pi - design[:, 0]) % (2.0 * math.pi)
    return np.column_stack((theta, design[:, 1])).astype(np.float64)


def _does_not_fit(requirements: Requirements, how: str) -> FormationError:
    return FormationError(
        f"{requirements.companions} companions {how}, {requirements.separation_m:g} m apart and"
        f" from the reference, do not fit within {requirements.max_slot_distance_m:g} m of it."
        " Raise limits.d_max_m, lower limits.min_separation_m or fly fewer vehicles."
    )
