"""Which measurements are echoes: gating by receiver, and by pair before there is a track.

With a track, an epoch's innovation ``nu ~ N(0, S)`` is searched for the one receiver whose
arrival, shifted by an unknown amount, explains most of it (data snooping: Baarda, "A testing
procedure for use in geodetic networks", 1968): with g the derivative of the rows by that
arrival, the statistic ``(gᵀ S⁻¹ nu)² / gᵀ S⁻¹ g`` is chi-squared with one degree of freedom if
nothing is wrong. The worst receiver above the gate is set aside, and the rest searched again.
Setting aside means ``S + s² g gᵀ`` with a large s, which for the reference receiver keeps what
the differences between its companions tell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from swarmctl.estimation.model.rows import Rows
from swarmctl.units import Array, Mask

GATE = 4.0
"""Sigmas beyond which an arrival is set aside: 6e-5 by chance."""
_CLEAR = 10.0
"""An innovation of more sigmas of white noise cannot tell an echo from a poor prior."""
_ASIDE_M = 1e4
"""1-sigma of an arrival that is set aside, m."""
_MOST_LINES = 500
_FEWEST = 4
"""Samples of a pair needed to tell which of them are wrong."""


class Screened(NamedTuple):
    """What is left of an epoch.

    Attributes:
        kept: Rows with no receiver set aside, (K,).
        covariance: White covariance with those set aside, (K, K), m².
        aside: Ids of the receivers set aside; both of a row that nothing else tells apart.
    """

    kept: Mask
    covariance: Array
    aside: tuple[int, ...]


def tells_echoes(S: Array, rows: Rows) -> bool:
    """Whether an innovation of covariance S, (K, K), is narrow enough to show an echo."""
    return bool((np.diagonal(S) <= _CLEAR**2 * np.diagonal(rows.covariance)).all())


def screen(nu: Array, S: Array, rows: Rows, gate: float = GATE) -> Screened:
    """Set aside the receivers whose arrival cannot be what the track expects.

    Args:
        nu: Innovation, (K,), m.
        S: Its covariance, (K, K), m².
        rows: The epoch.
        gate: In sigmas.
    """
    count = len(nu)
    limit = gate * gate
    kept: Mask = np.ones(count, dtype=np.bool_)
    # Nobody can exceed the gate unless all together do: the common case, at a third of the price.
    if float(nu @ np.linalg.solve(S, nu)) <= limit:
        return Screened(kept, rows.covariance, ())
    ids = sorted({*rows.first, *rows.second})
    first, second = np.array(rows.first), np.array(rows.second)
    g = np.stack([(second == r).astype(float) - (first == r) for r in ids])
    covariance = rows.covariance
    aside: list[int] = []
    for _ in ids:
        weighted = np.linalg.solve(S, np.column_stack([nu, g.T]))
        precision = np.vecdot(g, weighted[:, 1:].T)
        statistic = (g @ weighted[:, 0]) ** 2 / precision
        worst = int(np.argmax(statistic))
        if statistic[worst] <= limit:
            break
        # Where a row's two receivers are in no other row, either may be the one.
        alike = np.abs(g @ g[worst]) >= g[worst] @ g[worst]
        alike &= (g * g).sum(1) == g[worst] @ g[worst]
        aside += [r for r, same in zip(ids, alike, strict=True) if same]
        shift = _ASIDE_M**2 * np.outer(g[worst], g[worst])
        S = S + shift
        covariance = covariance + shift
        kept = kept & (g[worst] == 0.0)
    return Screened(kept, covariance, tuple(aside))


def consensus(times: Array, values: Array, sigma: float, gate: float = 5.0) -> Mask:
    """Which of a pair's range differences lie on the straight line that most of them share.

    Among the lines through two samples, the one with most samples within ``gate`` sigmas wins,
    then the flattest. If it holds no majority of them the noise is not what it is said to be: then
    within twice as much, and so on. Few samples are all kept.

    Args:
        times: (n,), s; not decreasing.
        values: (n,), m.
        sigma: 1-sigma of a sample, m.
        gate: In sigmas.
    """
    count = len(values)
    if count < _FEWEST:
        return np.ones(count, dtype=np.bool_)
    i, j = np.triu_indices(count, 1)
    apart = times[j] > times[i]  # a coarse clock has many at one time
    i, j = i[apart], j[apart]
    if not len(i):
        return np.ones(count, dtype=np.bool_)
    some = slice(None, None, max(1, len(i) // _MOST_LINES))
    i, j = i[some], j[some]
    slope = (values[j] - values[i]) / (times[j] - times[i])
    off = np.abs(values - values[i, None] - slope[:, None] * (times - times[i, None]))
    limit = gate * sigma
    while True:
        within = off <= limit
        held = within.sum(1)
        if 2 * held.max() > count:
            break
        limit *= 2.0
    best = np.flatnonzero(held == held.max())
    chosen: Mask = within[best[np.argmin(np.abs(slope[best]))]]
    return chosen
