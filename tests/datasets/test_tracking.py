"""Data sets of a room and of a swarm, tracked from end to end."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, chi2, norm

from sim.indoor_dataset import COLOUR_M, SIGMA_M, TAU_S, simulate, write
from swarmctl.datasets.accuracy import TrackHistory, TrackingFigures
from swarmctl.datasets.reading import (
    Epoch,
    Measurement,
    ReceiverPositions,
    Trajectory,
    read_epochs,
    read_receivers,
    read_truth,
)
from swarmctl.datasets.tracking import Assumptions, DataSetTracking, prior_of
from swarmctl.errors import UsageError
from swarmctl.estimation.bounds.consistency import nees
from swarmctl.estimation.estimate import Estimate
from swarmctl.units import Array

ROOM = Path(__file__).parent / "room"


def last(tracking: DataSetTracking, epochs: Iterable[Epoch]) -> Estimate:
    """The estimate after the last epoch."""
    (*_, end) = tracking.run(epochs)
    assert end.estimate is not None
    return end.estimate


def tracked(
    name: str, assumed: Assumptions, until_s: float = math.inf
) -> tuple[TrackingFigures, float]:
    """The figures of the room, and the 1-sigma of the position that the track claimed, m, RMS."""
    receivers = read_receivers(ROOM / "receivers.csv")
    epochs = read_epochs(ROOM / "measurements.csv", receivers, assumed.sigma_m)
    history = TrackHistory(assumed.dof, read_truth(ROOM / "truth.csv"))
    tracking = DataSetTracking(name, assumed, receivers)
    some = (epoch for epoch in epochs if epoch.epoch_s <= until_s)
    for step in tracking.run(some):
        history.add(step)
    sigma = history.series().sigma
    return history.figures(tracking.counts, 1.0), float(np.sqrt(np.mean(sigma**2)))


def snapshot_sigma_m() -> float:
    """Position 1-sigma of all eight arrivals at one time in the middle of the room.

    Each with the coloured error, which averaging over less than its correlation time leaves,
    and the white one, which it does not.
    """
    receivers = read_receivers(ROOM / "receivers.csv")
    at = np.stack([trajectory.positions[0] for trajectory in receivers.trajectories])
    sight = np.array([3.5, 4.0, 1.0]) - at
    H = sight / np.linalg.norm(sight, axis=1)[:, None]
    H = H - H.mean(0)  # of the differences: the common time of emission is unknown
    variance = 0.5 * (COLOUR_M**2 + SIGMA_M**2)
    return math.sqrt(float(np.trace(np.linalg.inv(H.T @ H))) * variance)


@pytest.mark.slow
def test_a_room_with_echoes_is_tracked_from_the_floor_and_honestly() -> None:
    """Defaults, no prior; 15 % of the rows are up to 150 m off, the rest correlated.

    12 s have some ``12 / (2 tau)`` independent errors. Their mean NEES is chi-squared with 3
    degrees of freedom each, and their mean squared error, mostly of the height, with 1: bounds
    met by 999 of 1000 seeds.
    """
    found, claimed_m = tracked("tracker", Assumptions(), until_s=12.0)
    independent = round(12.0 / (2.0 * TAU_S))
    low, high = (chi2.ppf(p, 3 * independent) / independent for p in (0.001, 0.999))
    assert isinstance(found.rmse_m, float)
    assert isinstance(found.mean_nees, float)
    assert low < found.mean_nees < high
    assert claimed_m < snapshot_sigma_m()
    assert found.rmse_m < claimed_m * math.sqrt(chi2.ppf(0.999, independent) / independent)
    assert found.share_lost == 0.0
    assert found.restarts == 0
    assert found.first_estimate_s is not None
    assert found.first_estimate_s < 2.0
    # 2400 rows: the share of outliers, less those too small to tell, and one row in 10^4.
    rejected = found.share_rejected
    assert rejected is not None
    spread = 3.3 * math.sqrt(0.15 * 0.85 / 2400.0)
    assert 0.15 * (1.0 - 6.0 * math.hypot(SIGMA_M, COLOUR_M) / 150.0) - spread < rejected
    assert rejected < 0.15 + spread


def test_who_takes_the_errors_for_white_believes_too_much() -> None:
    """The same EKF from the true start: mean NEES beyond what chance allows by far."""
    start = Assumptions(at=(3.5, 4.0, 0.1), within_m=0.5, sigma_m=math.hypot(SIGMA_M, COLOUR_M))
    found, _ = tracked("ekf", start, until_s=8.0)
    assert isinstance(found.mean_nees, float)
    assert found.mean_nees > chi2.ppf(0.999, 3 * 8) / 8


@pytest.mark.slow
def test_a_hard_room_is_tracked_and_a_receiver_that_is_blocked_is_named(tmp_path: Path) -> None:
    """Errors by direction, counted among the correlated ones, and one receiver 1.5 m too far.

    Before that, 6 s have some 6 independent errors, mostly of the height.
    """
    bias_m, blocked = 0.2, 5
    write(simulate(1, 9.0, bias_m=bias_m, blocked=(blocked, 6.0, 9.0)), tmp_path)
    told = Assumptions(colour_m=math.hypot(COLOUR_M, bias_m))
    receivers = read_receivers(tmp_path / "receivers.csv")
    epochs = read_epochs(tmp_path / "measurements.csv", receivers, told.sigma_m)
    history, named = TrackHistory(3, read_truth(tmp_path / "truth.csv")), []
    tracking = DataSetTracking("tracker", told, receivers)
    for step in tracking.run(epochs):
        named.append((step.epoch_s, step.verdict.receivers))
        if step.epoch_s < 6.0:
            history.add(step)
    series = history.series()
    claimed, rmse = (np.sqrt(np.mean(x**2)) for x in (series.sigma, series.error))
    assert rmse < claimed * math.sqrt(chi2.ppf(0.999, 6) / 6)
    assert series.nees.mean() < chi2.ppf(0.999, 3 * 6) / 6
    assert tracking.counts.restarts == 0
    assert {who for t, who in named if t < 6.0} == {()}
    assert named[-1][1] == (blocked,)
    assert {who for t, who in named} == {(), (blocked,)}


# --- Outliers and what is worse, in the same room ------------------------------------------

RING = [(j, (j + 1) % 8) for j in range(8)]


def ring(
    seed: int, emitters: list[Array], outliers: float
) -> tuple[ReceiverPositions, list[Epoch]]:
    """All neighbouring pairs at 20 Hz, a share of the rows far off, each by itself."""
    rng = np.random.default_rng(seed)
    receivers = read_receivers(ROOM / "receivers.csv")
    at = np.stack([trajectory.positions[0] for trajectory in receivers.trajectories])
    epochs = []
    for k, emitter in enumerate(emitters):
        distance = np.linalg.norm(emitter - at, axis=1)
        rd = np.array([distance[j] - distance[i] for i, j in RING])
        rd += SIGMA_M * rng.standard_normal(8)
        rd += np.where(rng.random(8) < outliers, rng.uniform(5.0, 150.0, 8), 0.0)
        rows = [Measurement(i, j, float(x), SIGMA_M) for (i, j), x in zip(RING, rd, strict=True)]
        epochs.append(Epoch(0.05 * k, tuple(rows)))
    return receivers, epochs


def test_rows_that_stand_by_themselves_are_rejected_by_themselves() -> None:
    """By receiver, one wrong row in eight takes two good ones with it."""
    receivers, epochs = ring(0, [np.array([3.0, 4.0, 1.0])] * 100, 0.15)
    tracking = DataSetTracking("tracker", Assumptions(rho=0.0, colour_m=0.0), receivers)
    end = last(tracking, epochs)
    # 800 rows; by chance 6e-5 of the good ones.
    assert tracking.counts.rows.aside / 800 == pytest.approx(
        0.15, abs=3.3 * math.sqrt(0.15 * 0.85 / 800)
    )
    assert tracking.counts.restarts == 0
    error = end.x[:3] - np.array([3.0, 4.0, 1.0])
    assert nees(error, end.P[:3, :3]) < chi2.ppf(0.999, 3)


def test_a_track_that_is_elsewhere_is_begun_again() -> None:
    here, there = np.array([1.5, 1.5, 0.5]), np.array([6.0, 7.0, 2.5])
    receivers, epochs = ring(0, [here] * 80 + [there] * 160, 0.0)
    calm = Assumptions(rho=0.0, colour_m=0.0, process_noise=1e-3, speed_mps=0.1)
    tracking = DataSetTracking("tracker", calm, receivers)
    steps = list(tracking.run(epochs))
    assert tracking.counts.restarts == 1
    assert [step.verdict.status for step in steps].count("diverged") == 1
    for step, true in ((steps[79], here), (steps[-1], there)):
        assert step.estimate is not None
        assert nees(step.estimate.x[:3] - true, step.estimate.P[:3, :3]) < chi2.ppf(0.999, 3)


@pytest.mark.slow
def test_a_data_set_that_lies_is_called_so_in_words() -> None:
    """From the middle on one receiver's rows are those of another, or the last ones again."""
    receivers, epochs = ring(1, [np.array([3.0, 4.0, 1.0])] * 200, 0.0)
    assumed = Assumptions(rho=0.0, colour_m=0.0)
    for lie, cause, says, of in (
        (hung, "repeated", "The same values come again and again", ()),
        (swapped, "rejected", "of the measurements contradict the track, mostly those", (0, 5)),
    ):
        told = [lie(epochs[100], epoch) if k > 100 else epoch for k, epoch in enumerate(epochs)]
        history = TrackHistory(3, None)
        tracking = DataSetTracking("tracker", assumed, receivers)
        verdicts = []
        for step in tracking.run(told):
            history.add(step)
            verdicts.append(step.verdict)
        assert next(v.receivers for v in verdicts if v.cause == cause) == of
        (finding,) = (f for f in history.findings(receivers.names) if f.cause == cause)
        assert says in finding.sentence
        assert 5.0 < finding.first_s < 10.0
        assert (tracking.counts.rows.repeated > 300) == (cause == "repeated")


def hung(before: Epoch, epoch: Epoch) -> Epoch:
    return Epoch(epoch.epoch_s, before.measurements)


def swapped(before: Epoch, epoch: Epoch) -> Epoch:
    """The ids of two receivers."""
    other = {0: 5, 5: 0}
    return Epoch(
        epoch.epoch_s,
        tuple(
            Measurement(other.get(m.first, m.first), other.get(m.second, m.second), m.rd_m, 0.1)
            for m in epoch.measurements
        ),
    )


def test_one_time_may_bear_rows_of_several_signals() -> None:
    """Of a coarse clock: pairs that close a loop, each row with a noise of its own."""
    rng = np.random.default_rng(3)
    receivers = read_receivers(ROOM / "receivers.csv")
    at = np.stack([trajectory.positions[0] for trajectory in receivers.trajectories])
    true = np.array([3.0, 4.0, 1.0])
    distance = np.linalg.norm(true - at, axis=1)
    epochs = []
    for k in range(200):
        a, b, c, e = rng.permutation(8)[:4]
        pairs = [(a, b), (b, c), (c, a), (c, e), (e, a)]
        noise = SIGMA_M * rng.standard_normal(5)
        rows = [
            Measurement(int(i), int(j), float(distance[j] - distance[i] + off), SIGMA_M)
            for (i, j), off in zip(pairs, noise, strict=True)
        ]
        epochs.append(Epoch(0.05 * k, tuple(rows)))
    tracking = DataSetTracking("tracker", Assumptions(colour_m=0.0), receivers)
    steps = list(tracking.run(epochs))
    counts = tracking.counts.rows
    assert len(steps) == 200
    assert {step.verdict.status for step in steps} == {"initialising", "tracking"}
    # Beyond three sigmas by chance: 1000 rows, 999 of 1000 seeds.
    assert counts.used + counts.aside == 1000
    assert counts.aside <= binom.ppf(0.999, 1000, 2.0 * norm.sf(3.0))
    # The mean square of some 900 whitened innovations of the last steps' three seconds.
    assert steps[-1].verdict.nis < chi2.ppf(0.999, 300) / 300
    end = steps[-1].estimate
    assert end is not None
    assert nees(end.x[:3] - true, end.P[:3, :3]) < chi2.ppf(0.999, 3)


@pytest.mark.slow
def test_all_differences_of_one_signal_tell_no_more_than_its_arrivals() -> None:
    """Every pair, of which all but a star are redundant: as sure as the star alone."""
    rng = np.random.default_rng(4)
    receivers = read_receivers(ROOM / "receivers.csv")
    at = np.stack([trajectory.positions[0] for trajectory in receivers.trajectories])
    distance = np.linalg.norm(np.array([3.0, 4.0, 1.0]) - at, axis=1)
    every, star = [], []
    for k in range(40):
        arrival = distance + SIGMA_M / math.sqrt(2.0) * rng.standard_normal(8)
        rows = [
            Measurement(i, j, float(arrival[j] - arrival[i]), SIGMA_M)
            for i in range(8)
            for j in range(i + 1, 8)
        ]
        every.append(Epoch(0.05 * k, tuple(rows)))
        star.append(Epoch(0.05 * k, tuple(rows[:7])))
    sigmas = []
    for epochs in (every, star):
        assumed = Assumptions(colour_m=0.0)
        end = last(DataSetTracking("tracker", assumed, receivers), epochs)
        sigmas.append(math.sqrt(float(np.trace(end.P[:3, :3]))))
    assert sigmas[0] == pytest.approx(sigmas[1], rel=0.02)


# --- Receivers that move -----------------------------------------------------------------

EMITTER = np.array([1800.0, 900.0, 40.0])


TIMES = np.arange(0.0, 41.0)


def flown(begin: tuple[float, float], phase: float) -> Trajectory:
    """Eastwards at 20 m/s, weaving."""
    north = begin[1] + 60.0 * np.sin(0.2 * TIMES + phase)
    return Trajectory(
        TIMES, np.column_stack([begin[0] + 20.0 * TIMES, north, np.full(TIMES.size, 120.0)])
    )


def flight(seed: int) -> tuple[ReceiverPositions, list[Epoch]]:
    """Four UAVs that fly past, recorded once a second; a star of pairs ten times a second."""
    rng = np.random.default_rng(seed)
    begins = [(0.0, 0.0), (0.0, 300.0), (0.0, -300.0), (-200.0, 50.0)]
    paths = tuple(flown(begin, float(k)) for k, begin in enumerate(begins))
    epochs = []
    for t in np.arange(0.0, 40.0, 0.1).tolist():
        at = np.column_stack(
            [[np.interp(t, TIMES, axis) for axis in path.positions.T] for path in paths]
        ).T
        arrival = np.linalg.norm(EMITTER - at, axis=1)
        arrival = arrival + 0.5 / math.sqrt(2.0) * rng.standard_normal(4)
        rows = tuple(Measurement(0, j, float(arrival[j] - arrival[0]), 0.5) for j in (1, 2, 3))
        epochs.append(Epoch(t, rows))
    return ReceiverPositions(("a", "b", "c", "d"), paths), epochs


SWARM = Assumptions(
    colour_m=0.0, process_noise=0.0, speed_mps=1.0, height_m=40.0, at=(1000.0, 0.0, 0.0),
    within_m=4000.0,
)  # fmt: skip


def test_receivers_that_move_find_an_emitter_of_known_height() -> None:
    forms, errors = [], []
    for seed in range(4):
        receivers, epochs = flight(seed)
        end = last(DataSetTracking("tracker", SWARM, receivers), epochs)
        assert end.x[2] == pytest.approx(EMITTER[2], abs=0.1)
        error = end.x[:2] - EMITTER[:2]
        forms.append(float(nees(error, end.P[:2, :2])))
        errors.append(float(np.trace(end.P[:2, :2])))
    assert chi2.ppf(0.001, 8) < sum(forms) < chi2.ppf(0.999, 8)
    assert max(errors) < 5.0**2


def test_rows_of_a_receiver_whose_position_ends_are_left_out_and_counted() -> None:
    receivers, epochs = flight(0)
    short = Trajectory(TIMES[:21], receivers.trajectories[3].positions[:21])
    shorter = ReceiverPositions(receivers.names, (*receivers.trajectories[:3], short))
    tracking = DataSetTracking("tracker", SWARM, shorter)
    end = last(tracking, epochs)
    assert tracking.counts.unplaced == 199  # one row in each of the epochs after 20 s
    assert tracking.counts.epochs == 400
    error = end.x[:2] - EMITTER[:2]
    assert nees(error, end.P[:2, :2]) < chi2.ppf(0.999, 2)


# --- What is assumed ---------------------------------------------------------------------


def test_the_prior_is_amid_the_receivers_unless_it_is_given() -> None:
    corners = np.array([[0.0, 0.0, 1.0], [6.0, 8.0, 1.0]])
    free = prior_of(Assumptions(), corners)
    assert free.mean[:3] == pytest.approx([3.0, 4.0, 1.0])
    assert free.covariance[0, 0] == pytest.approx(10.0**2)
    given = prior_of(Assumptions(at=(1.0, 2.0, 3.0), within_m=1.96, height_m=5.0), corners)
    assert given.mean[:3] == pytest.approx([1.0, 2.0, 5.0])
    assert given.covariance[0, 0] == pytest.approx(1.0)
    assert given.covariance[2, 2] < 1e-3


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"sigma_m": 0.0}, "sigma_m must be above 0"),
        ({"tau_s": math.nan}, "tau_s must be above 0"),
        ({"within_m": -1.0}, "within_m must be above 0"),
        ({"colour_m": -0.1}, "colour_m must be 0 or above"),
        ({"process_noise": math.inf}, "process_noise must be 0 or above"),
        ({"rho": 0.6}, "rho must be from 0 to 0.5"),
        ({"height_m": math.nan}, "height_m must be a finite number"),
        ({"clock_drift_mps": 0.1}, "clock_bias_m must be above 0"),
    ],
)
def test_settings_that_cannot_be_are_refused(wrong: dict[str, float], sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        Assumptions(**wrong)  # type: ignore[arg-type]
