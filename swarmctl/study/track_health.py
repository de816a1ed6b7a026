"""Does the track say so when its model is wrong, and only then?

Every run flies Table 1's engagement at 10 Hz from Table 1's P0. At :data:`FROM_S` the feed
becomes something else than the track was told; from then on its health should say so. An alarm
before, or in a feed that stays good, is a false alarm.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swarmctl.errors import UsageError
from swarmctl.estimation.filters import FILTERS
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.rows import star
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.study.engagement import Engagement, fly
from swarmctl.study.executors import in_order
from swarmctl.study.receivers import Reception, SimulatedReceivers
from swarmctl.study.registry import PERPENDICULAR
from swarmctl.study.starts import DrawnEstimate, fixed_frame
from swarmctl.study.tally import Interval, poisson_rate, share
from swarmctl.study.track_cases import MANOEUVRE
from swarmctl.units import Array

CHUNK = 20
"""Runs flown by a worker at once."""
PERIOD_S = 0.1
"""Time between two measurements, s."""
FROM_S = 4.0
"""When a feed goes wrong, s."""
UNTIL_S = 12.0
"""How long each run lasts, s."""
WITHIN_S = 5.0
"""Time after the fault within which the health must name it, s."""
MAX_FALSE_ALARMS_PER_HOUR = 1.0
"""False alarms an hour of good data, at most."""


GOOD = "none"
FAULTS = (
    GOOD,
    "noise doubled",
    "errors of 2 m for 0.5 s",
    "a clock jumps by 100 ns",
    "a clock drifts by 10 ns/s",
    "the reference's clock jumps by 100 ns",
    "a position is 42 m off",
    "two receivers are swapped",
    "the feed is constant",
)
"""What goes wrong; the model that the track is told has none of it."""


class _Fault:
    """A fault and its memory, in some runs."""

    def __init__(self, name: str, rng: np.random.Generator) -> None:
        self._name = name
        self._rng = rng
        self._coloured: Array | None = None
        self._first_rd: Array | None = None

    def spoil(self, since_s: float, positions: Array, rd: Array) -> tuple[Array, Array]:
        """Positions and RDs that are reported instead, every :data:`PERIOD_S`.

        Args:
            since_s: Time since the fault began, s.
            positions: Reported positions, the reference UAV's first, (runs, 4, 2), m.
            rd: Range differences, (runs, 3), m.
        """
        one = np.array([1.0, 0.0, 0.0])
        match self._name:
            case "noise doubled":
                more = math.sqrt(3.0 * SimulatedReceivers().white_covariance(3)[0, 0])
                rd = rd + more * self._rng.standard_normal(rd.shape)
            case "errors of 2 m for 0.5 s":
                fresh = 2.0 * self._rng.standard_normal(rd.shape)
                keep = math.exp(-PERIOD_S / 0.5)
                self._coloured = (
                    fresh
                    if self._coloured is None
                    else keep * self._coloured + math.sqrt(1.0 - keep * keep) * fresh
                )
                rd = rd + self._coloured
            case "a clock jumps by 100 ns":
                rd = rd + 30.0 * one
            case "a clock drifts by 10 ns/s":
                rd = rd + 3.0 * since_s * one
            case "the reference's clock jumps by 100 ns":
                rd = rd - 30.0
            case "a position is 42 m off":
                positions = positions.copy()
                positions[:, 1] += 30.0
            case "two receivers are swapped":
                rd = rd[:, [1, 0, 2]]
            case "the feed is constant":
                self._first_rd = rd if self._first_rd is None else self._first_rd
                rd = self._first_rd
        return positions, rd


@dataclass(frozen=True)
class HealthRow:
    """What the health said of one fault.

    Attributes:
        fault: The fault's name.
        runs: Runs flown.
        named: Share of runs with an alarm within :data:`WITHIN_S`; None without a fault.
        latest_s: Longest time to the alarm, in the runs that had one; NaN if none had.
        causes: Causes named first, each with the number of runs.
        false_alarms: False alarms in an hour of good data: before the fault, or all of it.
        hours: Hours of good data.
        shortfalls: What is out of tolerance, as sentences.
    """

    fault: str
    runs: int
    named: Interval | None
    latest_s: float
    causes: dict[str, int]
    false_alarms: Interval
    hours: float
    shortfalls: tuple[str, ...]


class _Said(NamedTuple):
    """What the health said in one run."""

    false_alarms: int
    after_s: float  # NaN for never
    cause: str | None


def run_track_health(
    *,
    runs: int,
    seed: int = 0,
    faults: Sequence[str] = FAULTS,
    executor: Executor | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[HealthRow]:
    """Fly every fault.

    Args:
        runs: Runs of each fault.
        seed: The seed of all draws.
        faults: Names in :data:`FAULTS`.
        executor: Where the runs are flown; None for this process.
        on_progress: Is told how many runs are done, and of how many.

    Raises:
        UsageError: Runs below 1.
        EstimationError: The track failed.
    """
    if runs < 1:
        raise UsageError(f"A study of health needs at least 1 run, not {runs}.")
    sizes = [min(CHUNK, runs - done) for done in range(0, runs, CHUNK)]
    work = [(name, seed, chunk, size) for name in faults for chunk, size in enumerate(sizes)]
    said: dict[str, list[_Said]] = {name: [] for name in faults}
    done = 0
    for item, result in zip(work, in_order(executor, _fly, work), strict=True):
        said[item[0]] += result
        done += item[-1]
        on_progress(done, runs * len(faults))
    return [_row(name, result) for name, result in said.items()]


def cost_s(faults: Sequence[str]) -> float:
    """About how long one run of each fault takes on one core, s."""
    return 0.07 * len(faults)


def _fly(work: tuple[str, int, int, int]) -> list[_Said]:
    """Fly one chunk of a fault."""
    name, seed, chunk, runs = work
    of_start, of_noise, of_echoes, of_fault = (
        np.random.default_rng(sequence)
        for sequence in np.random.SeedSequence(seed, spawn_key=(chunk,)).spawn(4)
    )
    engagement = Engagement(period_s=PERIOD_S, duration_s=UNTIL_S)
    draw = DrawnEstimate().draw(engagement, of_start, runs)
    formation = np.array(PERPENDICULAR)
    receivers = SimulatedReceivers()
    reception = Reception(receivers, runs, len(formation), of_noise, of_echoes)
    fault = _Fault(name, of_fault)
    epochs = []
    moments = fly(engagement, formation, draw.emitter)
    for time_s, moment in zip(engagement.epochs_s.tolist(), moments, strict=True):
        heard = reception.hear(time_s, moment)
        positions, rd = heard.positions, heard.rd
        if time_s >= FROM_S:
            positions, rd = fault.spoil(time_s - FROM_S, positions, rd)
        epochs.append((time_s, positions, rd))
    means, covariance = fixed_frame(draw.prior)
    C = receivers.white_covariance(len(formation))
    return [
        _listen(Prior(mean, covariance), [(t, at[r], rd[r]) for t, at, rd in epochs], C, name)
        for r, mean in enumerate(means)
    ]


def _listen(
    prior: Prior, epochs: Sequence[tuple[float, Array, Array]], C: Array, fault: str
) -> _Said:
    """Fly one run, and note what the health says."""
    track = FILTERS.track("tracker", prior, Behaviour((0.01, 0.01), manoeuvre=MANOEUVRE))
    good_until_s = UNTIL_S + 1.0 if fault == GOOD else FROM_S
    false_alarms, was_well = 0, True
    for time_s, positions, rd in epochs:
        ids = list(range(1, len(rd) + 1))
        track.update(star(time_s, 0, positions[0], ids, positions[1:], rd, C))
        well = track.verdict.status in {"initialising", "tracking"}
        if time_s < good_until_s:
            false_alarms, was_well = false_alarms + (was_well and not well), well
        elif not well:
            return _Said(false_alarms, time_s - FROM_S, track.verdict.cause)
    return _Said(false_alarms, math.nan, None)


def _row(fault: str, said: Sequence[_Said]) -> HealthRow:
    runs, good = len(said), fault == GOOD
    hours = runs * (UNTIL_S if good else FROM_S) / 3600.0
    alarms = poisson_rate(sum(one.false_alarms for one in said), hours)
    after_s = np.array([one.after_s for one in said])
    named = None if good else share(int((after_s <= WITHIN_S + 1e-6).sum()), runs)
    shortfalls = []
    if alarms.low > MAX_FALSE_ALARMS_PER_HOUR:
        shortfalls.append(f"{fault}: at least {alarms.low:.2f} false alarms an hour, above 1")
    if named is not None and named.high < 1.0:
        shortfalls.append(
            f"{fault}: named within {WITHIN_S:g} s in {named.value:.1%} of the runs, not in all"
        )
    latest_s = math.nan if np.isnan(after_s).all() else float(np.nanmax(after_s))
    causes = dict(Counter(one.cause for one in said if one.cause is not None).most_common())
    return HealthRow(fault, runs, named, latest_s, causes, alarms, hours, tuple(shortfalls))
