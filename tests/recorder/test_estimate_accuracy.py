"""Errors, consistency and the bound, against numbers worked out another way."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from swarmctl.decisions import EstimateMade
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.recorder.estimate_accuracy import Accuracy
from swarmctl.recorder.plot_series import FlightSeries
from swarmctl.recorder.truth import TruthTrack
from swarmctl.units import Vector

UTC_S = 1.79e9
STILL = (0.0, 0.0, 0.0)
SIGMA_P_M = 0.5
PRIOR = np.diag([90.0, 90.0, 2.0, 0.0, 0.0, 0.0]) ** 2
"""The emitter surely stands still, so that the bound is a plain sum of information."""


class Flight:
    """An accuracy with its truth; times are mission times, UTC in step."""

    def __init__(self) -> None:
        self.measured: dict[str, Any] = {}
        self.truth = TruthTrack()
        self.series = FlightSeries()
        self.accuracy = Accuracy(
            reference=1,
            prior_covariance=PRIOR,
            process_noise=(0.0, 0.0, 0.0),
            sigma_p_m=SIGMA_P_M,
            errors=ReceiverErrors(),
            truth=self.truth,
            series=self.series,
        )

    def estimate(
        self,
        t: float,
        position: Vector,
        horizontal: tuple[float, float, float],
        observing: bool = True,
    ) -> None:
        P = np.eye(6)
        P[0, 0], P[0, 1], P[1, 1] = horizontal
        P[1, 0] = P[0, 1]
        self.accuracy.add_estimate(
            EstimateMade(
                at_s=t,
                epoch_utc_s=UTC_S + t,
                position_enu=position,
                velocity_enu=STILL,
                covariance=tuple(P.ravel().tolist()),
                nis=1.0,
                rd_count=2,
                **self.measured,
            ),
            t,
            observing=observing,
        )
        self.measured = {}

    def emitter(self, t: float, position: Vector) -> None:
        self.truth.add(UTC_S + t, position, STILL)
        self.accuracy.settle(UTC_S + t)

    def measure(self, t: float, sigmas: dict[int, float], rho: float = 0.5) -> None:
        """The next estimate is made from these range differences."""
        self.measured = {
            "measured_utc_s": UTC_S + t,
            "reference": 1,
            "receivers": tuple(sigmas),
            "sigma_m": tuple(sigmas.values()),
            "rho": (rho,) * len(sigmas),
        }

    def places(self, t: float, places: dict[int, Vector]) -> None:
        for sysid, place in places.items():
            self.accuracy.add_position(sysid, UTC_S + t, place, STILL)


def test_error_and_nees_of_one_estimate() -> None:
    flight = Flight()
    flight.emitter(0.0, (100.0, 200.0, 0.0))
    flight.estimate(0.0, (103.0, 196.0, 50.0), (9.0, 0.0, 4.0))
    assert flight.accuracy.final is None  # it waits for the truth to be asked again
    flight.accuracy.settle(UTC_S)
    final = flight.accuracy.final
    assert final is not None
    assert final.error_m == pytest.approx(5.0)
    assert final.nees == pytest.approx(3.0**2 / 9.0 + 4.0**2 / 4.0)
    assert flight.accuracy.final_sigma_m == pytest.approx(3.0)
    assert (final.bound_m, final.range_m) == (None, None)


def test_nees_and_axis_of_a_slanted_covariance() -> None:
    P = np.array([[40.0, 25.0], [25.0, 30.0]])
    error = np.array([7.0, -2.0])
    flight = Flight()
    flight.estimate(0.0, (7.0, -2.0, 0.0), (40.0, 25.0, 30.0))
    flight.emitter(0.0, (0.0, 0.0, 0.0))
    final = flight.accuracy.final
    assert final is not None
    assert final.nees == pytest.approx(error @ np.linalg.inv(P) @ error)
    assert flight.accuracy.final_sigma_m == pytest.approx(math.sqrt(np.linalg.eigvalsh(P)[1]))


def test_the_truth_is_taken_at_the_estimates_epoch() -> None:
    flight = Flight()
    flight.estimate(10.3, (0.0, 0.0, 0.0), (1.0, 0.0, 1.0))
    flight.emitter(10.0, (100.0, 0.0, 0.0))
    assert flight.accuracy.final is None
    flight.emitter(10.5, (99.0, 0.0, 0.0))  # 2 m/s west
    final = flight.accuracy.final
    assert final is not None
    assert final.error_m == pytest.approx(99.4)


def test_the_final_estimate_is_the_last_one_made_while_observing() -> None:
    flight = Flight()
    flight.estimate(0.0, (1.0, 0.0, 0.0), (1.0, 0.0, 1.0), observing=False)
    flight.emitter(0.0, STILL)
    assert flight.accuracy.final is not None
    assert flight.accuracy.final.error_m == pytest.approx(1.0)
    assert flight.accuracy.final_sigma_m == pytest.approx(1.0)
    for t, error in ((1.0, 2.0), (2.0, 3.0)):
        flight.estimate(t, (error, 0.0, 0.0), (error**2, 0.0, 1.0))
    flight.estimate(3.0, (4.0, 0.0, 0.0), (16.0, 0.0, 1.0), observing=False)
    flight.emitter(3.0, STILL)
    assert flight.accuracy.final.error_m == pytest.approx(3.0)
    assert flight.accuracy.final_sigma_m == pytest.approx(3.0)


def test_mean_nees_counts_what_was_observed_after_convergence() -> None:
    flight = Flight()
    flight.estimate(0.0, (50.0, 0.0, 0.0), (625.0, 0.0, 1.0))  # exactly 25 m: not below
    flight.estimate(1.0, (24.0, 0.0, 0.0), (576.0, 0.0, 1.0))  # NEES 1
    flight.estimate(2.0, (60.0, 0.0, 0.0), (900.0, 0.0, 1.0))  # 4, and stays converged
    flight.estimate(3.0, (99.0, 0.0, 0.0), (9.0, 0.0, 1.0), observing=False)
    assert flight.accuracy.nees_mean is None
    flight.emitter(3.0, STILL)
    assert flight.accuracy.converged_at_s == 1.0
    assert flight.accuracy.nees_mean == pytest.approx((1.0 + 4.0) / 2)


EMITTER = (1000.0, 300.0, 10.0)
PLACES = {
    1: (0.0, 0.0, 80.0),
    2: (20.0, 240.0, 90.0),
    3: (10.0, -230.0, 100.0),
    4: (-200.0, 5.0, 110.0),
}


def information(sigmas: dict[int, float], rho: float) -> np.ndarray:
    """Fisher information of one epoch on the position: derivatives by finite differences."""

    def rd(emitter: np.ndarray, sysid: int) -> float:
        return math.dist(emitter, PLACES[sysid]) - math.dist(emitter, PLACES[1])

    e, h = np.array(EMITTER), 1e-3
    J = np.array(
        [[(rd(e + h * a, i) - rd(e - h * a, i)) / (2 * h) for a in np.eye(3)] for i in sigmas]
    )
    # Each receiver's own noise, plus what all share through the reference: its receiver's
    # noise and its position error; the companions' position errors are their own.
    s = np.array(list(sigmas.values()))
    C = np.diag((1 - rho) * s**2 + SIGMA_P_M**2) + rho * np.outer(s, s) + SIGMA_P_M**2
    fisher: np.ndarray = J.T @ np.linalg.inv(C) @ J
    return fisher


def bound(fisher: np.ndarray) -> float:
    P = np.linalg.inv(np.linalg.inv(PRIOR[:3, :3]) + fisher)
    return math.sqrt(np.linalg.eigvalsh(P[:2, :2])[1])


def final_bound(flight: Flight, until: float) -> float:
    flight.emitter(until, EMITTER)
    final = flight.accuracy.final
    assert final is not None
    assert final.bound_m is not None
    return final.bound_m


SIGMAS = {2: 3.0, 3: 2.0, 4: 5.0}


def test_the_bound_sums_the_information_of_the_epochs_that_were_used() -> None:
    flight = Flight()
    for k in range(8):
        t = 0.5 * k
        flight.places(t, PLACES)
        if k != 3:  # the queue dropped that one
            flight.measure(t, SIGMAS)
            flight.estimate(t, (0.0, 0.0, 0.0), (1.0, 0.0, 1.0))
    expected = bound(7 * information(SIGMAS, 0.5))
    assert final_bound(flight, 3.5) == pytest.approx(expected, rel=1e-6)
    final = flight.accuracy.final
    assert final is not None
    assert final.range_m == pytest.approx(math.dist(EMITTER, PLACES[1]))


def test_a_receiver_without_a_position_adds_nothing_to_the_bound() -> None:
    flight = Flight()
    flight.places(0.0, {i: PLACES[i] for i in (1, 2, 4)})
    flight.measure(0.0, SIGMAS)
    flight.estimate(0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 1.0))
    expected = bound(information({2: 3.0, 4: 5.0}, 0.5))
    assert final_bound(flight, 0.0) == pytest.approx(expected, rel=1e-6)


def test_range_differences_that_came_late_are_left_out_of_the_bound() -> None:
    flight = Flight()
    for t in (0.0, 0.5, 1.0):
        flight.places(t, PLACES)
    for measured_at, t in ((0.0, 0.0), (1.0, 1.0), (0.5, 1.0)):
        flight.measure(measured_at, SIGMAS)
        flight.estimate(t, (0.0, 0.0, 0.0), (1.0, 0.0, 1.0))
    expected = bound(2 * information(SIGMAS, 0.5))
    assert final_bound(flight, 1.0) == pytest.approx(expected, rel=1e-6)


def test_range_differences_count_once_however_many_estimates_follow() -> None:
    flight = Flight()
    flight.places(0.0, PLACES)
    flight.measure(0.0, SIGMAS)
    for _ in range(2):
        flight.estimate(0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 1.0))
    expected = bound(information(SIGMAS, 0.5))
    assert final_bound(flight, 0.0) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("known", [(1,), (2, 3, 4)])
def test_without_positions_there_is_no_bound(known: tuple[int, ...]) -> None:
    flight = Flight()
    flight.places(0.0, {i: PLACES[i] for i in known})
    flight.measure(0.0, SIGMAS)
    flight.estimate(0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 1.0))
    flight.emitter(0.0, EMITTER)
    assert flight.accuracy.final is not None
    assert flight.accuracy.final.bound_m is None


def test_the_bound_widens_while_nothing_is_measured() -> None:
    flight = Flight()
    flight.accuracy = Accuracy(
        reference=1,
        prior_covariance=np.diag([1e-3, 1e-3, 1e-3, 2.0, 1.0, 0.0]) ** 2,
        process_noise=(0.0, 0.0, 0.0),
        sigma_p_m=SIGMA_P_M,
        errors=ReceiverErrors(),
        truth=flight.truth,
        series=flight.series,
    )
    for t in (0.0, 10.0):
        flight.places(t, PLACES)
        flight.measure(t, {2: 1e6})  # tells nothing
        flight.estimate(t, (0.0, 0.0, 0.0), (1.0, 0.0, 1.0))
    # The prior holds at the first update: 10 s later 2 m/s have become 20 m.
    assert final_bound(flight, 10.0) == pytest.approx(20.0, rel=1e-6)


def test_the_bound_ends_with_the_observing() -> None:
    flight = Flight()
    for k, observing in enumerate((False, True, False, True)):
        t = float(k)
        flight.places(t, PLACES)
        flight.measure(t, SIGMAS)
        flight.estimate(t, STILL, (1.0, 0.0, 1.0), observing=observing)
        flight.emitter(t, EMITTER)
        final = flight.accuracy.final
        assert final is not None
        assert (final.bound_m is None) == (k == 3)  # the third epoch was left out
    assert [row[0] for row in flight.series.bounds.rows] == [0.0, 1.0]


def test_series_hold_what_the_plots_need() -> None:
    flight = Flight()
    flight.places(0.0, PLACES)
    flight.measure(0.0, SIGMAS)
    flight.estimate(0.0, (3.0, 4.0, 0.0), (9.0, 1.0, 4.0))
    flight.emitter(0.0, STILL)
    series = flight.series
    assert series.estimates.rows == [(0.0, 3.0, 4.0, 9.0, 1.0, 4.0)]
    assert series.errors.rows == [(0.0, 5.0)]
    assert [len(s.rows) for s in (series.sigmas, series.bounds)] == [1, 1]


def test_without_truth_memory_does_not_grow() -> None:
    flight = Flight()
    for k in range(5000):
        flight.measure(float(k), SIGMAS)
        flight.estimate(float(k), STILL, (1.0, 0.0, 1.0))
    assert len(flight.accuracy._waiting) <= 4096
    assert flight.accuracy.final is None
    assert flight.accuracy.final_sigma_m == pytest.approx(1.0)
