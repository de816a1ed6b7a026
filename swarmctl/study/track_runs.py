"""Chunks of runs with the live track, and with the filters beside it on the same draws.

A track is one object that is handed one epoch after the other, so its runs are flown one by one.
The filters of :mod:`~swarmctl.study.registry` are told that all errors are white with their full
sigma, for that is all they can be told.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.bounds.augmented_pcrb import AugmentedBound
from swarmctl.estimation.bounds.consistency import nees
from swarmctl.estimation.estimate import Estimate
from swarmctl.estimation.filters import FILTERS
from swarmctl.estimation.model.motion import ConstantVelocity
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.rows import star
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.study.batch_filter import BatchFilter
from swarmctl.study.campaign import Log
from swarmctl.study.engagement import Engagement, Moment, fly
from swarmctl.study.receivers import Heard, Reception, scan_of
from swarmctl.study.registry import D_MAX_M
from swarmctl.study.starts import Draw, fixed_frame
from swarmctl.study.tally import LOST_NEES, BoundTally, Tally
from swarmctl.study.track_cases import MANOEUVRE, TrackCase
from swarmctl.units import Array, Mask

JUDGED = "tracker"
"""The row that is held to a tolerance: the filter of a mission by default."""
WITHOUT_ECHOES = "tracker, no echoes"
_CARRIED = 0.01
"""A hypothesis of at least this probability is one that a user has been told of."""


class Tracked(NamedTuple):
    """Errors and claims of the track in some runs, at T times; the first axis is the runs.

    Attributes:
        error: Estimate less truth, position and velocity, (runs, T, 4); NaN without estimate.
        covariance: Claimed, (runs, T, 4, 4).
        resolved: Whether one hypothesis was left, (runs, T).
        silent: Whether no hypothesis worth the name was near the truth, (runs, T).
        first_s: When the first estimate came, (runs,); NaN for never.
        first_nees: Its position NEES, (runs,).
        aside: Share of the RDs set aside, (runs,).
        degraded: How often its health became degraded or diverged, (runs,).
    """

    error: Array
    covariance: Array
    resolved: Mask
    silent: Mask
    first_s: Array
    first_nees: Array
    aside: Array
    degraded: Array

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """The runs of several parts together."""
        return cls(*(np.concatenate(values) for values in zip(*parts, strict=True)))

    def tally(self) -> Tally:
        """Statistics at the T times."""
        return Tally.of(
            self.error.swapaxes(0, 1),
            np.linalg.diagonal(self.covariance).swapaxes(0, 1),
            self.covariance[..., 0, 1].T,
            np.zeros(self.error.shape[1]),
        )


class Chunk(NamedTuple):
    """Some runs of a case, flown by one worker.

    Attributes:
        case: The experiment.
        filters: The filters to fly beside the track, by name, made for the case's process noise.
        seed: The seed of all draws of the study.
        number: The chunk's number within the case, from 0; its draws depend on it.
        runs: How many.
    """

    case: TrackCase
    filters: Mapping[str, BatchFilter]
    seed: int
    number: int
    runs: int


class ChunkResult(NamedTuple):
    """Results of a chunk.

    Attributes:
        tracked: The track's, by row.
        tallies: The filters' at the case's times, by name.
        bound: Bound of the right model at these times.
    """

    tracked: dict[str, Tracked]
    tallies: dict[str, Tally]
    bound: BoundTally


def fly_chunk(chunk: Chunk) -> ChunkResult:
    """Fly one chunk of a case."""
    case, filters, seed, number, runs = chunk
    of_start, of_emitter, of_noise, of_echoes = (
        np.random.default_rng(sequence)
        for sequence in np.random.SeedSequence(seed, spawn_key=(number,)).spawn(4)
    )
    engagement = _scene(case)
    formation = np.array([(math.radians(angle), D_MAX_M) for angle in case.formation])
    draw = case.start.draw(engagement, of_start, runs)
    motion = ConstantVelocity(case.process_noise)
    moments = fly(
        engagement,
        formation,
        draw.emitter,
        motion if draw.disturbed else None,
        of_emitter,
        case.turn,
    )
    reception = Reception(case.receivers, runs, len(formation), of_noise, of_echoes)
    heard = []
    for time_s, moment in zip(engagement.epochs_s.tolist(), moments, strict=True):
        heard.append(reception.hear(time_s, moment, _companions(case, time_s)))

    at = [round(time_s / case.period_s) for time_s in case.times_s]
    logs = {
        name: Log(name, candidate, draw, runs, len(heard)) for name, candidate in filters.items()
    }
    for k, epoch in enumerate(heard):
        scan = scan_of(epoch, case.receivers)
        for log in logs.values():
            log.step(k, epoch.moment, scan)
    tracked = {JUDGED: _track(case, draw, heard, with_echoes=True)}
    if case.echo_ratio is not None:
        tracked[WITHOUT_ECHOES] = _track(case, draw, heard, with_echoes=False)
    # The same trajectory in all runs has one bound: the first chunk's.
    bound = BoundTally(0, np.zeros((len(at), 4)))
    if draw.emitter.ndim > 1:
        for run in range(runs):
            bound += _bound(case, draw, [_of_run(epoch.moment, run) for epoch in heard])
    elif number == 0:
        bound += _bound(case, draw, [epoch.moment for epoch in heard])
    return ChunkResult(tracked, {name: log.tally(at) for name, log in logs.items()}, bound)


def _scene(case: TrackCase) -> Engagement:
    scene = Engagement(period_s=case.period_s, duration_s=case.times_s[-1])
    return scene if case.speed_mps is None else replace(scene, speed_mps=case.speed_mps)


def _companions(case: TrackCase, time_s: float) -> int:
    """How many companions are heard."""
    if case.gap is not None and case.gap.from_s <= time_s < case.gap.until_s:
        return case.gap.left
    return len(case.formation)


def _of_run(moment: Moment, run: int) -> Moment:
    """One run of a moment of several."""
    return Moment(
        moment.dt,
        moment.emitter[run],
        moment.reference[run],
        moment.velocity[run],
        moment.companions[run],
    )


def _bound(case: TrackCase, draw: Draw, moments: Sequence[Moment]) -> BoundTally:
    """Bound along one trajectory, at the case's times."""
    bound = AugmentedBound(
        fixed_frame(draw.prior)[1], case.receivers.errors, np.array(case.process_noise)
    )
    variance = {}
    for k, moment in enumerate(moments):
        bound.predict(moment.dt)
        count = _companions(case, k * case.period_s)
        if count:
            rows = star(
                0.0,
                0,
                moment.reference,
                list(range(1, count + 1)),
                moment.companions[:count],
                np.zeros(count),
                case.receivers.white_covariance(count),
            )
            bound.update(moment.emitter[:2], rows)
        variance[k] = np.diag(bound.covariance)
    at = [round(time_s / case.period_s) for time_s in case.times_s]
    return BoundTally(1, np.stack([variance[k] for k in at]))


def _track(case: TrackCase, draw: Draw, heard: Sequence[Heard], *, with_echoes: bool) -> Tracked:
    """Fly the track through all runs of a chunk."""
    means, covariance = fixed_frame(draw.prior)
    return Tracked.joined(
        [
            _track_run(case, Prior(mean, covariance), heard, run, with_echoes=with_echoes)
            for run, mean in enumerate(means)
        ]
    )


def _track_run(
    case: TrackCase, prior: Prior, heard: Sequence[Heard], run: int, *, with_echoes: bool
) -> Tracked:
    """Fly the track through one run."""
    track = FILTERS.track(
        "tracker", prior, Behaviour(case.process_noise, case.receivers.errors, MANOEUVRE)
    )
    at = {round(time_s / case.period_s): i for i, time_s in enumerate(case.times_s)}
    error = np.full((len(at), 4), np.nan)
    claimed = np.full((len(at), 4, 4), np.nan)
    resolved, silent = np.zeros(len(at), np.bool_), np.zeros(len(at), np.bool_)
    first_s = first_nees = math.nan
    degraded, was_well = 0, True
    for k, epoch in enumerate(heard):
        truth = (
            epoch.moment.emitter if epoch.moment.emitter.ndim == 1 else epoch.moment.emitter[run]
        )
        count = epoch.companions
        if count:
            rd = epoch.rd[run] + (epoch.echo[run] if with_echoes else 0.0)
            try:
                track.update(
                    star(
                        epoch.time_s,
                        0,
                        epoch.positions[run, 0],
                        list(range(1, count + 1)),
                        epoch.positions[run, 1 : count + 1],
                        rd[:count],
                        case.receivers.white_covariance(count),
                        case.receivers.position_m,
                    )
                )
            except EstimationError:
                break  # lost from here on
        well = track.verdict.status in {"initialising", "tracking"}
        degraded, was_well = degraded + (was_well and not well), well
        if math.isnan(first_s) and (estimates := track.estimates()):
            first_s, first_nees = epoch.time_s, _position_nees(estimates[0], truth)
        if k in at and track.estimates():
            found = track.predict_to(epoch.time_s)
            error[at[k]], claimed[at[k]] = found.x - truth, found.P
            resolved[at[k]] = track.is_resolved
            # In a silence only the best hypothesis is known at this epoch.
            others = [e for e in track.estimates()[1:] if count and e.probability >= _CARRIED]
            silent[at[k]] = all(_position_nees(e, truth) > LOST_NEES for e in (found, *others))
    return Tracked(
        error[None],
        claimed[None],
        resolved[None],
        silent[None],
        np.array([first_s]),
        np.array([first_nees]),
        np.array([track.counts.aside / max(track.counts.aside + track.counts.used, 1)]),
        np.array([degraded]),
    )


def _position_nees(estimate: Estimate, truth: Array) -> float:
    return float(nees(estimate.x[:2] - truth[:2], estimate.P[:2, :2]))
