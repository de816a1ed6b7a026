"""A track compared with the truth, on steps whose every figure can be worked out by hand."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from swarmctl.datasets.accuracy import TrackHistory, TrackingFigures, TrackingSummary
from swarmctl.datasets.reading import Trajectory
from swarmctl.datasets.tracking import Assumptions, DataSetCounts, TrackedEpoch
from swarmctl.estimation.estimate import Counts, Estimate
from swarmctl.estimation.integrity.health import Verdict

WELL = Verdict("tracking", None, 1.0, 0.0, 0.0)
BLOCKED = Verdict("degraded", "rejected", 3.0, 0.0, 0.4, (1,))
NOISY = Verdict("degraded", "noise", 5.0, 0.0, 0.0)
COUNTS = DataSetCounts(5, 3, 1, Counts(used=90, aside=10, repeated=2))
STILL = Trajectory(np.array([]), np.zeros((1, 3)))
"""An emitter at the origin."""


def step(t: float, east: float | None, verdict: Verdict = WELL, sigma: float = 1.0) -> TrackedEpoch:
    if east is None:
        return TrackedEpoch(t, None, verdict)
    x = np.array([east, 0.0, 9.0, 0.0, 0.0, 0.0])
    return TrackedEpoch(t, Estimate(t, x, np.diag([sigma**2] * 6)), verdict)


def history(*steps: TrackedEpoch, truth: Trajectory | None = STILL, dof: int = 2) -> TrackHistory:
    found = TrackHistory(dof, truth)
    for one in steps:
        found.add(one)
    return found


def figures(*steps: TrackedEpoch, truth: Trajectory | None = STILL) -> TrackingFigures:
    return history(*steps, truth=truth).figures(COUNTS, 2.0)


STEPS = (
    step(10.0, None, Verdict("initialising", None, 1.0, 0.0, 0.0)),
    step(11.0, 3.0),
    step(12.0, -4.0, BLOCKED),
    step(13.0, 12.0, NOISY),
    step(14.0, 0.0, BLOCKED),
)


def test_errors_are_those_of_the_axes_that_count() -> None:
    found = figures(*STEPS)
    assert found.judged == 4
    assert found.rmse_m == pytest.approx(math.sqrt((9 + 16 + 144) / 4))
    assert found.median_error_m == 3.5
    assert (found.nees_dof, found.mean_nees, found.median_nees) == (2, (9 + 16 + 144) / 4, 12.5)
    assert found.share_lost == 0.25  # the one with a NEES of 144


def test_what_became_of_the_measurements_is_told() -> None:
    found = figures(*STEPS)
    assert (found.epochs, found.estimates, found.first_estimate_s) == (5, 4, 1.0)
    assert (found.used, found.rejected, found.share_rejected) == (90, 10, 0.1)
    assert (found.repeated, found.without_receiver_position, found.restarts) == (2, 3, 1)
    assert (found.duration_s, found.elapsed_s, found.times_real_time) == (4.0, 2.0, 2.0)
    assert found.mean_nis == pytest.approx((1.0 + 3.0 + 5.0 + 3.0) / 4)
    assert found.health == {"degraded": 0.6, "initialising": 0.2, "tracking": 0.2}


def test_without_truth_its_figures_are_left_out() -> None:
    found = msgspec.to_builtins(figures(*STEPS, truth=None))
    assert "mean_nis" in found
    assert not {"judged", "rmse_m", "nees_dof", "mean_nees", "share_lost"} & found.keys()


def test_estimates_outside_the_times_of_the_truth_are_not_judged() -> None:
    late = Trajectory(np.array([12.5, 20.0]), np.zeros((2, 3)))
    assert figures(*STEPS, truth=late).judged == 2


def test_a_track_without_an_estimate_has_no_errors() -> None:
    found = figures(STEPS[0])
    assert (found.estimates, found.first_estimate_s, found.judged) == (0, None, 0)
    assert (found.rmse_m, found.mean_nees, found.share_lost, found.mean_nis) == (None,) * 4


def test_what_was_wrong_is_told_with_the_most_frequent_first() -> None:
    rejected, noise = history(*STEPS).findings(["north mast", "south mast"])
    assert (rejected.cause, rejected.share, rejected.first_s) == ("rejected", 0.4, 12.0)
    assert "south mast" in rejected.sentence
    assert (noise.cause, noise.share, noise.first_s) == ("noise", 0.2, 13.0)


def test_the_summary_has_the_figures_between_the_assumptions_and_the_findings() -> None:
    it = history(*STEPS)
    summary = TrackingSummary(
        filter="ekf",
        receivers=2,
        assumed=Assumptions(at=(1.0, 2.0, 3.0)),
        figures=it.figures(COUNTS, 2.0),
        wrong=it.findings(["a", "b"]),
    )
    written = summary.to_json()
    assert list(written)[:4] == ["filter", "receivers", "assumed", "duration_s"]
    assert list(written)[-1] == "wrong"
    assert list(written["assumed"]["at"]) == [1.0, 2.0, 3.0]
    assert written["wrong"][0].keys() == {"cause", "share", "first_s", "sentence"}
