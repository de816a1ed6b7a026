"""Epochs averaged into blocks: what a window keeps of its measurements.

A block is a normal point, as in satellite ranging: what is averaged is the measured less the
nominal range difference (RD), of a trajectory near the true one, so that the geometry may bend
within it. Rows are kept per pair of receivers. Too many rows, and the two neighbours between
which the geometry changed least become one.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from swarmctl.estimation.model.rows import Rows
from swarmctl.units import Array, Mask

_SHARE = 0.01
"""A block lasts at least this share of the time since the first: an old track changes slowly."""


def _expected(nominal: Array, time_s: Array, at: Array) -> Array:
    """RD of nominal trajectories, (..., 2d), at some times and places, (K,), m; 0 for NaN."""
    d = nominal.shape[-1] // 2
    e = nominal[..., :d] + time_s[:, None] * nominal[..., d:]
    sights = e[:, None, :] - at.reshape(len(at), 2, d)
    distance = np.sqrt(np.vecdot(sights, sights))
    expected: Array = distance[:, 1] - distance[:, 0]
    return np.where(np.isnan(expected), 0.0, expected)


class Block:
    """Sums over the epochs of one block, one row per pair."""

    def __init__(self, d: int, nominal: Array | None) -> None:
        self.nominal = np.full(2 * d, np.nan) if nominal is None else nominal
        self.pairs: dict[tuple[int, int], int] = {}
        self.sums = np.zeros((0, 3 + 2 * d))  # count, time, rd less nominal, first_at, second_at
        self.white = np.zeros((0, 0))
        self.position = np.zeros(0)  # sum of the variances of the reported positions
        self.begin: list[float] = []
        self.end: list[float] = []

    def add(self, rows: Rows) -> None:
        """Take an epoch's rows; its time is since the window's first epoch."""
        pairs = list(zip(rows.first, rows.second, strict=True))
        places = self._places(pairs, [rows.epoch_s] * len(pairs))
        count = np.ones((len(places), 1))
        at = np.concatenate([rows.first_at, rows.second_at], axis=1)
        less = rows.rd - _expected(self.nominal, np.full(len(at), rows.epoch_s), at)
        new = np.concatenate([count, count * rows.epoch_s, less[:, None], at], axis=1)
        np.add.at(self.sums, places, new)
        index = np.array(places)
        np.add.at(self.white, (index[:, None], index), rows.covariance)
        np.add.at(self.position, index, rows.position_m**2)
        for place in places:
            self.end[place] = max(self.end[place], rows.epoch_s)

    def _places(self, pairs: Iterable[tuple[int, int]], begin: Iterable[float]) -> list[int]:
        """Number of each pair's row; new ones begin at these times."""
        places = []
        for pair, begin_s in zip(pairs, begin, strict=True):
            places.append(self.pairs.setdefault(pair, len(self.pairs)))
            if places[-1] == len(self.begin):
                self.begin.append(begin_s)
                self.end.append(begin_s)
        more = len(self.pairs) - len(self.sums)
        if more:
            self.sums = np.pad(self.sums, ((0, more), (0, 0)))
            self.white = np.pad(self.white, (0, more))
            self.position = np.pad(self.position, (0, more))
        return places

    def refer(self, nominal: Array) -> None:
        """Take another trajectory as nominal."""
        count = self.sums[:, 0]
        mean = self.sums / count[:, None]
        more = _expected(self.nominal, mean[:, 1], mean[:, 3:])
        more -= _expected(nominal, mean[:, 1], mean[:, 3:])
        self.sums[:, 2] += count * more
        self.nominal = nominal

    def __iadd__(self, later: Self) -> Self:
        """Add a later block of the same nominal trajectory."""
        places = self._places(later.pairs, later.begin)
        self.sums[places] += later.sums
        self.white[np.ix_(places, places)] += later.white
        self.position[places] += later.position
        for place, end in zip(places, later.end, strict=True):
            self.end[place] = max(self.end[place], end)
        return self


class Table(NamedTuple):
    """All rows, (M, ...)."""

    time: Array  # since the window's first epoch, s
    span: Array  # of the epochs averaged, s
    rd: Array
    at: Array  # (2, M, d): of the first and the second receiver
    signs: Array  # (R, M): +1 second, -1 first
    white: Array  # (M, M)
    position: Array  # variance per axis of the reported positions' white noise
    block: NDArray[np.intp]  # number of each row's block


class NormalPoints:
    """Blocks in the order of time.

    Args:
        d: Axes.
        begin_s: Times in :meth:`table` are since then, s.
        block_s: Least length of a block, s.
        capacity: Rows kept at most.
    """

    def __init__(self, d: int, begin_s: float, block_s: float, capacity: int) -> None:
        self._d = d
        self._begin_s = begin_s
        self._block_s = block_s
        self._capacity = capacity
        self._blocks: list[Block] = []
        self._opened_s = begin_s
        self._places: dict[int, int] = {}
        self._table: Table | None = None

    @property
    def receivers(self) -> list[int]:
        """Ids, in the order of their first rows."""
        return list(self._places)

    @property
    def is_empty(self) -> bool:
        """Whether it has no rows."""
        return not self._blocks

    @property
    def measurements(self) -> int:
        """How many it was given and has not dropped."""
        return sum(round(float(block.sums[:, 0].sum())) for block in self._blocks)

    def add(self, rows: Rows, nominal: Array | None = None, *, alone: bool = False) -> bool:
        """Take the rows of an epoch.

        Args:
            rows: Not empty; not before those of the last epoch.
            nominal: A trajectory near the true one, as theta, (2d,), if there is one already.
            alone: Whether they begin a block whatever the time.

        Returns:
            Whether they complete a block.
        """
        self._table = None
        for receiver in (*rows.first, *rows.second):
            self._places.setdefault(receiver, len(self._places))
        block_s = max(self._block_s, _SHARE * (rows.epoch_s - self._begin_s))
        fresh = not self._blocks or rows.epoch_s >= self._opened_s + block_s - 1e-6
        if fresh or alone:
            self._blocks.append(Block(self._d, nominal))
            self._opened_s = rows.epoch_s
        self._blocks[-1].add(rows._replace(epoch_s=rows.epoch_s - self._begin_s))
        return fresh

    def without(self, kept: Mask) -> None:
        """Drop rows for good: those that a mask (M,) of the last fit's rows does not keep.

        Only blocks of one epoch can lose rows.
        """
        table = self.table()
        self._table = None
        blocks = []
        for number, block in enumerate(self._blocks):
            mask = kept[table.block == number]
            if mask.all():
                blocks.append(block)
            elif mask.any():
                picked = np.flatnonzero(mask)
                pairs = list(block.pairs)
                block.pairs = {pairs[old]: new for new, old in enumerate(picked)}
                block.sums = block.sums[picked]
                block.white = block.white[np.ix_(picked, picked)]
                block.position = block.position[picked]
                block.begin = [block.begin[k] for k in picked]
                block.end = [block.end[k] for k in picked]
                blocks.append(block)
        self._blocks = blocks

    def table(self) -> Table:
        """All rows."""
        if self._table is None:
            self._table = self._tabulate()
        return self._table

    def compress(self, theta: Array) -> None:
        """Merge neighbouring blocks until the rows fit the capacity.

        Args:
            theta: The present estimate, (2d,): what is far away merges first.
        """
        d = self._d
        while len(self._blocks) > 2 and sum(len(b.pairs) for b in self._blocks) > self._capacity:
            begin = np.cumsum([0, *(len(block.pairs) for block in self._blocks[:-1])])
            total = np.add.reduceat(np.concatenate([b.sums for b in self._blocks]), begin)
            centre = total / total[:, :1]
            t = centre[:, 1:2]
            at = 0.5 * (centre[:, 3 : 3 + d] + centre[:, 3 + d :])
            sight = theta[:d] + t * theta[d:] - at
            distance = np.linalg.norm(sight, axis=1) + 1e-9
            turn = np.linalg.norm(np.diff(sight / distance[:, None], axis=0), axis=1)
            turn += np.abs(np.diff(np.log(distance)))
            # Between alike pairs the shorter; the last block still grows.
            turn += 1e-3 * (t[1:, 0] - t[:-1, 0])
            k = int(np.argmin(turn[:-1]))
            for block in self._blocks[k : k + 2]:
                block.refer(theta)
            self._blocks[k] += self._blocks[k + 1]
            del self._blocks[k + 1]
            self._table = None

    def _tabulate(self) -> Table:
        d, blocks = self._d, self._blocks
        sums = np.concatenate([block.sums for block in blocks])
        count = sums[:, 0]
        mean = sums / count[:, None]
        lengths = [len(block.pairs) for block in blocks]
        nominal = np.repeat([block.nominal for block in blocks], lengths, axis=0)
        rd = mean[:, 2] + _expected(nominal, mean[:, 1], mean[:, 3:])
        position = np.concatenate([block.position for block in blocks]) / count**2
        begin = np.array([begin for block in blocks for begin in block.begin])
        end = np.array([end for block in blocks for end in block.end])
        # n epochs a period apart stand for n periods.
        span = np.where(count > 1.0, (end - begin) * count / np.maximum(count - 1.0, 1.0), 0.0)
        row = np.arange(len(sums))
        white = np.zeros((row.size, row.size))
        last = 0
        for block, length in zip(blocks, lengths, strict=True):
            own = slice(last, last := last + length)
            white[own, own] = block.white
        white /= count[:, None] * count
        places = [[self._places[r] for r in pair] for block in blocks for pair in block.pairs]
        first, second = np.array(places).T
        signs = np.zeros((len(self._places), row.size))
        signs[first, row] -= 1.0
        signs[second, row] += 1.0
        at = np.stack([mean[:, 3 : 3 + d], mean[:, 3 + d :]])
        number = np.repeat(np.arange(len(blocks)), lengths)
        return Table(mean[:, 1], span, rd, at, signs, white, position, number)
