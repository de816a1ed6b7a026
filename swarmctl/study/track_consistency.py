"""Error and consistency of the live track where the noise is not white.

The cases are :mod:`~swarmctl.study.track_cases`; :mod:`~swarmctl.study.track_runs` flies them.

The bound is that of the right model (:mod:`~swarmctl.estimation.bounds.augmented_pcrb`):
receivers with these errors, and an emitter that does not manoeuvre.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from swarmctl.errors import UsageError
from swarmctl.study.consistency import LOST_AT_S
from swarmctl.study.executors import in_order
from swarmctl.study.registry import Registry
from swarmctl.study.tally import (
    BoundTally,
    Interval,
    Tally,
    mean_of,
    poisson_rate,
    root_ratio,
    share,
)
from swarmctl.study.track_cases import CASES, TrackCase
from swarmctl.study.track_runs import JUDGED, WITHOUT_ECHOES, Chunk, ChunkResult, Tracked, fly_chunk

CHUNK = 20
"""Runs flown by a worker at once: some ten seconds."""
_EPOCH_S = 8e-4
"""Time that an epoch of the track and of the filters beside it takes on one core, s."""


# --- Results ---------------------------------------------------------------------------


@dataclass(frozen=True)
class TrackInstant:
    """One filter at one time.

    Attributes:
        time_s: Time since the start.
        rmse_m: Root mean square of the position error.
        bound_m: Bound of the right model.
        ratio: RMSE over the bound.
        nees: Mean position NEES.
        inside_95: Share of runs with the truth inside the claimed 95 % ellipse.
    """

    time_s: float
    rmse_m: float
    bound_m: float
    ratio: Interval
    nees: Interval
    inside_95: float


@dataclass(frozen=True)
class Measure:
    """Another figure that a case asks for.

    Attributes:
        name: What it is.
        figure: The figure with its interval.
        greatest: The greatest that is within tolerance; None for any.
    """

    name: str
    figure: Interval
    greatest: float | None


@dataclass(frozen=True)
class TrackRow:
    """One filter in one case.

    Attributes:
        case: The case's name.
        filter: The filter's name.
        runs: Runs flown.
        instants: The figures at the case's times.
        lost: Tracks lost at 12 s.
        measures: The other figures that the case asks for.
        shortfalls: What is out of tolerance, as sentences; None if the row has no tolerance.
    """

    case: str
    filter: str
    runs: int
    instants: tuple[TrackInstant, ...]
    lost: int
    measures: tuple[Measure, ...]
    shortfalls: tuple[str, ...] | None


# --- The study -------------------------------------------------------------------------


def run_track_consistency(
    registry: Registry,
    *,
    runs: int,
    seed: int = 0,
    cases: Sequence[str] = tuple(CASES),
    executor: Executor | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[TrackRow]:
    """Fly cases with the live track and with every registered filter.

    Args:
        registry: The filters to fly beside the track.
        runs: Runs of each case.
        seed: The seed of all draws.
        cases: Names in :data:`~swarmctl.study.track_cases.CASES`.
        executor: Where the runs are flown; None for this process.
        on_progress: Is told how many runs are done, and of how many.

    Raises:
        UsageError: A case is unknown, runs below 2, or the seed negative.
        EstimationError: A filter failed.
    """
    unknown = [name for name in cases if name not in CASES]
    if unknown:
        raise UsageError(f"There is no case {unknown[0]!r}; there are {', '.join(CASES)}.")
    if runs < 2:
        raise UsageError(f"A study needs at least 2 runs, not {runs}.")
    if seed < 0:
        raise UsageError(f"A seed must be 0 or more, not {seed}.")
    sizes = [min(CHUNK, runs - done) for done in range(0, runs, CHUNK)]
    work = [
        Chunk(CASES[name], registry.filters(CASES[name].process_noise), seed, number, size)
        for name in cases
        for number, size in enumerate(sizes)
    ]
    flown: list[ChunkResult] = []
    done = 0
    for item, result in zip(work, in_order(executor, fly_chunk, work), strict=True):
        flown.append(result)
        done += item.runs
        on_progress(done, runs * len(cases))
    rows: list[TrackRow] = []
    for index, name in enumerate(cases):
        rows += _rows(name, CASES[name], flown[index * len(sizes) : (index + 1) * len(sizes)])
    return rows


def cost_s(cases: Sequence[str]) -> float:
    """About how long one run of each case takes on one core, s."""
    flown = [CASES[name] for name in cases]
    # Where there are echoes the track flies a second time without them.
    epochs = sum(
        case.times_s[-1] / case.period_s * (1 if case.echo_ratio is None else 2) for case in flown
    )
    return _EPOCH_S * epochs


# --- Rows ------------------------------------------------------------------------------


def _rows(name: str, case: TrackCase, flown: Sequence[ChunkResult]) -> list[TrackRow]:
    """The track's rows, then the filters'."""
    bound = flown[0].bound
    tallies = dict(flown[0].tallies)
    for other in flown[1:]:
        bound += other.bound
        for candidate, tally in other.tallies.items():
            tallies[candidate] += tally
    tracked = {
        label: Tracked.joined([part.tracked[label] for part in flown]) for label in flown[0].tracked
    }
    rows = []
    for label, tracks in tracked.items():
        tally = tracks.tally()
        instants = _instants(case, tally, bound)
        measures: tuple[Measure, ...] = ()
        shortfalls = None
        lost = _lost(case, tally)
        if label == JUDGED:
            clean = tracked.get(WITHOUT_ECHOES)
            measures = (*_measures(case, tracks, clean),)
            shortfalls = _shortfalls(case, instants, lost, measures)
        rows.append(TrackRow(name, label, tally.runs, instants, lost, measures, shortfalls))
    for label, tally in tallies.items():
        instants = _instants(case, tally, bound)
        rows.append(TrackRow(name, label, tally.runs, instants, _lost(case, tally), (), None))
    return rows


def _lost(case: TrackCase, tally: Tally) -> int:
    return int(tally.lost[case.times_s.index(LOST_AT_S)])


def _instants(case: TrackCase, tally: Tally, bound: BoundTally) -> tuple[TrackInstant, ...]:
    rmse, interval = tally.rmse, tally.rmse_interval
    limit = bound.rmse
    return tuple(
        TrackInstant(
            time_s,
            float(rmse[k]),
            float(limit[k]),
            Interval(*(float(v / limit[k]) for v in (rmse[k], *interval[k]))),
            Interval(float(tally.mean_nees[k]), *map(float, tally.nees_interval[k])),
            float(tally.coverage[k]),
        )
        for k, time_s in enumerate(case.times_s)
    )


def _measures(case: TrackCase, tracks: Tracked, clean: Tracked | None) -> list[Measure]:
    """The figures that the case asks for besides the table, then those of every case."""
    measures = []
    if clean is not None:
        for k, time_s in enumerate(case.times_s):
            squares, clean_squares = ((t.error[:, k, :2] ** 2).sum(-1) for t in (tracks, clean))
            measures.append(
                Measure(
                    f"RMSE over that without echoes at {time_s:g} s",
                    root_ratio(squares, clean_squares),
                    case.echo_ratio,
                )
            )
    if case.first is not None:
        latest_s, greatest = case.first
        # One that never comes is later than any.
        last = float(np.nan_to_num(tracks.first_s, nan=math.inf).max())
        measures.append(Measure("latest first estimate (s)", Interval(last, last, last), latest_s))
        measures.append(
            Measure("mean NEES of the first estimate", mean_of(tracks.first_nees), greatest)
        )
    if case.sides:
        silent = float(tracks.silent.any(1).sum())
        measures.append(Measure("silently wrong", Interval(silent, silent, silent), 0.0))
        for k, time_s in enumerate(case.times_s):
            resolved = share(int(tracks.resolved[:, k].sum()), len(tracks.resolved))
            measures.append(Measure(f"share resolved at {time_s:g} s", resolved, None))
    measures.append(Measure("share of the RDs set aside", mean_of(tracks.aside), None))
    hours = len(tracks.degraded) * case.times_s[-1] / 3600.0
    measures.append(
        Measure("degraded, times an hour", poisson_rate(int(tracks.degraded.sum()), hours), None)
    )
    return measures


def _shortfalls(
    case: TrackCase, instants: Sequence[TrackInstant], lost: int, measures: Sequence[Measure]
) -> tuple[str, ...]:
    """What is out of tolerance by its whole confidence interval, as sentences.

    Where the side is unknown, a track on the wrong side is no fault if it says so.
    """
    missed = [f"{lost} tracks lost at {LOST_AT_S:g} s"] if lost and not case.sides else []
    at = {instant.time_s: instant for instant in instants}
    for tolerance in case.tolerances:
        for instant in (at[time_s] for time_s in tolerance.times_s):
            if tolerance.ratio is not None and not instant.ratio.low <= tolerance.ratio:
                missed.append(
                    f"RMSE / bound at least {instant.ratio.low:.2f} at {instant.time_s:g} s,"
                    f" above {tolerance.ratio:g}"
                )
            if tolerance.nees is None:
                continue
            low, high = tolerance.nees
            if not (instant.nees.low <= high and instant.nees.high >= low):
                missed.append(
                    f"NEES {instant.nees.low:.2f}-{instant.nees.high:.2f} at"
                    f" {instant.time_s:g} s, outside {low:g}-{high:g}"
                )
    for measure in measures:
        if measure.greatest is not None and not measure.figure.low <= measure.greatest:
            missed.append(
                f"{measure.name} at least {measure.figure.low:.2f}, above {measure.greatest:g}"
            )
    return tuple(missed)
