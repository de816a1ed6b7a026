"""The time series that the plots are drawn from, thinned to bounded memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from swarmctl.units import Vector

Row = tuple[float, ...]

EXTREMES_INTERVAL_S = 2.0
"""Least time between the rows of :class:`Extremes`."""


class Series:
    """Rows ``(time, value, ...)``, thinned as they come.

    A row is kept if it follows the last one by at least the interval. At the limit every other
    row is dropped and the interval doubled, so the whole flight stays covered.

    Args:
        interval_s: Least time between rows, s.
        limit: Most rows kept.

    Attributes:
        rows: The rows kept, oldest first.
        due_s: Earliest time of the next row.
    """

    __slots__ = ("_interval_s", "_limit", "due_s", "rows")

    def __init__(self, interval_s: float = 0.5, limit: int = 4000) -> None:
        self._interval_s = interval_s
        self._limit = limit
        self.due_s = float("-inf")
        self.rows: list[Row] = []

    def add(self, row: Row) -> None:
        """Offer a row; its first value is the time, s."""
        if row[0] < self.due_s:
            return
        self.rows.append(row)
        if len(self.rows) >= self._limit:
            del self.rows[1::2]
            self._interval_s *= 2.0
        self.due_s = self.rows[-1][0] + self._interval_s


class Extremes:
    """The greatest or least value of a quantity since the last row, one row per interval.

    Args:
        fold: ``max`` or ``min``.
    """

    __slots__ = ("_fold", "_held", "_series")

    def __init__(self, fold: Callable[[float, float], float]) -> None:
        self._fold = fold
        self._held: float | None = None
        self._series = Series(EXTREMES_INTERVAL_S)

    @property
    def rows(self) -> list[Row]:
        """Time and value, oldest first."""
        return self._series.rows

    def add(self, time_s: float, value: float) -> None:
        """Offer a value."""
        held = value if self._held is None else self._fold(self._held, value)
        if time_s < self._series.due_s:
            self._held = held
        else:
            self._series.add((time_s, held))
            self._held = None


@dataclass
class FlightSeries:
    """The series of one flight. Times are mission times, s; lengths m.

    Attributes:
        tracks: Per vehicle: time, east, north, up.
        launches: Per vehicle: its first reported position, ENU.
        truth: Time, east, north, up of the true emitter.
        estimates: Time, east, north and the horizontal covariance (ee, en, nn), m².
        sigmas: Time, larger horizontal 1-sigma axis of the estimate.
        errors: Time, horizontal error of the estimate.
        bounds: Time, larger horizontal 1-sigma axis of the Cramér-Rao bound.
        slot_errors: Per follower: greatest distance from its slot.
        ranges: Per follower: greatest distance from the reference UAV.
        standoffs: Least distance of any airborne UAV from the true emitter.
        phases: Time and name of each phase entered.
        references: Time from which each reference UAV led, and its system id.
        receivers: Per receiver, its estimated errors less another's: time, epoch
            (UTC), the other's system id; clock error, east and north navigation error; and
            their sigmas.
        receiver_truths: Per receiver, its true errors: epoch (UTC), clock error, east and north
            navigation error.
        health: Time and name of each status of the track.
    """

    tracks: dict[int, Series] = field(default_factory=dict)
    launches: dict[int, Vector] = field(default_factory=dict)
    truth: Series = field(default_factory=Series)
    estimates: Series = field(default_factory=Series)
    sigmas: Series = field(default_factory=Series)
    errors: Series = field(default_factory=Series)
    bounds: Series = field(default_factory=Series)
    slot_errors: dict[int, Extremes] = field(default_factory=dict)
    ranges: dict[int, Extremes] = field(default_factory=dict)
    standoffs: Extremes = field(default_factory=lambda: Extremes(min))
    phases: list[tuple[float, str]] = field(default_factory=list)
    references: list[tuple[float, int]] = field(default_factory=list)
    receivers: dict[int, Series] = field(default_factory=dict)
    receiver_truths: dict[int, Series] = field(default_factory=dict)
    health: list[tuple[float, str]] = field(default_factory=list)
