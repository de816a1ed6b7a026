"""Can the track be believed? The innovations are asked, over the last seconds.

If the model is right the whitened innovations are independent unit normal numbers, whatever the
geometry. Three sums over a few seconds say when they are not:

``noise``
    Their squares add up to more than chi-squared allows: sigmas are too small, or something
    is missing from the model.
``correlated``
    Neighbours in time have products with a mean: coloured errors, a clock or a manoeuvre that
    the model does not have.
``rejected``
    More is set aside than echoes explain, of all receivers or of one: wrong positions, swapped
    receivers, a clock that jumped, or a track that is elsewhere.

``degraded`` begins when one of them is further out than chance makes it once in some hundred
hours, and ends when all have been well inside for as long as the window; ``diverged`` is a track
that stays so far out, or has most of its receivers set aside, and has to be begun again.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from typing import Literal, NamedTuple

import numpy as np

from swarmctl.estimation.arguments import Array

Status = Literal["initialising", "tracking", "degraded", "diverged"]
"""What a track is worth."""
Ids = tuple[int, ...]
Pairs = tuple[tuple[int, int], ...]
Cause = Literal["noise", "correlated", "rejected"]
"""Which sum is out."""

_ALARM = 5.2
"""Sigmas that begin ``degraded``: 1e-7 one-sided, with some thousand independent windows an
hour once in thousands of hours by Gaussian statistics; the tails of short windows cost most of
that margin."""
_CLEAR = 2.5
"""Sigmas below which a sum is well inside."""
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
    """

    status: Status
    cause: Cause | None
    nis: float
    correlation: float
    rejected: float


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
        self._last: tuple[Pairs, Array] | None = None
        self._status: Status = "initialising"
        self._cause: Cause | None = None
        self._well_since_s = math.inf
        self._far_since_s = math.inf

    def add(
        self, epoch_s: float, pairs: Pairs, white: Array, rows_aside: int, aside: Ids
    ) -> Verdict:
        """Take the innovations of an epoch.

        Args:
            epoch_s: s.
            pairs: Receivers (first, second) of the rows used.
            white: Whitened innovations of these, (K,).
            rows_aside: How many rows besides were set aside.
            aside: The receivers they were set aside for.
        """
        products, neighbours = 0.0, 0
        if self._last is not None and self._last[0] == pairs:
            products, neighbours = float(white @ self._last[1]), len(white)
        self._last = (pairs, white) if len(white) else self._last
        sums = np.array([len(white), white @ white, products, neighbours, rows_aside])
        heard = (*{receiver for pair in pairs for receiver in pair}.union(aside),)
        self._entries.append(_Entry(epoch_s, sums, heard, aside))
        self._sums = self._sums + sums
        self._heard.update(heard)
        self._aside.update(aside)
        while self._entries[0].epoch_s < epoch_s - self._window_s:
            old = self._entries.popleft()
            self._sums = self._sums - old.sums
            self._heard.subtract(old.heard)
            self._aside.subtract(old.aside)
        return self._judge(epoch_s)

    def _judge(self, now_s: float) -> Verdict:
        used, squares, products, neighbours, asides = self._sums.tolist()
        total = used + asides
        nis = squares / used if used else 1.0
        correlation = products / neighbours if neighbours else 0.0
        share = asides / total if total else 0.0
        sigmas: dict[Cause, float] = {
            "noise": _wilson_hilferty(squares, used) if used >= _LEAST else 0.0,
            "correlated": products / math.sqrt(neighbours) if neighbours >= _LEAST else 0.0,
            "rejected": max(
                _beyond_echoes(asides, total),
                *(_beyond_echoes(count, self._heard[r]) for r, count in self._aside.items()),
                0.0,
            ),
        }
        cause = max(sigmas, key=lambda name: sigmas[name])
        worst = sigmas[cause]
        if self._status == "initialising" and total >= _LEAST:
            self._status = "tracking"
        if worst > _ALARM and self._status == "tracking":
            self._status, self._cause = "degraded", cause
        self._well_since_s = min(self._well_since_s, now_s) if worst < _CLEAR else math.inf
        if self._status == "degraded" and now_s - self._well_since_s >= self._window_s:
            self._status, self._cause = "tracking", None
        far = total >= _LEAST and (share > _HOPELESS or nis > _FAR)
        self._far_since_s = min(self._far_since_s, now_s) if far else math.inf
        if now_s - self._far_since_s >= self._diverged_after_s:
            self._status, self._cause = "diverged", self._cause or cause
        return Verdict(self._status, self._cause, nis, correlation, share)


def _beyond_echoes(aside: float, total: float) -> float:
    """Sigmas by which the share set aside exceeds what echoes explain."""
    if total < _LEAST / 2:
        return 0.0
    return (aside / total - _ECHOES) * math.sqrt(total / (_ECHOES * (1.0 - _ECHOES)))


def _wilson_hilferty(squares: float, count: float) -> float:
    """A chi-squared number as sigmas of a normal one (Wilson, Hilferty, 1931)."""
    spread = 2.0 / (9.0 * count)
    return float(((squares / count) ** (1.0 / 3.0) - 1.0 + spread) / math.sqrt(spread))


def sentence(verdict: Verdict) -> str:
    """What a verdict says to an operator."""
    return f"the track is {verdict.status}" + (f" ({verdict.cause})" if verdict.cause else "")
