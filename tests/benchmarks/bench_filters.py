"""What one step (predict + update) of each filter costs, beside filterpy's and Stone Soup's.

Everyone filters the same draws of the whole Table 1 engagement, ours live (one trial at a time,
as on board) and in a batch of trials (as in a Monte Carlo), the others one trial at a time, the
only way they have. The flight is cut into rounds and in each round every contestant flies the
same stretch, in an order that rotates: the speed of a shared machine changes by a factor of
two, but seldom within one round. So the ratios say more than the microseconds.

The other packages' EKFs must be where ours is, to 1e-6 of its sigma at the end of each round,
or there is no table: a wrong filter's speed is worth nothing. A package that is not installed
is left out (``pip install stonesoup``).

    python -m tests.benchmarks.bench_filters [--rounds 40] [--json]
"""

from __future__ import annotations

import argparse
import gc
import json
import statistics
import time
from typing import NamedTuple

import numpy as np

from swarmctl.estimation.feed.measurement_queue import MeasurementQueue
from swarmctl.estimation.filters import FILTERS
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.estimation.track.track import Track
from swarmctl.study import filters
from swarmctl.study.batch_filter import BatchFilter
from swarmctl.study.engagement import Engagement
from swarmctl.units import Vector
from tests.benchmarks.contestants import (
    BATCH,
    FORMATION,
    HEIGHTS,
    SINGLES,
    Answer,
    Contestant,
    Flight,
    draw,
    one_at_a_time,
    one_of,
)
from tests.benchmarks.foreign_filters import filterpy_ekf, stone_soup

FIRST_EPOCH_S = 1.7e9

TOLERANCE = 1e-6
"""Between two EKFs on the same draws, at the end of any round, in sigmas."""

LIVE_STEP = "live: consistent NCRKF, 2-D"
BATCH_EKF = f"batch of {BATCH}: EKF, the paper's"
"""The rows the ratios refer to."""

Message = tuple[float, list[Vector], Vector, list[float]]
"""What the live feed hears of one epoch: when, positions, velocity, range differences."""

Live = tuple[MeasurementQueue, Track]


# --- Ours ------------------------------------------------------------------------------


def in_a_batch(name: str, which: BatchFilter, flight: Flight) -> Contestant:
    """All trials in one call a step."""
    belief = which.start(flight.prior)

    def fly_on(epochs: range) -> None:
        nonlocal belief
        for k in epochs:
            belief = which.step(belief, flight.scans[k])

    return Contestant(name, BATCH, fly_on, lambda: (belief.x, belief.P))


def live(name: str, which: BatchFilter, flight: Flight) -> Contestant:
    """A filter without leading axes."""
    beliefs = [which.start(flight.prior._replace(mean=mean)) for mean in flight.prior.mean]
    scans = [[one_of(scan, trial) for scan in flight.scans] for trial in range(SINGLES)]
    return one_at_a_time(name, beliefs[:SINGLES], scans, which.step, lambda b: (b.x, b.P))


def live_tracker(flight: Flight) -> Contestant:
    """The tracker of the running system: four positions and three range differences an epoch."""
    start = filters.ncrkf().start(flight.prior)
    horizontal, up = [0, 1, 3, 4], [2, 5]
    covariance = np.zeros((6, 6))
    covariance[np.ix_(horizontal, horizontal)] = start.P[0]
    covariance[up, up] = 1.0, 0.01
    means = np.zeros((SINGLES, 6))
    means[:, horizontal] = start.x[:SINGLES]
    tracks = [
        FILTERS.track("ncrkf", Prior(mean, covariance), Behaviour((0.0, 0.0, 0.0)))
        for mean in means
    ]
    sigma_p_m = flight.scans[0].sigma_p
    lives = [
        (MeasurementQueue(track, vehicles=range(len(HEIGHTS)), sigma_p_m=sigma_p_m), track)
        for track in tracks
    ]
    messages = [
        [_message(flight, k, trial) for k in range(len(flight.scans))] for trial in range(SINGLES)
    ]
    sigma = np.sqrt(np.diag(flight.scans[0].rd_covariance)).tolist()

    def step(live: Live, message: Message) -> Live:
        queue, _ = live
        epoch_s, places, velocity, rd = message
        for vehicle, place in enumerate(places):
            queue.add_position(vehicle, epoch_s, place, velocity)
        queue.add_range_differences(epoch_s, 0, (1, 2, 3), rd, sigma, 0.0)
        if len(queue.process()) != 1:
            raise SystemExit("The tracker did not use an epoch's measurements.")
        return live

    def read(live: Live) -> Answer:
        believed = live[1].latest()
        return believed.x, believed.P

    name = "live: queue and track, 3-D, positions and RDs in"
    return one_at_a_time(name, lives, messages, step, read)


def _message(flight: Flight, k: int, trial: int) -> Message:
    scan = one_of(flight.scans[k], trial)
    epoch_s = FIRST_EPOCH_S + k * Engagement().period_s
    horizontal = np.vstack([scan.reference, scan.companions]).tolist()
    places = [(east, north, up) for (east, north), up in zip(horizontal, HEIGHTS, strict=True)]
    v_east, v_north = scan.velocity.tolist()
    return epoch_s, places, (v_east, v_north, 0.0), flight.rd_3d[k, trial].tolist()


# --- The race --------------------------------------------------------------------------


class Lap(NamedTuple):
    """A contestant's round: time per step and trial (s), and what it believes at the end."""

    step_s: float
    answer: Answer


def race(contestants: list[Contestant], epochs: int, rounds: int) -> list[dict[str, Lap]]:
    """All contestants through the flight; their laps by name, round by round."""
    edges = np.linspace(0, epochs, rounds + 1).astype(int).tolist()
    laps = []
    gc.collect()
    gc.disable()  # or whoever happens to be flying clears away what the others left
    try:
        for turn in range(rounds):
            stretch = range(edges[turn], edges[turn + 1])
            first = turn % len(contestants)
            lap = {}
            for contestant in contestants[first:] + contestants[:first]:
                start = time.perf_counter()
                contestant.fly(stretch)
                elapsed = time.perf_counter() - start
                step_s = elapsed / (contestant.trials * len(stretch))
                lap[contestant.name] = Lap(step_s, contestant.answer())
            laps.append(lap)
    finally:
        gc.enable()
    return laps


def disagreement(found: Answer, expected: Answer) -> float:
    """Largest difference of a state or covariance from what it should be, in sigmas."""
    x, P = found
    x_expected, P_expected = (array[: len(x)] for array in expected)
    sigma = np.sqrt(np.linalg.diagonal(P_expected))
    of_x = np.abs(x - x_expected) / sigma
    of_P = np.abs(P - P_expected) / (sigma[:, :, None] * sigma[:, None, :])
    return float(max(of_x.max(), of_P.max()))


def line_up(flight: Flight) -> tuple[list[Contestant], list[Contestant], list[str]]:
    """Ours, theirs, and who is missing and why."""
    ours = [
        live(LIVE_STEP, filters.ncrkf(), flight),
        live("live: EKF, the paper's", filters.ekf(), flight),
        live_tracker(flight),
        in_a_batch(BATCH_EKF, filters.ekf(), flight),
        in_a_batch(f"batch of {BATCH}: OKF, the paper's", filters.okf(), flight),
        in_a_batch(f"batch of {BATCH}: NCRKF, the paper's", filters.ncrkf("paper"), flight),
        in_a_batch(f"batch of {BATCH}: iterated EKF", filters.iterated_ekf(), flight),
        in_a_batch(f"batch of {BATCH}: consistent NCRKF", filters.ncrkf(), flight),
    ]
    theirs, missing = [], []
    try:
        theirs.append(filterpy_ekf(flight))
    except ImportError as error:
        missing.append(f"filterpy is left out: {error}.")
    try:
        theirs.append(stone_soup("EKF", "ExtendedKalmanUpdater", flight))
        theirs.append(stone_soup("UKF", "UnscentedKalmanUpdater", flight))
    except ImportError as error:
        missing.append(f"Stone Soup is left out: {error}.")
    return ours, theirs, missing


def main() -> None:
    """Fly once, compare the answers, print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=40, help="stretches of the flight")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    flight = draw()
    epochs = len(flight.scans)
    if not 1 <= arguments.rounds <= epochs:
        parser.error(f"--rounds must be 1 to {epochs}")

    ours, theirs, notes = line_up(flight)
    laps = race(ours + theirs, epochs, arguments.rounds)
    apart = {
        name: max(disagreement(lap[name].answer, lap[BATCH_EKF].answer) for lap in laps)
        for name in (contestant.name for contestant in theirs)
    }
    for name, sigmas in apart.items():
        if name.endswith("EKF") and not sigmas < TOLERANCE:
            raise SystemExit(f"{name} is not the same filter: {sigmas:.1e} sigma from our EKF.")

    def median_of(name: str, base: str) -> float:
        return statistics.median(lap[name].step_s / lap[base].step_s for lap in laps)

    table = {
        contestant.name: {
            "us_per_step": 1e6 * statistics.median(lap[contestant.name].step_s for lap in laps),
            "of_batch_ekf": median_of(contestant.name, BATCH_EKF),
            "of_live_step": median_of(contestant.name, LIVE_STEP),
        }
        for contestant in ours + theirs
    }
    if arguments.json:
        print(json.dumps({"table": table, "sigmas_from_our_ekf": apart, "notes": notes}, indent=2))
        return
    print(f"{'per step and trial':<42}{'us':>9}{'x batch EKF':>13}{'x live NCRKF':>14}")
    for name, row in table.items():
        us, of_batch, of_live = row.values()
        print(f"{name:<42}{us:>9.2f}{of_batch:>13.2f}{of_live:>14.3f}")
    print(f"Medians of {arguments.rounds} rounds, {epochs} epochs in all; N = {len(FORMATION)}.")
    for name, sigmas in apart.items():
        print(f"{name}: never more than {sigmas:.1e} sigma from our EKF ({SINGLES} trials).")
    for note in notes:
        print(note)


if __name__ == "__main__":
    main()
