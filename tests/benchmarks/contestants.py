"""Who takes part in a benchmark of filters: the draws, and a filter under way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np

from swarmctl.estimation.model.range_difference import range_differences
from swarmctl.study.batch_filter import RelativePrior, Scan
from swarmctl.study.engagement import Engagement, fly, measure, prior_at, relative_state
from swarmctl.study.starts import table_1_covariance
from swarmctl.units import Array

BATCH = 200
SINGLES = 8
"""Trials of the batch, the first ones, that the one-at-a-time contestants fly."""

FORMATION = np.array([[-np.pi / 2.0, 300.0], [0.0, 300.0], [np.pi / 2.0, 300.0]])
HEIGHTS = (400.0, 450.0, 350.0, 500.0)
"""Of the reference UAV and its companions in the live tracker's 3-D flight, m."""

Answer = tuple[Array, Array]
"""Means (trials, n) and covariances (trials, n, n)."""

Belief = TypeVar("Belief")
Heard = TypeVar("Heard")


class Flight(NamedTuple):
    """The draws.

    Attributes:
        prior: Of every trial, with a mean of its own.
        scans: One per epoch, BATCH trials each.
        rd_3d: The same errors on the range differences at HEIGHTS, (epochs, BATCH, N), m.
    """

    prior: RelativePrior
    scans: list[Scan]
    rd_3d: Array


@dataclass
class Contestant:
    """A filter under way.

    Attributes:
        name: For the table.
        trials: Flown in parallel or in turn.
        fly: Takes all of them through the epochs of a range.
        answer: What it believes now, in coordinates of its own.
    """

    name: str
    trials: int
    fly: Callable[[range], None]
    answer: Callable[[], Answer]


def draw() -> Flight:
    """Truth, measurements and priors, before any clock runs."""
    rng = np.random.default_rng(1)
    P0 = table_1_covariance()
    engagement = Engagement()
    mean = relative_state(engagement, engagement.emitter)
    prior = prior_at(rng.multivariate_normal(mean, P0, BATCH), P0, engagement)
    scans, rd_3d = [], []
    for moment in fly(engagement, FORMATION, engagement.emitter):
        scan = measure(engagement, moment, rng, BATCH)
        scans.append(scan)
        emitter = np.append(moment.emitter[:2], 0.0)
        places = np.column_stack([np.vstack([moment.reference, moment.companions]), HEIGHTS])
        exact = range_differences(emitter, places[0], places[1:])
        rd_3d.append(exact + (scan.rd - scan.truth.rd))
    return Flight(prior, scans, np.array(rd_3d))


def one_of(scan: Scan, trial: int) -> Scan:
    """A scan of one trial, without a leading axis."""
    return scan._replace(
        reference=scan.reference[trial], companions=scan.companions[trial], rd=scan.rd[trial]
    )


def one_at_a_time(
    name: str,
    beliefs: list[Belief],
    heard: list[list[Heard]],
    step: Callable[[Belief, Heard], Belief],
    read: Callable[[Belief], Answer],
) -> Contestant:
    """Trial after trial through ``heard[trial][epoch]``, with ``step(belief, heard)`` each."""

    def fly_on(epochs: range) -> None:
        for trial, scans in enumerate(heard):
            belief = beliefs[trial]
            for k in epochs:
                belief = step(belief, scans[k])
            beliefs[trial] = belief

    def answer() -> Answer:
        means, covariances = zip(*map(read, beliefs), strict=True)
        return np.array(means), np.array(covariances)

    return Contestant(name, len(beliefs), fly_on, answer)
