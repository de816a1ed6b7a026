"""Keeping planned paths apart: a safety filter on the planned velocities of a whole swarm.

Every vehicle keeps its altitude, so what keeps a pair apart is a least horizontal distance
D (:func:`least_distances`; zero for pairs that are staggered). :func:`separate` works in two steps.

**Bending.** Along the line of centres a pair may close by no more than it can brake off. Planned
positions advance by the mean of old and new velocity, so with closing speed c now and c' next,
deceleration a and gap = distance - D, braking in steps of dt from c' ends in time if

    gap - (c + c') dt / 2  >=  c'^2 / 2a + a dt^2 / 8,

the last term being the most that the last, incomplete step of braking adds (it lasts a whole dt:
v dt / 2 instead of v^2 / 2a, greatest at v = a dt / 2). Solved for c':

    c'  <=  sqrt(a (2 gap - c dt)) - a dt / 2.                                            (1)

Two that brake along their courses from the speed v are still closing for the time v / a, which
for a pair that flies together is much longer than their relative speed alone would take, so

    c'  <=  2 a gap / v                                                                   (2)

as well. One such half-space for each pair; the velocities nearest to the wanted ones in all of them
are found by Hildreth's projections (C. Hildreth, A quadratic programming procedure, 1957). Speed
that they take from a pair is given back to the right of the line of centres, so that two who meet
head-on go round each other, and many go round like a roundabout, instead of standing still. What
is projected is first the velocity wanted, then what acceleration reaches of it: without the first
nobody would make room for one who wants much, without the second what each can reach of a good
velocity need not be good for the pair.

**Proof.** Half-spaces of many pairs may contradict each other, and a vehicle can accelerate only
so much. What is certain is braking: *if from now on every vehicle braked to rest along its own
course, no pair would come nearer than D*. That property is kept: the bent velocities are planned
only if it holds after them, evaluated by the same sums as the plan itself. Where it fails for a
pair, the vehicle that helps more mixes in braking, step by step, until it holds. All braking is
what the period before has shown to be good, so the search ends: by induction the plan never comes
nearer than D, if it began at rest and apart. A pair that is nearer already (one just taken in
again, say) comes no nearer than by braking. Between two periods a pair with relative speed w may be
nearer by (w dt)^2 / 8D.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swarmctl.formation.flight_limits import limit
from swarmctl.units import Array

Rows = NDArray[np.intp]
HalfSpace = tuple[int, int, float, float, float]
"""Rows i and j, direction (e, n) from j to i, most: -(v_i - v_j) . (e, n) <= most."""

BRAKING_SHARE = 0.3
"""Share of the greatest acceleration counted on in (1); the rest is for going round others."""
COURSE_SHARE = 0.7
"""Share of it counted on in (2)."""
GOING = (1.0, 0.7, 0.4, 0.0)
"""Shares of the bent velocity, the rest being braking, that are tried in this order."""
SLOT_SLACK_M = 3.0
"""Slots stand this much more than the planned distance apart, so that nobody in them is bent."""
SLACK_M = 0.5
"""Bending keeps this much more than the least distance; what it misses is left to the proof."""
SWEEPS = 12
"""Projections on each half-space."""
ROUNDS = 2
"""Times that velocities are projected, then limited to what acceleration can reach."""
SETTLED_MPS = 1e-3
"""Projecting ends when nothing changes by more than this."""


@dataclass(frozen=True)
class SpeedBound:
    """A limit of how fast one vehicle may fly in one direction.

    Attributes:
        vehicle: Its row; it must have a weight above zero.
        normal: Unit vector east, north.
        most_mps: Greatest velocity along it.
    """

    vehicle: int
    normal: tuple[float, float]
    most_mps: float


def least_distances(heights_m: Sequence[float], separation_m: float, margin_m: float) -> Array:
    """Horizontal distances that keep vehicles at constant heights apart.

    Args:
        heights_m: Heights of the n vehicles, m.
        separation_m: Least 3-D distance of two vehicles, m.
        margin_m: What wind and lag may take of a planned horizontal distance, m.

    Returns:
        (n, n) least planned horizontal distance of each pair, m: sqrt(separation² - dz²) + margin;
        zero for a pair that is staggered by the separation or more, and on the diagonal.
    """
    heights = np.array(heights_m, dtype=float)
    dz = heights[:, None] - heights
    left = separation_m**2 - dz * dz
    apart: Array = np.where(left > 0.0, np.sqrt(np.maximum(left, 0.0)) + margin_m, 0.0)
    np.fill_diagonal(apart, 0.0)
    return apart


def slot_separation(heights_m: Sequence[float], separation_m: float, margin_m: float) -> float:
    """Distance of slots at which :func:`separate` leaves the vehicles in them alone, m.

    Args:
        heights_m: Heights of the n vehicles, m.
        separation_m: Least 3-D distance of two vehicles, m.
        margin_m: As for :func:`least_distances`.

    Returns:
        The separation if every pair is staggered; else with the margin, and a little more.
    """
    if not least_distances(heights_m, separation_m, margin_m).any():
        return separation_m
    return separation_m + margin_m + SLOT_SLACK_M


def separate(
    positions: Array,
    velocities: Array,
    wanted: Array,
    apart_m: Array,
    weights: Array,
    bounds: Sequence[SpeedBound],
    max_speed_mps: ArrayLike,
    max_acceleration_mps2: ArrayLike,
    dt: float,
) -> Array:
    """The planned velocities nearest to the wanted ones that keep every pair apart.

    Args:
        positions: (n, 2) planned positions east, north, m.
        velocities: (n, 2) planned velocities, m/s.
        wanted: (n, 2) wanted next velocities, m/s, none above ``max_speed_mps``.
        apart_m: (n, n) least horizontal distances, m; see :func:`least_distances`.
        weights: (n,) how much each yields: of two, each takes its share of what has to change.
            One with weight zero does what is wanted of it, which must be to brake or to stand:
            the others go round it.
        bounds: Where else vehicles may not be sent while they go round others; kept as far as
            the separation allows.
        max_speed_mps: Greatest speed, of all or of each (n,).
        max_acceleration_mps2: Greatest acceleration, of all or of each (n,).
        dt: Length of the period, s; positions advance by the mean of old and new velocity.

    Returns:
        (n, 2) next velocities, m/s, reachable with ``max_acceleration_mps2``.
    """
    a = np.broadcast_to(np.asarray(max_acceleration_mps2, dtype=float), len(positions))
    most = np.broadcast_to(np.asarray(max_speed_mps, dtype=float), len(positions))
    free = _towards(velocities, wanted, a * dt)
    i, j = _near_pairs(positions, velocities, apart_m, weights, a, dt)
    if len(i) == 0:
        return free
    spaces, slid = _half_spaces(positions, velocities, wanted, apart_m, weights, i, j, a, dt)
    # What a bound is measured against stands still and yields to nobody.
    spaces += [(b.vehicle, -1, -b.normal[0], -b.normal[1], b.most_mps) for b in bounds]
    bent = slid
    for _ in range(ROUNDS):
        bent = _towards(velocities, _project(bent, spaces, weights), a * dt)
    bent = _project(bent, spaces, weights)
    bent = np.array(
        [limit((e, n), speed) for (e, n), speed in zip(bent.tolist(), most, strict=True)]
    )
    bent = np.where(weights[:, None] > 0.0, _towards(velocities, bent, a * dt), free)
    return _prove(positions, velocities, bent, apart_m, i, j, a * dt, dt)


def _towards(velocities: Array, wanted: Array, steps_mps: Array) -> Array:
    """As far from the velocities to the wanted ones as the acceleration reaches."""
    changes = [
        limit((east, north), step)
        for (east, north), step in zip(
            (wanted - velocities).tolist(), steps_mps.tolist(), strict=True
        )
    ]
    reached: Array = velocities + np.array(changes)
    return reached


def _near_pairs(
    positions: Array, velocities: Array, apart_m: Array, weights: Array, a: Array, dt: float
) -> tuple[Rows, Rows]:
    """Pairs that a period of full acceleration and braking after it could bring too near."""
    constrained = (apart_m > 0.0) & (weights[:, None] + weights > 0.0)
    if not constrained.any():
        none = np.empty(0, dtype=np.intp)
        return none, none
    speed = np.hypot(velocities[:, 0], velocities[:, 1])
    reach = speed * dt + (speed + a * dt) ** 2 / (2.0 * BRAKING_SHARE * a) + SLACK_M
    delta = positions[:, None, :] - positions
    distance = np.hypot(delta[..., 0], delta[..., 1])
    near = constrained & (distance < apart_m + reach[:, None] + reach)
    i, j = np.nonzero(np.triu(near))
    return i, j


def _half_spaces(
    positions: Array,
    velocities: Array,
    wanted: Array,
    apart_m: Array,
    weights: Array,
    i: Rows,
    j: Rows,
    a: Array,
    dt: float,
) -> tuple[list[HalfSpace], Array]:
    """Inequality (1) of each pair, and the wanted velocities with what it takes given aside."""
    delta = positions[i] - positions[j]
    distance = np.hypot(delta[:, 0], delta[:, 1])
    n = np.where(distance[:, None] > 0.0, delta / np.maximum(distance, 1e-9)[:, None], (1.0, 0.0))
    gap = distance - apart_m[i, j] - SLACK_M
    # Two that brake together close their gap at twice the deceleration of the weaker; one that
    # does not yield leaves it to the other.
    both = (weights[i] > 0.0) & (weights[j] > 0.0)
    weaker = np.where(both, np.minimum(a[i], a[j]), np.where(weights[i] > 0.0, a[i], a[j]))
    braking = BRAKING_SHARE * weaker * np.where(both, 2.0, 1.0)
    closing = -((velocities[i] - velocities[j]) * n).sum(axis=1)
    inner = 2.0 * gap - closing * dt
    most = np.where(
        inner > 0.0,
        np.sqrt(np.maximum(braking * inner, 0.0)) - 0.5 * braking * dt,
        np.maximum(gap, -2.0),
    )
    speed = np.hypot(velocities[:, 0], velocities[:, 1])
    fastest = np.maximum(np.maximum(speed[i], speed[j]), weaker * dt)
    most = np.where(gap > 0.0, np.minimum(most, 2.0 * COURSE_SHARE * weaker * gap / fastest), most)
    excess = -((wanted[i] - wanted[j]) * n).sum(axis=1) - most
    slid = wanted.copy()
    share = weights[i] / (weights[i] + weights[j])
    right = np.column_stack((-n[:, 1], n[:, 0])) * np.maximum(excess, 0.0)[:, None]
    np.add.at(slid, i, right * share[:, None])
    np.subtract.at(slid, j, right * (1.0 - share)[:, None])
    columns = (i.tolist(), j.tolist(), n[:, 0].tolist(), n[:, 1].tolist(), most.tolist())
    return list(zip(*columns, strict=True)), slid


def _project(wanted: Array, spaces: list[HalfSpace], weights: Array) -> Array:
    """The velocities nearest to the wanted ones, by weighted squares, in all half-spaces."""
    v = [*wanted.tolist(), [0.0, 0.0]]
    w = [*weights.tolist(), 0.0]
    forces = [0.0] * len(spaces)
    for _ in range(SWEEPS):
        moved = 0.0
        for k, (i, j, east, north, most) in enumerate(spaces):
            one, other, yielding = v[i], v[j], w[i] + w[j]
            excess = (other[0] - one[0]) * east + (other[1] - one[1]) * north - most
            push = max(-forces[k], excess / yielding)
            if push == 0.0:
                continue
            forces[k] += push
            moved = max(moved, abs(push) * yielding)
            one[0] += push * w[i] * east
            one[1] += push * w[i] * north
            other[0] -= push * w[j] * east
            other[1] -= push * w[j] * north
        if moved < SETTLED_MPS:
            break
    return np.array(v[:-1])


def _prove(
    positions: Array,
    velocities: Array,
    bent: Array,
    apart_m: Array,
    i: Rows,
    j: Rows,
    steps_mps: Array,
    dt: float,
) -> Array:
    """The bent velocities, with braking mixed in for those of whom they cannot be proven good."""
    braked = _towards(velocities, np.zeros_like(velocities), steps_mps)
    speeds = np.hypot(velocities[:, 0], velocities[:, 1])
    count = 2 + math.ceil(float((speeds / steps_mps).max()))
    options = [share * bent + (1.0 - share) * braked for share in GOING]
    paths = np.array([_paths(positions, velocities, v, steps_mps, count, dt) for v in options])
    least = np.minimum(_nearest(paths[-1, i] - paths[-1, j]), apart_m[i, j])
    rows = np.arange(len(positions))
    taken = np.zeros(len(positions), dtype=np.intp)
    while True:
        failed = _nearest(paths[taken[i], i] - paths[taken[j], j]) < least
        if not failed.any():
            return np.array(options)[taken, rows]
        # Where one flies behind the other, only the one behind has to brake.
        one, other = i[failed], j[failed]
        slower = np.minimum(taken + 1, len(options) - 1)
        by_one = _nearest(paths[slower[one], one] - paths[taken[other], other])
        by_other = _nearest(paths[taken[one], one] - paths[slower[other], other])
        can_one, can_other = slower[one] > taken[one], slower[other] > taken[other]
        choose_one = can_one & ((by_one >= by_other) | ~can_other)
        chosen = np.union1d(one[choose_one], other[~choose_one])
        taken[chosen] = slower[chosen]


def _paths(
    positions: Array, velocities: Array, nexts: Array, steps_mps: Array, count: int, dt: float
) -> Array:
    """(n, count, 2) positions after a step to the next velocities and braking to rest after it."""
    speed = np.hypot(nexts[:, 0], nexts[:, 1])
    course = nexts / np.maximum(speed, 1e-9)[:, None]
    after = np.maximum(speed[:, None] - steps_mps[:, None] * np.arange(count), 0.0)
    mean = 0.5 * (after[:, :-1] + after[:, 1:])
    way = np.concatenate((np.zeros((len(nexts), 1)), np.cumsum(mean, axis=1)), axis=1) * dt
    first = positions + 0.5 * (velocities + nexts) * dt
    paths: Array = first[:, None, :] + way[..., None] * course[:, None, :]
    return paths


def _nearest(delta: Array) -> Array:
    nearest: Array = np.sqrt((delta * delta).sum(axis=2).min(axis=1))
    return nearest
