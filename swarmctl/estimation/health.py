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
    More receivers are set aside than echoes explain: wrong positions, swapped receivers, a
    clock that jumped, or a track that is elsewhere.

``degraded`` begins when one of them is further out than chance makes it once in some hundred
hours, and ends when all have been well inside for as long as the window; ``diverged`` is a track
that stays so far out, or has most of its receivers set aside, and has to be begun again.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Literal, NamedTuple

import numpy as np

from swarmctl.estimation.arguments import Array

Status = Literal["initialising", "tracking", "degraded", "diverged"]
"""What a track is worth."""
Cause = Literal["noise", "correlated", "rejected"]
"""Which sum is out."""

_ALARM = 5.2
"""Sigmas that begin ``degraded``: 1e-7 one-sided, with some thousand independent windows an
hour once in thousands of hours by Gaussian statistics; the tails of short windows cost most of
that margin."""
_CLEAR = 2.5
"""Sigmas below which a sum is well inside."""
_ECHOES = 0.3
"""Share of receivers set aside that echoes explain."""
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
    used: int
    squares: float
    products: float
    neighbours: int
    aside: int


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
        self._last: tuple[tuple[tuple[int, int], ...], Array] | None = None
        self._status: Status = "initialising"
        self._cause: Cause | None = None
        self._well_since_s = math.inf
        self._far_since_s = math.inf

    def add(
        self, epoch_s: float, pairs: tuple[tuple[int, int], ...], white: Array, aside: int
    ) -> Verdict:
        """Take the innovations of an epoch.

        Args:
            epoch_s: s.
            pairs: Receivers (first, second) of the rows used.
            white: Whitened innovations of these, (K,).
            aside: Rows set aside besides.
        """
        products, neighbours = 0.0, 0
        if self._last is not None and self._last[0] == pairs:
            products, neighbours = float(white @ self._last[1]), len(white)
        self._last = (pairs, white) if len(white) else self._last
        self._entries.append(
            _Entry(epoch_s, len(white), float(white @ white), products, neighbours, aside)
        )
        while self._entries[0].epoch_s < epoch_s - self._window_s:
            self._entries.popleft()
        return self._judge(epoch_s)

    def _judge(self, now_s: float) -> Verdict:
        _, counts, squares, products, neighbours, asides = np.array(self._entries).sum(0)
        total = counts + asides
        nis = squares / counts if counts else 1.0
        correlation = products / neighbours if neighbours else 0.0
        share = asides / total
        sigmas: dict[Cause, float] = {
            "noise": _wilson_hilferty(squares, counts) if counts >= _LEAST else 0.0,
            "correlated": products / math.sqrt(neighbours) if neighbours >= _LEAST else 0.0,
            # By chance none is set aside: what counts is whether echoes explain it.
            "rejected": (share - _ECHOES) * math.sqrt(total / (_ECHOES * (1.0 - _ECHOES)))
            if total >= _LEAST
            else 0.0,
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
        return Verdict(self._status, self._cause, float(nis), float(correlation), float(share))


def _wilson_hilferty(squares: float, count: float) -> float:
    """A chi-squared number as sigmas of a normal one (Wilson, Hilferty, 1931)."""
    spread = 2.0 / (9.0 * count)
    return float(((squares / count) ** (1.0 / 3.0) - 1.0 + spread) / math.sqrt(spread))
