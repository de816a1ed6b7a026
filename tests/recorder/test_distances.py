"""Separation and stand-off on motions whose least distances are known."""

from __future__ import annotations

import math

import pytest

from swarmctl.recorder.distances import Distances
from swarmctl.recorder.plot_series import FlightSeries
from swarmctl.recorder.truth import TruthTrack
from swarmctl.units import Vector

GROUND_M = 40.0
UTC_S = 1.79e9


class Flight:
    """Positions relative to the ground at the launch point; mission time and UTC in step."""

    def __init__(self) -> None:
        self.truth = TruthTrack()
        self.series = FlightSeries()
        self.distances = Distances(self.truth, self.series)

    def at(self, time_s: float, sysid: int, position: Vector, velocity: Vector) -> None:
        alt = GROUND_M + position[2]
        self.distances.add(sysid, time_s, UTC_S + time_s, position, velocity, alt)

    def emitter(self, time_s: float, position: Vector) -> None:
        self.truth.add(UTC_S + time_s, position, (0.0, 0.0, 0.0))
        self.distances.settle(UTC_S + time_s)


STILL = (0.0, 0.0, 0.0)


def test_positions_are_brought_to_a_common_epoch() -> None:
    flight = Flight()
    flight.at(0.0, 1, (0.0, 0.0, 0.0), STILL)
    flight.at(0.0, 2, (0.0, 40.0, 0.0), STILL)
    assert flight.distances.min_separation_m is None
    # Both fly east at 20 m/s, 40 m apart abreast, but report 0.4 s = 8 m after one another:
    # taken as they come the distance would be sqrt(40² + 8²) = 40.8 m.
    for k in range(5):
        t = 1.0 + k
        flight.at(t, 1, (20.0 * t, 0.0, 30.0), (20.0, 0.0, 0.0))
        flight.at(t + 0.4, 2, (20.0 * (t + 0.4), 40.0, 30.0), (20.0, 0.0, 0.0))
    assert flight.distances.min_separation_m == pytest.approx(40.0, abs=1e-9)


def test_separation_is_3d_over_all_pairs() -> None:
    flight = Flight()
    places = {1: (0.0, 0.0, 0.0), 2: (100.0, 0.0, 0.0), 3: (103.0, 4.0, 0.0)}
    for sysid, place in places.items():
        flight.at(0.0, sysid, place, STILL)
    for sysid, (x, y, _) in places.items():
        flight.at(1.0, sysid, (x, y, 20.0 + 12.0 * (sysid == 3)), STILL)
    assert flight.distances.min_separation_m == pytest.approx(13.0)  # 3, 4, 12


def test_on_the_ground_nothing_counts() -> None:
    flight = Flight()
    flight.at(0.0, 1, (0.0, 0.0, 0.0), STILL)
    flight.at(0.0, 2, (5.0, 0.0, 0.0), STILL)
    flight.at(1.0, 1, (0.0, 0.0, 50.0), STILL)
    flight.at(1.0, 2, (5.0, 0.0, 3.0), STILL)  # 3 m up is not yet airborne
    assert flight.distances.min_separation_m is None
    flight.emitter(2.0, (5.0, 0.0, 3.0))
    assert flight.distances.min_standoff_m == pytest.approx(math.hypot(5.0, 47.0))
    flight.at(2.0, 2, (5.0, 0.0, 3.1), STILL)
    assert flight.distances.min_separation_m == pytest.approx(math.hypot(5.0, 46.9))


def test_a_stale_position_is_not_carried_on() -> None:
    flight = Flight()
    for sysid, x in ((1, 0.0), (2, 200.0)):
        flight.at(0.0, sysid, (x, 0.0, 0.0), STILL)
    flight.at(1.0, 1, (0.0, 0.0, 30.0), (50.0, 0.0, 0.0))
    # Carried on for 4 s vehicle 1 would be upon vehicle 2.
    flight.at(5.0, 2, (200.0, 0.0, 30.0), STILL)
    assert flight.distances.min_separation_m is None


def test_stand_off_is_from_where_the_emitter_was_then() -> None:
    flight = Flight()
    flight.at(0.0, 1, (0.0, 0.0, 0.0), STILL)
    flight.emitter(0.0, (100.0, 0.0, 0.0))
    flight.at(0.5, 1, (0.0, 0.0, 60.0), STILL)
    assert flight.distances.min_standoff_m is None  # no truth covers it yet
    # The emitter passes x = 80 at 0.5 s: 3-D distance 100; at 1 s it is at x = 60, too late.
    flight.emitter(1.0, (60.0, 0.0, 0.0))
    assert flight.distances.min_standoff_m == pytest.approx(100.0)


def test_without_truth_there_is_no_stand_off_and_no_growing_memory() -> None:
    flight = Flight()
    for k in range(10_000):
        flight.at(0.1 * k, 1, (0.0, 0.0, 30.0 * (k > 0)), STILL)
    assert flight.distances.min_standoff_m is None
    assert len(flight.distances._waiting) <= 4096


def test_series_hold_tracks_launches_and_the_least_stand_off_between_rows() -> None:
    flight = Flight()
    flight.at(0.0, 7, (1.0, 2.0, 0.0), STILL)
    for k in range(1, 31):
        near = k == 7  # between two rows
        flight.at(0.1 * k, 7, (0.0, 0.0, 10.0 if near else 50.0), STILL)
    flight.emitter(4.0, (0.0, 0.0, 0.0))
    assert flight.series.launches == {7: (1.0, 2.0, 0.0)}
    assert [row[0] for row in flight.series.tracks[7].rows] == pytest.approx(
        [0, 0.5, 1, 1.5, 2, 2.5, 3]
    )
    assert min(row[1] for row in flight.series.standoffs.rows) == pytest.approx(10.0)
    assert flight.distances.min_standoff_m == pytest.approx(10.0)
