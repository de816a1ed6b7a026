"""The accuracy of the judged filter on 200 runs of each case, beside the paper's filters.

Intervals are two-sided at 99.9 %. The squared error over the bound's is a mean of numbers no
wider than chi-squared ones with one degree of freedom (as if all error lay on one axis).
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
import pytest

from swarmctl.errors import UsageError
from swarmctl.estimation.bounds.consistency import mean_bounds
from swarmctl.study import consistency
from swarmctl.study.batch_filter import BatchFilter
from swarmctl.study.campaign import FormationResult, run_campaign
from swarmctl.study.consistency import (
    CASES,
    FilterCase,
    FilterInstant,
    FilterRow,
    FilterTolerance,
    run_consistency,
)
from swarmctl.study.engagement import Engagement
from swarmctl.study.registry import JUDGED, Registry
from swarmctl.study.starts import DrawnEstimate
from swarmctl.study.tally import LOST_ERROR_M, NORMAL_95, BoundTally, Interval, Tally
from tests.study.registries import factory, registry_of

RUNS = 200
PROBABILITY = 0.999
NORMAL_999 = 3.290527
"""Two-sided 99.9 % quantile of the normal distribution."""

PAPER_S, EKF = "NCRKF, the paper's", "EKF, the paper's"
COMPARED = ("literal", "range-ignorant")
"""Cases in which the paper's filters are flown beside the judged one."""


class Flown(NamedTuple):
    """One case."""

    rows: dict[str, FilterRow]
    result: FormationResult


@pytest.fixture(scope="module")
def flown() -> dict[str, Flown]:
    """Every case by name, up to the last time that is judged, with the filters needed."""
    results: list[FormationResult] = []

    def noted(*args: object) -> dict[str, FormationResult]:
        by_formation = run_campaign(*args)  # type: ignore[arg-type]  # passed on
        results.extend(by_formation.values())
        return by_formation

    cases = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(consistency, "run_campaign", noted)
        patch.setattr(
            consistency, "Engagement", partial(Engagement, duration_s=consistency.LOST_AT_S)
        )
        for case in CASES:
            names = (JUDGED, PAPER_S, EKF) if case in COMPARED else (JUDGED,)
            rows = run_consistency(registry_of(*names), runs=RUNS, cases=(case,))
            cases[case] = Flown({row.filter: row for row in rows}, results.pop())
    return cases


# --- Accuracy --------------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES)
def test_the_judged_filter_is_at_the_bound_and_its_error_bars_are_honest(
    case: str, flown: dict[str, Flown]
) -> None:
    """At all times, range-ignorant starts included; no track is lost, none is out of tolerance."""
    row = flown[case].rows[JUDGED]
    assert [instant.time_s for instant in row.instants] == [1.0, 4.0, 8.0, 12.0]
    least, greatest = np.sqrt(mean_bounds(1, RUNS, PROBABILITY))
    low, high = mean_bounds(2, RUNS, PROBABILITY)
    for instant in row.instants:
        assert least < instant.ratio_cv.value < greatest, instant
        assert low < instant.nees.value < high, instant
    assert row.runs == RUNS
    assert row.lost == 0
    assert row.shortfalls == ()


@pytest.mark.parametrize("case", COMPARED)
def test_the_paper_s_filter_is_badly_overconfident_in_the_same_draws(
    case: str, flown: dict[str, Flown]
) -> None:
    """Even the lower end of the NEES's 99.9 % interval is above 50 at 1 and 4 s; 2 is right."""
    row = flown[case].rows[PAPER_S]
    for instant in row.instants[:2]:
        half = (instant.nees.value - instant.nees.low) * NORMAL_999 / NORMAL_95
        assert instant.nees.value - half > 50.0, instant
    assert row.shortfalls is None  # it has no tolerance


def test_from_a_range_ignorant_start_the_paper_s_ncrkf_converges_and_its_ekf_does_not(
    flown: dict[str, Flown],
) -> None:
    """No error exceeds the fourth root of the sum of fourth powers; some exceeds the RMSE."""
    tallies = flown["range-ignorant"].result.tallies
    assert tallies[PAPER_S].finite[-1] == RUNS
    assert tallies[PAPER_S].position_fourth[-1] ** 0.25 < LOST_ERROR_M
    assert tallies[EKF].rmse[-1] > LOST_ERROR_M
    assert flown["range-ignorant"].rows[EKF].lost > 0


def test_a_row_says_what_the_tally_and_the_bounds_say(flown: dict[str, Flown]) -> None:
    rows, result = flown["range-ignorant"]
    for name, row in rows.items():
        tally = result.tallies[name]
        for k, instant in zip((50, 200, 400, 600), row.instants, strict=True):
            assert instant.rmse_m == tally.rmse[k]
            assert instant.cv_bound_m == result.cv_bound.rmse[k]
            assert instant.ca_bound_m == result.ca_bound.rmse[k]
            assert instant.nees == (tally.mean_nees[k], *tally.nees_interval[k])
            assert instant.inside_95 == tally.coverage[k]
            for ratio, bound in (
                (instant.ratio_cv, instant.cv_bound_m),
                (instant.ratio_ca, instant.ca_bound_m),
            ):
                interval = (tally.rmse[k], *tally.rmse_interval[k])
                np.testing.assert_allclose(ratio, np.array(interval) / bound, rtol=1e-12)
        assert row.lost == tally.lost[600]
        assert row.guard_firings == tally.guarded.sum()


# --- What is flown ---------------------------------------------------------------------


def test_every_case_is_flown_with_every_filter_and_its_own_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In the paper's formation, with equal receivers; progress is told over all cases."""
    told: list[tuple[float, float]] = []

    def make(noise: tuple[float, float]) -> BatchFilter:
        told.append(noise)
        return factory("iterated EKF")(noise)

    registry = Registry()
    registry.register_filter("mine", make)
    registry.register_filter("OKF", factory("OKF"))
    monkeypatch.setattr(consistency, "TIMES_S", (0.02, 0.1))
    monkeypatch.setattr(consistency, "LOST_AT_S", 0.1)
    scenes = []

    def short(**parameters: float) -> Engagement:
        scenes.append(parameters)
        return Engagement(duration_s=0.1, **parameters)

    monkeypatch.setattr(consistency, "Engagement", short)
    progress: list[tuple[int, int]] = []
    rows = run_consistency(
        registry,
        runs=3,
        cases=("matched", "literal-20"),
        on_progress=lambda *done: progress.append(done),
    )
    assert [(row.case, row.filter) for row in rows] == [
        ("matched", "mine"),
        ("matched", "OKF"),
        ("literal-20", "mine"),
        ("literal-20", "OKF"),
    ]
    assert told == [(0.01, 0.01), (0.0, 0.0)]
    assert {"rho": 0.5} in scenes
    assert progress == [(3, 6), (6, 6)]


def test_an_unknown_case_is_named_with_those_there_are() -> None:
    with pytest.raises(UsageError, match="There is no case 'best'; there are matched, literal, "):
        run_consistency(Registry(), runs=2, cases=("literal", "best"))


def test_a_study_of_one_run_is_refused() -> None:
    with pytest.raises(UsageError, match="at least 2 runs, not 1"):
        run_consistency(Registry(), runs=1, cases=("literal",))


# --- Tolerances ---------------------------------------------------------------------------

TOLERANCE = FilterTolerance(1.1, (1.5, 2.4))


def fabricated(error_m: float, sigma_m: float, lost: int = 0) -> FormationResult:
    """Runs that err by ``error_m`` RMS per axis with a claim of ``sigma_m``; the bound is 1 m.

    The errors are +-, so large numbers of runs make narrow intervals.
    """
    epochs, runs = 601, 50
    error = np.full((epochs, runs, 4), error_m)
    error[:, ::2] *= -1.0
    error[600, :lost, 0] = 501.0
    variance = np.full((epochs, runs, 4), sigma_m**2)
    tally = Tally.of(error, variance, np.zeros((epochs, runs)), np.zeros(epochs))
    bound = BoundTally(1, np.ones((epochs, 4)))
    return FormationResult({JUDGED: tally, EKF: tally}, bound, bound)


def shortfalls(
    result: FormationResult, tolerance: FilterTolerance | None = TOLERANCE
) -> tuple[str, ...] | None:
    case = FilterCase("fabricated", DrawnEstimate(), (0.0, 0.0), tolerance)
    return consistency._row("literal", case, JUDGED, result).shortfalls


def test_what_is_met_is_no_shortfall() -> None:
    """An error of 1 m per axis, claimed and bounded as such."""
    assert shortfalls(fabricated(1.0, 1.0)) == ()


def test_what_is_out_of_tolerance_is_a_sentence_with_the_numbers() -> None:
    """All errors being alike, the intervals have no width: RMSE / bound 1.5, NEES 2 x 1.5²."""
    expected = [
        sentence
        for time in ("1", "4", "8", "12")
        for sentence in (
            f"RMSE / bound at least 1.500 at {time} s, above 1.1",
            f"NEES 4.50-4.50 at {time} s, outside 1.5-2.4",
        )
    ]
    assert shortfalls(fabricated(1.5, 1.0)) == tuple(expected)


def test_too_much_modesty_is_a_shortfall_too() -> None:
    missed = shortfalls(fabricated(1.0, 2.0))
    assert missed is not None
    assert len(missed) == 4
    assert missed[0] == "NEES 0.50-0.50 at 1 s, outside 1.5-2.4"


def test_a_lost_track_is_a_shortfall_with_or_without_a_tolerance() -> None:
    assert shortfalls(fabricated(1.0, 1.0, lost=2), None) == ("2 tracks lost at 12 s",)
    missed = shortfalls(fabricated(1.0, 1.0, lost=2))
    assert missed is not None
    assert missed[0] == "2 tracks lost at 12 s"


def test_a_tolerance_is_kept_when_the_interval_reaches_it() -> None:
    """And not by the mean alone: either end, of either figure."""

    def instant(ratio: Interval, nees: Interval) -> list[FilterInstant]:
        return [FilterInstant(1.0, 1.0, 1.0, 1.0, ratio, ratio, nees, 0.95)]

    right = Interval(2.0, 1.9, 2.1)
    for ratio, nees, missed in (
        (Interval(1.2, 1.09, 1.3), right, 0),
        (Interval(1.2, 1.11, 1.3), right, 1),
        (Interval(0.2, 0.1, 0.3), right, 0),  # below the bound is no fault of the filter
        (Interval(1.0, 0.9, 1.1), Interval(2.6, 2.39, 2.8), 0),
        (Interval(1.0, 0.9, 1.1), Interval(2.6, 2.41, 2.8), 1),
        (Interval(1.0, 0.9, 1.1), Interval(1.3, 1.1, 1.51), 0),
        (Interval(1.0, 0.9, 1.1), Interval(1.3, 1.1, 1.49), 1),
    ):
        assert len(consistency._shortfalls(TOLERANCE, instant(ratio, nees), 0)) == missed


def test_only_the_judged_filter_has_a_tolerance() -> None:
    case = FilterCase("fabricated", DrawnEstimate(), (0.0, 0.0), TOLERANCE)
    assert consistency._row("literal", case, EKF, fabricated(9.0, 1.0)).shortfalls is None
