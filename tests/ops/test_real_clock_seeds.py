"""The shipped mission with real clocks, echoes, bursts and a sector, over seeds.

``SEEDS=20 pytest tests/ops/test_real_clock_seeds.py -s`` prints the table of as many.
"""

from __future__ import annotations

import os

import pytest

from swarmctl.estimation.bounds.consistency import mean_bounds
from swarmctl.mission.mission_file_loading import load_mission
from tests.ops.seeds import MISSIONS, Flights, column, fly_seeds

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("real_clock_seeds")]

MISSION = MISSIONS / "beacon_real_clocks.yaml"
SEEDS = range(1, 1 + int(os.environ.get("SEEDS", "3")))
COLUMNS = (
    "final_error_m",
    "final_sigma_m",
    "pcrb_final_m",
    "nees_final",
    "nees_mean",
    "converged_s",
    "min_separation_m",
    "min_standoff_m",
    "rd_measurements",
    "rd_aside",
    "duration_s",
    "wall_s",
)


@pytest.fixture(scope="module")
def flights() -> Flights:
    return fly_seeds(MISSION, SEEDS, COLUMNS)


def test_every_flight_locates_the_emitter(flights: Flights) -> None:
    assert {flight.result for flight in flights} == {"located"}


def test_every_sigma_is_within_two_and_a_half_times_the_bound(
    flights: Flights,
) -> None:
    """The bound knows nothing of echoes; it is that of the clocks and positions modelled."""
    ratio = column(flights, "final_sigma_m") / column(flights, "pcrb_final_m")
    assert ratio.max() <= 2.5
    # An error bar below the bound would be a claim that nobody can make good.
    assert ratio.min() >= 0.8


def test_the_error_bars_are_honest(flights: Flights) -> None:
    """None lost, and the NEES of all at the last instant within 99.9 % of what is right."""
    nees = column(flights, "nees_final")
    low, high = mean_bounds(2, len(nees), 0.999)
    assert low <= nees.mean() <= high
    assert nees.max() < 30.0


def test_echoes_are_set_aside_and_little_else(flights: Flights) -> None:
    """An RD is an echo's if either of its arrivals is: 1 - 0.95² of them, 9.75 %.

    All rows of an epoch are set aside with their reference: 5 % of the epochs. An echo of 50 m
    upwards is 10 sigma or more once the track has settled, so hardly one is missed.
    """
    share = column(flights, "rd_aside") / column(flights, "rd_measurements")
    assert share.min() > 0.06
    assert share.max() < 0.14


def test_every_limit_is_kept(flights: Flights) -> None:
    limits = load_mission(MISSION).limits
    assert column(flights, "max_reference_range_m").max() <= limits.d_max_m
    assert column(flights, "min_separation_m").min() >= limits.min_separation_m
    assert column(flights, "min_standoff_m").min() >= limits.stand_off_m
