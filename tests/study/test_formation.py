"""The closed-loop comparison of formations: its statistics, and a few real missions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.errors import MissionFileError, UsageError
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.study import formation
from swarmctl.study.formation import MissionOutcome, fly_mission, mission_text, run_formation


def made_up(monkeypatch: pytest.MonkeyPatch, times: dict[str, list[float]]) -> list[formation.Cell]:
    """What the study makes of given times to converge; every error is 3 m."""
    monkeypatch.setattr(
        formation, "fly_mission", lambda work: MissionOutcome(times[work[0]][work[2]], 3.0)
    )
    runs = len(next(iter(times.values())))
    # The names must be ones a mission file knows.
    return run_formation(runs=runs, designs=tuple(times), companions=(3,))


def test_the_best_design_is_the_measure_of_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    uniform, paper = made_up(monkeypatch, {"uniform": [40.0, 60.0], "paper": [20.0, 30.0]})
    assert (uniform.mean_s, paper.mean_s) == (50.0, 25.0)
    assert (uniform.of_best, paper.of_best) == (2.0, 1.0)
    assert paper.of_best_95 == (1.0, 1.0)
    # Paired: twice as long in every mission, so there is no doubt about the ratio.
    assert uniform.of_best_95 == pytest.approx((2.0, 2.0))
    assert (uniform.rmse_m, uniform.lost) == (3.0, 0)


def test_a_mission_counts_only_if_every_design_converged_in_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    uniform, paper = made_up(
        monkeypatch, {"uniform": [40.0, math.inf, 60.0], "paper": [20.0, 5.0, 30.0]}
    )
    assert (uniform.lost, paper.lost) == (1, 0)
    assert paper.mean_s == 25.0


def test_the_interval_covers_the_true_ratio(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two designs alike but for 10 %, 60 noisy missions, 100 studies: 95 of them cover."""
    rng = np.random.default_rng(1)
    monkeypatch.setattr(formation, "RESAMPLES", 400)
    covered = 0
    for _ in range(100):
        base = rng.normal(30.0, 6.0, 60)
        slow = 1.1 * base + rng.normal(0.0, 3.0, 60)
        cells = made_up(monkeypatch, {"paper": base.tolist(), "uniform": slow.tolist()})
        low, high = cells[1].of_best_95
        covered += low <= 1.1 <= high
    # Binomial, n = 100, p = 0.95: 88 is 3.2 sigma below; the bootstrap of 60 is a little narrow.
    assert covered >= 88


@pytest.mark.parametrize("companions", [1, 3, 12])
def test_every_number_of_companions_is_a_mission(companions: int) -> None:
    mission = parse_mission(mission_text("optimal", companions))
    assert len(mission.swarm.vehicles) == companions + 1
    assert mission.formation.design == "optimal"


@pytest.mark.slow
def test_a_flight_ends_when_it_has_converged_and_a_seed_repeats_it() -> None:
    flight = fly_mission(("optimal", 3, 5))
    assert 0.0 < flight.converged_s < 120.0
    # At 1-sigma 25 m, an error of five sigmas is no chance.
    assert flight.error_m < 125.0
    assert fly_mission(("optimal", 3, 5)) == flight


@pytest.mark.slow
def test_the_optimal_formation_of_four_is_sooner_than_the_paper_s() -> None:
    """By the Cramér-Rao bound about 26 against 40 s; a handful of missions shows that much."""
    cells = {
        cell.design: cell
        for cell in run_formation(runs=3, designs=("paper", "optimal"), companions=(4,))
    }
    assert cells["optimal"].of_best == 1.0
    assert cells["paper"].of_best > 1.2


def test_wrong_arguments_are_sentences() -> None:
    with pytest.raises(UsageError, match="at least 2 runs, not 1"):
        run_formation(runs=1)
    with pytest.raises(MissionFileError, match=r"formation\.design is 'square'"):
        run_formation(designs=("square",))
