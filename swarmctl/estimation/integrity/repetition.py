"""A feed that repeats itself: held values and replayed epochs, told from honest coarseness.

With continuous noise no number comes twice; with a resolution q a row whose white noise, given all
else, has the 1-sigma s repeats by chance with a probability of at most ``q / (sqrt(2 pi) s)``. If
these add up to mu, r or more rows repeat by chance with a probability of at most ``exp(-I)``,
``I = r ln(r / mu) - r + mu`` for mu < r (Chernoff's bound; Hoeffding, 1956), which is as rare as
``sqrt(2 I)`` sigmas of a normal number. The resolution is learnt from the values. A feed that is
coarser than its noise says nothing here. ``docs/explanation/track.md`` has more.

``held``
    A row is the same as its pair's before; counted for each pair, and for all together.
``replayed``
    The last epoch was the same as an earlier one, and this one is the same as that one's
    successor; its probability is the product over its rows.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from swarmctl.estimation.model.rows import Rows
from swarmctl.units import Array, Mask

_SAME_M = 1e-6
"""Values this near to each other are the same: far below any noise, far above rounding."""
_REMEMBERED = 20_000
"""Epochs remembered: half an hour at 10 Hz."""
_FEWEST = 4
"""Repeats that say something of the feed; a message that came twice does not."""
_CHANCE = 0.2
"""Repeats are copies if chance explains a smaller share of them than this."""

_LEAST = 10
"""Epochs looked back at in a slow feed, whatever the window."""

Pair = tuple[int, int]


class _Tally:
    """Repeats among the last of something, and how many chance explains."""

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._entries: deque[tuple[float, float, float]] = deque()
        self._repeats = 0.0
        self._by_chance = 0.0

    def add(self, epoch_s: float, repeats: float, by_chance: float) -> None:
        entries = self._entries
        entries.append((epoch_s, repeats, by_chance))
        self._repeats += repeats
        self._by_chance += by_chance
        while entries[0][0] < epoch_s - self._window_s and len(entries) > _LEAST:
            _, old, old_by_chance = entries.popleft()
            self._repeats -= old
            self._by_chance -= old_by_chance

    @property
    def sigmas(self) -> float:
        """By how much there are more repeats than by chance."""
        count, mu = self._repeats, max(self._by_chance, 1e-12)
        if count < _FEWEST or count <= mu:
            return 0.0
        return math.sqrt(2.0 * (count * math.log(count / mu) - count + mu))

    @property
    def are_copies(self) -> bool:
        """Whether chance explains few of the repeats."""
        return self._by_chance < _CHANCE * self._repeats


class Repetition:
    """What the rows of one feed have in common with earlier ones.

    Attributes:
        sigmas: By how much there are more repeats in the window than by chance.

    Args:
        alarm: Sigmas beyond which repeats are copies.
        window_s: Length of the window, s.
    """

    def __init__(self, alarm: float, window_s: float = 3.0) -> None:
        self._alarm = alarm
        self._window_s = window_s
        self._last: dict[Pair, float] = {}
        self._step: dict[Pair, float] = {}
        self._held: dict[Pair, _Tally] = {}
        self._together = _Tally(window_s)
        self._past: deque[int] = deque()  # hashes of epochs
        self._forgotten = 0
        self._newest: dict[int, int] = {}  # number of an epoch, by hash
        self._next: int | None = None
        self._replayed = _Tally(window_s)
        self.sigmas = 0.0

    def add(self, rows: Rows) -> Mask:
        """Take the rows of an epoch.

        Returns:
            Which of them are copies of earlier ones and no measurements, (K,).
        """
        pairs = tuple(zip(rows.first, rows.second, strict=True))
        bound, held = self._compare(pairs, rows)
        self._together.add(rows.epoch_s, float(held.sum()), float(bound.sum()))
        copies: Mask = held & self._tells_copies(self._together)
        for k, pair in enumerate(pairs):
            tally = self._held.setdefault(pair, _Tally(self._window_s))
            tally.add(rows.epoch_s, float(held[k]), float(bound[k]))
            copies[k] |= held[k] and self._tells_copies(tally)
        expected, replayed = self._recall(pairs, rows.rd)
        self._replayed.add(rows.epoch_s, replayed, expected * float(np.prod(bound)))
        if replayed and self._tells_copies(self._replayed):
            copies[:] = True
        tallies = (self._together, self._replayed, *self._held.values())
        self.sigmas = max(tally.sigmas for tally in tallies)
        return copies

    def _tells_copies(self, tally: _Tally) -> bool:
        return tally.sigmas > self._alarm and tally.are_copies

    def _compare(self, pairs: tuple[Pair, ...], rows: Rows) -> tuple[Array, Mask]:
        """Bound of each row's probability to be the same as its pair's before; whether it is."""
        spread = 1.0 / np.sqrt(np.diagonal(np.linalg.inv(rows.covariance)))
        step = np.zeros(len(pairs))
        held: Mask = np.zeros(len(pairs), dtype=np.bool_)
        for k, (pair, value) in enumerate(zip(pairs, rows.rd.tolist(), strict=True)):
            if pair in self._last:
                apart = abs(value - self._last[pair])
                held[k] = apart <= _SAME_M
                if not held[k]:
                    self._step[pair] = min(self._step.get(pair, math.inf), apart)
                step[k] = self._step.get(pair, math.inf)
            self._last[pair] = value
        return np.minimum(1.0, step / (math.sqrt(2.0 * math.pi) * spread)), held

    def _recall(self, pairs: tuple[Pair, ...], values: Array) -> tuple[bool, bool]:
        """Whether a replay would show in this epoch, and whether it does."""
        this = hash((pairs, *np.rint(values / _SAME_M).astype(np.int64).tolist()))
        expected = self._next is not None
        same = self._next if self._next is not None and self._at(self._next) == this else None
        replayed = same is not None
        if same is None:
            same = self._newest.get(this)
        self._next = None if same is None else same + 1
        self._newest[this] = self._forgotten + len(self._past)
        self._past.append(this)
        if len(self._past) > _REMEMBERED:
            oldest = self._past.popleft()
            if self._newest[oldest] == self._forgotten:
                del self._newest[oldest]
            self._forgotten += 1
        return expected, replayed

    def _at(self, number: int) -> int | None:
        place = number - self._forgotten
        return self._past[place] if 0 <= place < len(self._past) else None
