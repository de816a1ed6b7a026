"""What the tracker's health says of feeds that go wrong, and of those that do not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from swarmctl.errors import UsageError
from swarmctl.study import track_health
from swarmctl.study.engagement import Engagement, fly
from swarmctl.study.receivers import SimulatedReceivers
from swarmctl.study.registry import PERPENDICULAR
from swarmctl.study.track_health import FAULTS, FROM_S, GOOD, WITHIN_S, run_track_health
from swarmctl.units import Array

RUNS = 5
RISK = 1e-4
"""Probability that correct code misses a statistical bound."""


@pytest.mark.parametrize("fault", FAULTS)
def test_a_wrong_model_is_named_and_a_right_one_is_not(fault: str) -> None:
    row = run_track_health(runs=RUNS, seed=1, faults=(fault,))[0]
    assert (row.runs, row.false_alarms.value, row.shortfalls) == (RUNS, 0.0, ())
    if fault == GOOD:
        assert (row.named, row.causes) == (None, {})
        assert row.hours == RUNS * 12.0 / 3600.0
    else:
        assert row.named is not None
        assert row.named.value == 1.0
        assert row.latest_s <= WITHIN_S
        assert sum(row.causes.values()) == RUNS
        assert row.hours == RUNS * 4.0 / 3600.0


# --- Faults ----------------------------------------------------------------------------------


def spoiled(fault: str, runs: int = 2) -> tuple[Array, Array]:
    """Changes of positions (K, runs, 4, 2) and RDs (K, runs, 3) by K epochs of a fault."""
    spoil = track_health._Fault(fault, np.random.default_rng(1)).spoil
    positions, rd = [], []
    scene = Engagement(period_s=track_health.PERIOD_S, duration_s=2.0)
    for k, moment in enumerate(fly(scene, np.array(PERPENDICULAR), scene.emitter)):
        at = np.concatenate([moment.reference[None], moment.companions])
        at = np.broadcast_to(at, (runs, 4, 2))
        good = np.broadcast_to([100.0 + k, 10.0, -50.0], (runs, 3))
        other_at, other = spoil(k * track_health.PERIOD_S, at, good)
        positions.append(other_at - at)
        rd.append(other - good)
    return np.stack(positions), np.stack(rd)


@pytest.mark.parametrize(
    ("fault", "by_2_s"),
    [
        (GOOD, [0.0, 0.0, 0.0]),
        ("a clock jumps by 100 ns", [30.0, 0.0, 0.0]),
        ("a clock drifts by 10 ns/s", [6.0, 0.0, 0.0]),
        ("the reference's clock jumps by 100 ns", [-30.0, -30.0, -30.0]),
        ("two receivers are swapped", [-110.0, 110.0, 0.0]),
        ("the feed is constant", [-20.0, 0.0, 0.0]),
        ("a position is 42 m off", [0.0, 0.0, 0.0]),
    ],
)
def test_a_fault_is_what_it_is_called(fault: str, by_2_s: list[float]) -> None:
    positions, rd = spoiled(fault)
    np.testing.assert_allclose(rd[-1, 0], by_2_s, atol=1e-9)
    moved = np.hypot(*positions[..., :].T).T
    expected = [0.0, 42.4, 0.0, 0.0] if "42" in fault else [0.0] * 4
    np.testing.assert_allclose(moved[-1, 0], expected, atol=0.1)


@pytest.mark.parametrize(
    ("fault", "sigma_m", "keep"),
    [
        ("noise doubled", math.sqrt(3.0 * SimulatedReceivers().white_covariance(1)[0, 0]), 0.0),
        ("errors of 2 m for 0.5 s", 2.0, math.exp(-0.2)),
    ],
)
def test_a_fault_of_noise_has_the_size_and_the_colour_it_is_called_by(
    fault: str, sigma_m: float, keep: float
) -> None:
    """Runs are independent; the last epoch and the one before it are compared."""
    runs = 4000
    before, last = (e.ravel() / sigma_m for e in spoiled(fault, runs)[1][-2:])
    low, high = stats.chi2.interval(1.0 - RISK, last.size) / np.array(last.size)
    assert low < (last**2).mean() < high
    far = stats.norm.ppf(1.0 - RISK / 2.0) / math.sqrt(last.size)
    assert abs((before * last).mean() - keep) < far * math.sqrt(1.0 + keep**2)


# --- Rows ------------------------------------------------------------------------------------


def said(after_s: float, cause: str | None = "noise", false_alarms: int = 0) -> track_health._Said:
    return track_health._Said(false_alarms, after_s, cause)


def test_what_is_said_too_late_or_never_is_a_shortfall() -> None:
    row = track_health._row(
        "noise doubled", [said(1.0), said(5.0), said(5.1, "rejected"), said(math.nan, None)]
    )
    assert row.named is not None
    assert row.named.value == 0.5
    assert (row.latest_s, row.causes) == (5.1, {"noise": 2, "rejected": 1})
    assert row.shortfalls == ("noise doubled: named within 5 s in 50.0% of the runs, not in all",)
    never = track_health._row("noise doubled", [said(math.nan, None)])
    assert math.isnan(never.latest_s)


def test_false_alarms_are_counted_by_the_hour() -> None:
    """Of a feed that goes wrong, only what was said before; 300 runs of 12 s are an hour."""
    well = [said(math.nan, None)] * 294
    row = track_health._row(GOOD, [*well, *[said(math.nan, None, 1)] * 6])
    assert (row.false_alarms.value, row.hours) == (6.0, 1.0)
    low, high = stats.chi2.ppf([0.025, 0.975], [12, 14]) / 2.0
    assert row.false_alarms == pytest.approx((6.0, low, high))
    assert row.shortfalls == (f"none: at least {low:.2f} false alarms an hour, above 1",)
    before = track_health._row("noise doubled", [said(1.0, "noise", 1)])
    assert before.hours == FROM_S / 3600.0
    assert len(before.shortfalls) == 1


def test_a_study_of_no_runs_is_refused() -> None:
    with pytest.raises(UsageError, match="at least 1 run, not 0"):
        run_track_health(runs=0)
