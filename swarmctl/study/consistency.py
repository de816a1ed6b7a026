"""Is the error at the Cramér-Rao bound, and do the error bars tell the truth?

NEES is the mean over the runs at one time, never over time. Ratios and NEES come with 95 %
confidence intervals; a filter is within a tolerance when the interval reaches it.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swarmctl.errors import UsageError
from swarmctl.study.campaign import Campaign, FormationResult, run_campaign
from swarmctl.study.engagement import Engagement
from swarmctl.study.registry import JUDGED, PERPENDICULAR, Registry
from swarmctl.study.starts import DrawnEstimate, DrawnTruth, RangeIgnorant, Start
from swarmctl.study.tally import Interval

TIMES_S = (1.0, 4.0, 8.0, 12.0)
"""When the tracks are judged, s."""
LOST_AT_S = 12.0
"""When a track is called lost, s."""
RHO = 0.5
"""Share of the RD variance from the reference receiver: equal receivers."""


class FilterTolerance(NamedTuple):
    """What the consistent filter is held to.

    Attributes:
        ratio: Greatest RMSE over the constant-velocity bound.
        nees: Least and greatest mean position NEES.
    """

    ratio: float
    nees: tuple[float, float]


class FilterCase(NamedTuple):
    """One experiment.

    Attributes:
        title: What is drawn, in words.
        start: How a run begins.
        process_noise: Process noise of the emitter and of the model per axis, m²/s³.
        tolerance: None where only lost tracks count.
    """

    title: str
    start: Start
    process_noise: tuple[float, float]
    tolerance: FilterTolerance | None


CASES = {
    "matched": FilterCase(
        "matched: the truth is drawn, P0",
        DrawnTruth(),
        (0.01, 0.01),
        FilterTolerance(1.05, (1.8, 2.2)),
    ),
    "literal": FilterCase(
        "literal: the estimate is drawn, P0",
        DrawnEstimate(),
        (0.0, 0.0),
        FilterTolerance(1.10, (1.5, 2.4)),
    ),
    "literal-20": FilterCase(
        "literal, P0 x 20²", DrawnEstimate(20.0), (0.0, 0.0), FilterTolerance(1.15, (1.5, 2.4))
    ),
    "literal-40": FilterCase(
        "literal, P0 x 40²", DrawnEstimate(40.0), (0.0, 0.0), FilterTolerance(1.15, (1.5, 2.4))
    ),
    "range-ignorant": FilterCase(
        "range-ignorant: 10 ± 5 km assumed, 5 km true", RangeIgnorant(), (0.0, 0.0), None
    ),
}
"""The experiments by name."""


@dataclass(frozen=True)
class FilterInstant:
    """One filter at one time.

    Attributes:
        time_s: Time since the start.
        rmse_m: Root mean square of the position error.
        cv_bound_m: Its constant-velocity bound.
        ca_bound_m: Its constant-acceleration bound.
        ratio_cv: RMSE over the constant-velocity bound.
        ratio_ca: RMSE over the constant-acceleration bound.
        nees: Mean position NEES.
        inside_95: Share of runs with the truth inside the claimed 95 % ellipse.
    """

    time_s: float
    rmse_m: float
    cv_bound_m: float
    ca_bound_m: float
    ratio_cv: Interval
    ratio_ca: Interval
    nees: Interval
    inside_95: float


@dataclass(frozen=True)
class FilterRow:
    """One filter in one case.

    Attributes:
        case: The case's name.
        filter: The filter's name.
        runs: Runs flown.
        instants: At :data:`TIMES_S`.
        lost: Runs lost at :data:`LOST_AT_S`.
        guard_firings: Updates in which the filter's guard fired.
        shortfalls: What is out of tolerance, as sentences; None if the filter has no tolerance.
    """

    case: str
    filter: str
    runs: int
    instants: tuple[FilterInstant, ...]
    lost: int
    guard_firings: int
    shortfalls: tuple[str, ...] | None


def run_consistency(
    registry: Registry,
    *,
    runs: int = 500,
    seed: int = 0,
    cases: tuple[str, ...] = tuple(CASES),
    executor: Executor | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[FilterRow]:
    """Fly every case with every registered filter, in the paper's formation of N = 3.

    Args:
        registry: The filters to compare.
        runs: Runs of each case.
        seed: The seed of all draws.
        cases: Names in :data:`CASES`.
        executor: Where the runs are flown; None for this process.
        on_progress: Is told how many runs are done, and of how many.

    Raises:
        UsageError: A case is unknown, or runs below 2.
        EstimationError: A filter failed.
    """
    unknown = [name for name in cases if name not in CASES]
    if unknown:
        raise UsageError(f"There is no case {unknown[0]!r}; there are {', '.join(CASES)}.")
    formation = {"perpendicular": np.array(PERPENDICULAR)}
    rows = []
    for index, name in enumerate(cases):
        case = CASES[name]
        campaign = Campaign(
            case.start,
            registry.filters(case.process_noise),
            formation,
            runs,
            seed,
            case.process_noise,
            Engagement(rho=RHO),
            registry.slow,
        )
        done_before = index * runs

        def progress(done: int, total: int, before: int = done_before) -> None:
            on_progress(before + done, total * len(cases))

        result = run_campaign(campaign, executor, progress)["perpendicular"]
        rows += [_row(name, case, candidate, result) for candidate in campaign.filters]
    return rows


def _row(name: str, case: FilterCase, candidate: str, result: FormationResult) -> FilterRow:
    tally = result.tallies[candidate]
    period = Engagement().period_s
    cv, ca = result.cv_bound.rmse, result.ca_bound.rmse
    instants = []
    for time_s in TIMES_S:
        k = round(time_s / period)
        rmse, (low, high) = tally.rmse[k], tally.rmse_interval[k]
        instants.append(
            FilterInstant(
                time_s,
                float(rmse),
                float(cv[k]),
                float(ca[k]),
                Interval(float(rmse / cv[k]), float(low / cv[k]), float(high / cv[k])),
                Interval(float(rmse / ca[k]), float(low / ca[k]), float(high / ca[k])),
                Interval(float(tally.mean_nees[k]), *map(float, tally.nees_interval[k])),
                float(tally.coverage[k]),
            )
        )
    lost = int(tally.lost[round(LOST_AT_S / period)])
    shortfalls = _shortfalls(case.tolerance, instants, lost) if candidate == JUDGED else None
    return FilterRow(
        name, candidate, tally.runs, tuple(instants), lost, int(tally.guarded.sum()), shortfalls
    )


def _shortfalls(
    tolerance: FilterTolerance | None, instants: list[FilterInstant], lost: int
) -> tuple[str, ...]:
    """What is out of tolerance by its whole confidence interval, as sentences."""
    missed = [f"{lost} tracks lost at {LOST_AT_S:g} s"] if lost else []
    if tolerance is None:
        return tuple(missed)
    for instant in instants:
        if instant.ratio_cv.low > tolerance.ratio:
            missed.append(
                f"RMSE / bound at least {instant.ratio_cv.low:.3f} at {instant.time_s:g} s,"
                f" above {tolerance.ratio:g}"
            )
        low, high = tolerance.nees
        if instant.nees.low > high or instant.nees.high < low:
            missed.append(
                f"NEES {instant.nees.low:.2f}-{instant.nees.high:.2f} at {instant.time_s:g} s,"
                f" outside {low:g}-{high:g}"
            )
    return tuple(missed)
