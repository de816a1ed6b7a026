"""What a live step of the tracker costs, with everything modelled and with white noise only.

A swarm on a ring of 285 m flies past an emitter 2.5 km away, in three dimensions, 10 epochs a
second; clocks, navigation, coloured errors, one RD in ten an echo, and an emitter that may
manoeuvre. In each round every contestant flies the same second of it, in an order that rotates,
and is timed in processor time: a shared machine changes its speed, but seldom within a round. So
the ratios to one update of an iterated EKF say more than the milliseconds. Steps are not alike:
twice a second the window is solved anew, and the greatest say what that costs.

    python -m tests.benchmarks.bench_tracker [--seconds 40] [--json]
"""

from __future__ import annotations

import argparse
import gc
import json
import math
import statistics
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from swarmctl.estimation.filters import FILTERS
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.range_difference import range_differences
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.estimation.model.rows import Rows, star
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.estimation.track.manoeuvre import Manoeuvre
from swarmctl.study import ekf_update as ekf
from swarmctl.units import Array

PERIOD_S = 0.1
ROUND = 10
"""Epochs of a round: two blocks of the window."""
NOISE_M = 0.5
ECHOES = 0.1
EVERYTHING = ReceiverErrors(9.0, 0.3, 1.5, 60.0, 0.35, 0.5)
TARGET_MS = {3: 1.0, 12: 4.0}
"""What a step with everything modelled is held to, by number of companions."""
PRIOR = Prior(np.zeros(6), np.diag([2000.0, 2000.0, 10.0, 5.0, 5.0, 0.1]) ** 2)
PSD = np.array([1e-2, 1e-2, 1e-6])


class Contestant(NamedTuple):
    """Something that takes one epoch after the other."""

    name: str
    companions: int
    take: Callable[[Rows], object]


def feed(companions: int, seconds: int) -> list[Rows]:
    """What is heard of the flight, clocks and navigation errors included."""
    rng = np.random.default_rng(0)
    angle = 2.0 * math.pi * np.arange(companions) / companions
    ring = [285.0 * np.cos(angle), 285.0 * np.sin(angle), 15.0 * np.cos(3.0 * angle)]
    reference = np.array([-2500.0, 0.0, 60.0])
    velocity = np.array([10.0, 10.0, 0.0])
    slots = np.stack(ring, axis=-1)
    bias = EVERYTHING.bias_m * rng.standard_normal(companions + 1)
    drift = EVERYTHING.drift_mps * rng.standard_normal(companions + 1)
    navigation = EVERYTHING.navigation_m * rng.standard_normal((companions + 1, 3))
    C = 0.5 * NOISE_M**2 * (np.eye(companions) + 1.0)
    root = np.linalg.cholesky(C)
    epochs = []
    for k in range(round(seconds / PERIOD_S)):
        t = PERIOD_S * k
        at = np.vstack([reference, reference + slots]) + t * velocity
        rd = range_differences(np.zeros(3), at[0], at[1:])
        rd = rd + (bias + drift * t)[1:] - (bias + drift * t)[0]
        rd = rd + root @ rng.standard_normal(companions)
        is_echo = rng.random(companions) < ECHOES
        rd = rd + np.where(is_echo, rng.uniform(50.0, 300.0, companions), 0.0)
        told = at + navigation
        epochs.append(star(t, 0, told[0], list(range(1, companions + 1)), told[1:], rd, C))
    return epochs


def tracker(name: str, companions: int, errors: ReceiverErrors, *, manoeuvring: bool) -> Contestant:
    """The live tracker."""
    manoeuvre = Manoeuvre(20.0) if manoeuvring else None
    track = FILTERS.track("tracker", PRIOR, Behaviour(PSD.tolist(), errors, manoeuvre))
    return Contestant(name, companions, track.update)


def iterated_ekf(companions: int) -> Contestant:
    """One update from the same prior at every epoch: the unit."""

    def take(rows: Rows) -> tuple[Array, Array]:
        return ekf.update(
            PRIOR.mean, PRIOR.covariance, rows.first_at[0], rows.second_at, rows.rd, rows.covariance
        )

    return Contestant("one update of an iterated EKF", companions, take)


def timed(contestants: list[Contestant], epochs: list[Rows]) -> dict[str, list[float]]:
    """Processor time of every step, s, by name."""
    steps: dict[str, list[float]] = {contestant.name: [] for contestant in contestants}
    gc.collect()
    gc.disable()
    try:
        for turn, begin in enumerate(range(0, len(epochs), ROUND)):
            first = turn % len(contestants)
            for contestant in contestants[first:] + contestants[:first]:
                for rows in epochs[begin : begin + ROUND]:
                    start = time.process_time()
                    contestant.take(rows)
                    steps[contestant.name].append(time.process_time() - start)
    finally:
        gc.enable()
    return steps


def main() -> None:
    """Fly, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=int, default=40, help="length of the flight")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    if arguments.seconds < 5:
        parser.error("--seconds must be at least 5")
    table = []
    for companions, target_ms in TARGET_MS.items():
        unit = iterated_ekf(companions)
        everything = tracker("everything modelled", companions, EVERYTHING, manoeuvring=True)
        steady = tracker("no manoeuvre", companions, EVERYTHING, manoeuvring=False)
        white = tracker("white noise only", companions, ReceiverErrors(), manoeuvring=False)
        contestants = [everything, steady, white, unit]
        steps = timed(contestants, feed(companions, arguments.seconds))
        rounds = range(0, len(steps[unit.name]), ROUND)
        for name in steps:
            ms = 1e3 * np.array(steps[name])
            ratios = [
                sum(steps[name][k : k + ROUND]) / sum(steps[unit.name][k : k + ROUND])
                for k in rounds
            ]
            table.append(
                {
                    "companions": companions,
                    "name": name,
                    "mean_ms": float(ms.mean()),
                    "median_ms": float(np.median(ms)),
                    "p99_ms": float(np.percentile(ms, 99.0)),
                    "of_ekf_update": statistics.median(ratios),
                    "target_ms": target_ms if name == everything.name else None,
                }
            )
    if arguments.json:
        print(json.dumps(table, indent=2))
        return
    print(f"{'a live step, 3-D':<34}{'mean':>8}{'median':>8}{'99 %':>8} ms {'x EKF':>6}  target")
    for row in table:
        label = f"N = {row['companions']}, {row['name']}"
        times = "".join(f"{row[key]:>8.2f}" for key in ("mean_ms", "median_ms", "p99_ms"))
        goal = f"< {row['target_ms']:g} ms" if row["target_ms"] else ""
        print(f"{label:<34}{times}    {row['of_ekf_update']:>6.1f}  {goal}")


if __name__ == "__main__":
    main()
