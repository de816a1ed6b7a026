"""Can the track be believed? The innovations are asked, over the last seconds.

If the model is right the whitened innovations are independent unit normal numbers, whatever the
geometry. Sums over a few seconds say when they are not:

``noise``
    Their squares add up to more than chi-squared allows: sigmas are too small, or something
    is missing from the model.
``too_quiet``
    They add up to less than chi-squared allows, even of a quarter of the variance: careful people
    claim a somewhat larger sigma than they have, but a track that is fed the same again and
    again learns to expect it.
``correlated``
    Neighbours in time have products with a mean: coloured errors, a clock or a manoeuvre that
    the model does not have.
``rejected``
    More is set aside than echoes explain, of all receivers or of one: wrong positions, swapped
    receivers, a clock that jumped, or a track that is elsewhere.
``repeated``
    Values come again more often than by chance (:mod:`~swarmctl.estimation.integrity.repetition`):
    a receiver or the feed holds or replays old ones.

What no innovation can tell: times of all measurements that are off together against those of
the positions. The swarm is then elsewhere on its way, and so is the emitter. Epochs of fewer
rows than make a judgement in the window's seconds are judged over the last so many rows.

``degraded`` begins when one of them is further out than chance makes it once in some hundred
hours, and ends when all have been well inside for as long as the window; ``diverged`` is a track
that stays so far out, or has most of its receivers set aside, and has to be begun again.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np

from swarmctl.units import Array

Status = Literal["initialising", "tracking", "degraded", "diverged"]
"""What a track is worth."""
Ids = tuple[int, ...]
Pairs = tuple[tuple[int, int], ...]
Cause = Literal["noise", "too_quiet", "correlated", "rejected", "repeated"]
"""Which sum is out."""

ALARM = 5.2
"""Sigmas that begin ``degraded``: 1e-7 one-sided, so with some thousand independent windows an
hour once in thousands of hours."""
_CLEAR = 2.5
"""Sigmas below which a sum is well inside."""
_CAREFUL = 0.25
"""Variance that there may be in place of 1: sigmas that are twice too large do no harm."""
_ECHOES = 0.3
"""Share set aside that echoes explain."""
_HOPELESS = 0.6
"""Share of receivers set aside by which a track is elsewhere."""
_FAR = 6.0
"""Mean squared whitened innovation by which a track is elsewhere."""
_LEAST = 20
"""Innovations before a window says anything."""


class Verdict(NamedTuple):
    """The state of a track's health.

    Attributes:
        status: What it is worth.
        cause: Why it is not ``tracking``; None if it is, or has just begun.
        nis: Mean squared whitened innovation over the window: 1 is right.
        correlation: Mean product of neighbours: 0 is right.
        rejected: Share of rows set aside over the window.
        receivers: Those that stand out, where the cause is of some and not of all.
    """

    status: Status
    cause: Cause | None
    nis: float
    correlation: float
    rejected: float
    receivers: Ids = ()


class _Entry(NamedTuple):
    epoch_s: float
    sums: Array  # rows used, their squares, products of neighbours, number of these, rows aside
    heard: tuple[int, ...]
    aside: tuple[int, ...]


class Health:
    """The windowed test of one track.

    Args:
        window_s: Length of the window, s.
        diverged_after_s: How long a track may stay far out, s.
    """

    def __init__(self, window_s: float = 3.0, diverged_after_s: float = 3.0) -> None:
        self._window_s = window_s
        self._diverged_after_s = diverged_after_s
        self._entries: deque[_Entry] = deque()
        self._sums: Array = np.zeros(5)
        self._heard: Counter[int] = Counter()
        self._aside: Counter[int] = Counter()
        self._last: dict[Pairs, Array] = {}
        self._status: Status = "initialising"
        self._cause: Cause | None = None
        self._well_since_s = math.inf
        self._far_since_s = math.inf

    def add(
        self,
        epoch_s: float,
        pairs: Pairs,
        white: Array,
        rows_aside: int,
        aside: Ids,
        repeated: float = 0.0,
    ) -> Verdict:
        """Take the innovations of an epoch.

        Args:
            epoch_s: s.
            pairs: Receivers (first, second) of the rows used.
            white: Whitened innovations of these, (K,).
            rows_aside: How many rows besides were set aside.
            aside: The receivers they were set aside for.
            repeated: Sigmas by which values come again more often than by chance.
        """
        products, neighbours = 0.0, 0
        if pairs in self._last:
            products, neighbours = float(white @ self._last[pairs]), len(white)
        self._last[pairs] = white
        sums = np.array([len(white), white @ white, products, neighbours, rows_aside])
        heard = (*{receiver for pair in pairs for receiver in pair}.union(aside),)
        self._entries.append(_Entry(epoch_s, sums, heard, aside))
        self._sums = self._sums + sums
        self._heard.update(heard)
        self._aside.update(aside)
        while (old := self._entries[0]).epoch_s < epoch_s - self._window_s:
            if _rows(self._sums) - _rows(old.sums) < _LEAST:
                break
            self._entries.popleft()
            self._sums = self._sums - old.sums
            self._heard.subtract(old.heard)
            self._aside.subtract(old.aside)
        return self._judge(epoch_s, repeated)

    def _judge(self, now_s: float, repeated: float) -> Verdict:
        used, squares, products, neighbours, asides = self._sums.tolist()
        total = used + asides
        nis = squares / used if used else 1.0
        correlation = products / neighbours if neighbours else 0.0
        share = asides / total if total else 0.0
        of_receivers = {r: _beyond_echoes(n, self._heard[r]) for r, n in self._aside.items()}
        sigmas: dict[Cause, float] = {
            "noise": _wilson_hilferty(squares, used) if used >= _LEAST else 0.0,
            "too_quiet": -_wilson_hilferty(squares / _CAREFUL, used) if used >= _LEAST else 0.0,
            "correlated": _beyond_chance(products, neighbours) if neighbours >= _LEAST else 0.0,
            "rejected": max(_beyond_echoes(asides, total), *of_receivers.values(), 0.0),
            "repeated": repeated,
        }
        # What repeats itself is also quiet and correlated.
        cause = max(
            sigmas, key=lambda name: (name == "repeated" and repeated > ALARM, sigmas[name])
        )
        worst = sigmas[cause]
        if self._status == "initialising" and total >= _LEAST:
            self._status = "tracking"
        if worst > ALARM and self._status == "tracking":
            self._status = "degraded"
        if worst > ALARM and self._status == "degraded":
            self._cause = cause
        self._well_since_s = min(self._well_since_s, now_s) if worst < _CLEAR else math.inf
        if self._status == "degraded" and now_s - self._well_since_s >= self._window_s:
            self._status, self._cause = "tracking", None
        far = total >= _LEAST and (share > _HOPELESS or nis > _FAR)
        self._far_since_s = min(self._far_since_s, now_s) if far else math.inf
        if now_s - self._far_since_s >= self._diverged_after_s:
            self._status, self._cause = "diverged", self._cause or cause
        # Who shares rows with a bad receiver loses some of them, and is not meant.
        shares = {r: n / self._heard[r] for r, n in self._aside.items() if n}
        least = 0.5 * (max(shares.values(), default=0.0) + _ECHOES)
        stand_out = sorted(r for r, n in shares.items() if of_receivers[r] > _CLEAR and n > least)
        heard = sum(count > 0 for count in self._heard.values())
        some = self._cause == "rejected" and len(stand_out) < heard
        receivers = tuple(stand_out) if some else ()
        return Verdict(self._status, self._cause, nis, correlation, share, receivers)


def sentence(verdict: Verdict, name: Callable[[int], str] = str) -> str:
    """What an operator is told: what is wrong, and what to check.

    Args:
        verdict: The track's verdict.
        name: A receiver's name by its id.
    """
    if verdict.status == "initialising":
        return "The track is beginning."
    if verdict.cause is None:
        return "The measurements are what the track expects."
    scatter = math.sqrt(verdict.nis)
    who = " and ".join(name(receiver) for receiver in verdict.receivers)
    says = {
        "noise": f"The measurements scatter {scatter:.1f} times as much as they claim; check the"
        " sigmas, and whether the emitter is faster or more agile than is assumed.",
        "too_quiet": f"The measurements scatter {scatter:.2f} times as much as they claim; check"
        " the sigmas, and whether the feed is filtered or held on its way.",
        "correlated": "The errors stay the same from one epoch to the next (correlation"
        f" {verdict.correlation:.1f}); check the receivers' ids, clocks and positions, times"
        " against positions, and the model of correlated errors.",
        "rejected": f"{verdict.rejected:.0%} of the measurements contradict the track"
        + (
            f", mostly those of receiver {who}; check its clock, its position and its id."
            if who
            else "; check the receivers' ids, positions and clocks, or begin the track again."
        ),
        "repeated": "The same values come again and again, and are left out; check for a receiver"
        " that hangs and for a recording that is played into the feed.",
    }
    lost = "The track is lost and has to begin again. " if verdict.status == "diverged" else ""
    return lost + says[verdict.cause]


def _rows(sums: Array) -> float:
    return float(sums[0] + sums[4])


def _beyond_echoes(aside: float, total: float) -> float:
    """Sigmas by which the share set aside exceeds what echoes explain."""
    if total < _LEAST / 2:
        return 0.0
    return (aside / total - _ECHOES) * math.sqrt(total / (_ECHOES * (1.0 - _ECHOES)))


def _beyond_chance(products: float, count: float) -> float:
    """A sum of products of independent unit normal numbers as sigmas of a normal one.

    Their moments are generated by ``(1 - t²)^(-count / 2)``; the sum exceeds a value with a
    probability of at most exp(-I) by Chernoff's bound, a normal number with about exp(-z² / 2).
    (Over its standard deviation alone, one of 20 is beyond 4 five times as often as that.)
    """
    if products <= 0.0:
        return 0.0
    t = (math.hypot(count, 2.0 * products) - count) / (2.0 * products)
    return math.sqrt(2.0 * max(t * products + 0.5 * count * math.log1p(-t * t), 0.0))


def _wilson_hilferty(squares: float, count: float) -> float:
    """A chi-squared number as sigmas of a normal one (Wilson, Hilferty, 1931)."""
    spread = 2.0 / (9.0 * count)
    return float(((squares / count) ** (1.0 / 3.0) - 1.0 + spread) / math.sqrt(spread))
