"""What is noted of the tracker's runs, by a tracker that says what the test wants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.estimate import Counts, Estimate
from swarmctl.estimation.integrity.health import Status, Verdict
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.rows import Rows
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.study import track_runs
from swarmctl.study.track_cases import CASES, Gap, TrackCase
from swarmctl.study.track_runs import JUDGED, Chunk, Tracked, fly_chunk

CASE = replace(
    CASES["clocks"], period_s=0.1, times_s=(0.2, 0.4, 12.0), gap=Gap(0.25, 0.55, 0), tolerances=()
)
EMITTER = np.array([0.0, 0.0, -14.142136, 14.142136])
"""Table 1's, at the start."""


class Scripted:
    """Puts the emitter where it is said to be, from the third epoch on."""

    hypotheses: tuple[tuple[float, float], ...] = ((1.0, 0.0),)
    """Of each its probability, and how far off it is (m), with a sigma of 1 m."""
    statuses: Sequence[Status] = ()
    fails_at = 10**9
    made: ClassVar[list[Scripted]]

    def __init__(
        self,
        name: str,
        prior: Prior,
        behaviour: Behaviour,
    ) -> None:
        del name, prior, behaviour
        self.taken: list[Rows] = []
        self.counts = Counts(used=3, aside=1)
        self.is_resolved = len(self.hypotheses) == 1
        self.verdict = Verdict("initialising", None, 1.0, 0.0, 0.0)
        self.made.append(self)

    def update(self, rows: Rows) -> bool:
        if len(self.taken) == self.fails_at:
            raise EstimationError("No finite result.")
        self.taken.append(rows)
        status = self.statuses[min(len(self.taken), len(self.statuses)) - 1]
        self.verdict = self.verdict._replace(status=status)
        return True

    def estimates(self) -> list[Estimate]:
        if len(self.taken) < 3:
            return []
        return [self._at(self.taken[-1].epoch_s, *each) for each in self.hypotheses]

    def predict_to(self, epoch_s: float) -> Estimate:
        return self._at(epoch_s, *self.hypotheses[0])

    @staticmethod
    def _at(epoch_s: float, probability: float, off_m: float) -> Estimate:
        x = EMITTER.copy()
        x[:2] += epoch_s * x[2:] + [off_m, 0.0]
        return Estimate(epoch_s, x, np.eye(4), probability, 0.0)


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> type[Scripted]:
    class Mine(Scripted):
        made: ClassVar[list[Scripted]] = []
        statuses: Sequence[Status] = ("tracking",)

    monkeypatch.setattr(track_runs, "FILTERS", SimpleNamespace(track=Mine))
    return Mine


def flown(case: TrackCase = CASE) -> Tracked:
    return fly_chunk(Chunk(case, {}, 0, 0, 2)).tracked[JUDGED]


def test_an_estimate_is_judged_at_its_time_also_in_a_silence(scripted: type[Scripted]) -> None:
    scripted.hypotheses = ((1.0, 2.0),)
    found = flown()
    expected = np.broadcast_to([2.0, 0.0, 0.0, 0.0], (2, 3, 4))
    np.testing.assert_allclose(found.error, expected, atol=1e-5)
    np.testing.assert_allclose(found.first_s, 0.2)
    np.testing.assert_allclose(found.first_nees, 4.0, atol=1e-5)
    assert found.resolved.all()
    np.testing.assert_array_equal(found.aside, 0.25)
    taken = [rows.epoch_s for rows in scripted.made[0].taken]
    assert len(taken) == 121 - 3
    np.testing.assert_allclose(taken[2:4], [0.2, 0.6])


def test_before_the_first_estimate_there_is_nothing_to_judge(scripted: type[Scripted]) -> None:
    found = flown(replace(CASE, times_s=(0.1, 12.0), gap=None))
    assert np.isnan(found.error[:, 0]).all()
    assert np.isfinite(found.error[:, 1]).all()
    assert len(scripted.made) == 2


@pytest.mark.parametrize(
    ("hypotheses", "silent"),
    [
        (((1.0, 5.0),), False),
        (((1.0, 6.0),), True),
        (((0.98, 100.0), (0.02, 1.0)), False),
        (((0.995, 100.0), (0.005, 1.0)), True),
    ],
)
def test_to_be_wrong_is_silent_unless_the_truth_is_carried(
    scripted: type[Scripted], hypotheses: tuple[tuple[float, float], ...], silent: bool
) -> None:
    """A hypothesis has the truth in it up to a NEES of 30, and is one from 1 % on."""
    scripted.hypotheses = hypotheses
    found = flown(replace(CASE, gap=None))
    assert (found.silent == silent).all()
    assert (found.resolved == (len(hypotheses) == 1)).all()


def test_health_is_counted_when_it_gets_worse(scripted: type[Scripted]) -> None:
    scripted.statuses = (
        *("initialising", "tracking", "degraded", "diverged"),
        *("tracking", "degraded", "degraded", "tracking"),
    )
    np.testing.assert_array_equal(flown().degraded, 2.0)


def test_a_track_without_a_finite_result_is_lost(scripted: type[Scripted]) -> None:
    scripted.fails_at = 50
    found = flown()
    assert np.isfinite(found.error[:, :2]).all()
    assert np.isnan(found.error[:, 2]).all()
    assert found.tally().lost.tolist() == [0.0, 0.0, 2.0]
