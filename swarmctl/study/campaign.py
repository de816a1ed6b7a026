"""Fly every filter in every formation, on the same draws, and add the runs up as they come.

Runs are flown in chunks of :data:`CHUNK`. A chunk's draws depend on the seed and its number
only, and chunks are added up in their order, so the result is the same, bit for bit, whatever
executes them. Every filter meets the same noise, and so does every formation of as many
companions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field

import numpy as np

from swarmctl.errors import EstimationError, UsageError
from swarmctl.estimation.bounds.pcrb import CramerRaoBound
from swarmctl.estimation.model.motion import ConstantAcceleration, ConstantVelocity
from swarmctl.estimation.model.range_difference import effective_relative_covariance
from swarmctl.study.batch_filter import BatchFilter, Belief, Scan
from swarmctl.study.engagement import Engagement, Moment, fly, measure
from swarmctl.study.executors import in_order
from swarmctl.study.starts import CA, CV, JUMP, Draw, Start
from swarmctl.study.tally import BoundTally, Tally
from swarmctl.units import Array, Mask

CHUNK = 200
"""Runs flown at once: enough to make numpy quick, few enough for the processor's cache."""


@dataclass(frozen=True)
class Campaign:
    """A start, filters and formations to fly together.

    Attributes:
        start: How a run begins.
        filters: By name.
        formations: By name, (N, 2) of (angle rad, distance m).
        runs: How many, at least 2.
        seed: The seed of all draws.
        process_noise: Spectral density of the emitter's acceleration per axis, m²/s³. It drives
            the truth if the start disturbs it, and the constant-velocity bound.
        engagement: The scene.
        slow: Names of the filters that fly the first chunk only.
    """

    start: Start
    filters: Mapping[str, BatchFilter]
    formations: Mapping[str, Array]
    runs: int
    seed: int
    process_noise: tuple[float, float] = (0.0, 0.0)
    engagement: Engagement = field(default_factory=Engagement)
    slow: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if self.runs < 2:
            raise UsageError(f"A study needs at least 2 runs, not {self.runs}.")
        if self.seed < 0:
            raise UsageError(f"A seed must be 0 or more, not {self.seed}.")

    @property
    def chunks(self) -> int:
        """Number of chunks per formation."""
        return -(-self.runs // CHUNK)


@dataclass
class FormationResult:
    """The statistics of one formation.

    Attributes:
        tallies: The statistics of each filter, by name.
        cv_bound: Bound of the constant-velocity model, position in the fixed frame.
        ca_bound: Bound of the constant-acceleration model of Table 1, relative to the reference
            UAV, its acceleration unknown.
    """

    tallies: dict[str, Tally]
    cv_bound: BoundTally
    ca_bound: BoundTally

    def add(self, other: FormationResult) -> None:
        """Add the runs of another chunk."""
        for name, tally in other.tallies.items():
            self.tallies[name] += tally
        self.cv_bound += other.cv_bound
        self.ca_bound += other.ca_bound


def run_campaign(
    campaign: Campaign,
    executor: Executor | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, FormationResult]:
    """Fly a campaign.

    Args:
        campaign: What to fly.
        executor: Where the chunks are flown; None for this process.
        on_progress: Is told after each chunk how many runs are done, and of how many.

    Returns:
        The statistics of each formation, by name.

    Raises:
        EstimationError: A filter failed; names it and the epoch.
        UsageError: A formation has the wrong shape.
    """
    work = [
        (campaign, formation, chunk)
        for formation in campaign.formations
        for chunk in range(campaign.chunks)
    ]
    total = campaign.runs * len(campaign.formations)
    done = 0
    results: dict[str, FormationResult] = {}
    for (_, formation, chunk), result in zip(work, in_order(executor, _fly, work), strict=True):
        if formation in results:
            results[formation].add(result)
        else:
            results[formation] = result
        done += len(_runs_of(campaign, chunk))
        on_progress(done, total)
    return results


def _runs_of(campaign: Campaign, chunk: int) -> range:
    return range(chunk * CHUNK, min((chunk + 1) * CHUNK, campaign.runs))


def _fly(work: tuple[Campaign, str, int]) -> FormationResult:
    """Fly one chunk with one formation."""
    campaign, formation, chunk = work
    runs = len(_runs_of(campaign, chunk))
    # Generators of their own, so that the emitter's disturbance does not shift the noise.
    of_start, of_emitter, of_noise = (
        np.random.default_rng(sequence)
        for sequence in np.random.SeedSequence(campaign.seed, spawn_key=(chunk,)).spawn(3)
    )
    draw = campaign.start.draw(campaign.engagement, of_start, runs)
    motion = ConstantVelocity(campaign.process_noise)
    moments = fly(
        campaign.engagement,
        campaign.formations[formation],
        draw.emitter,
        motion if draw.disturbed else None,
        of_emitter,
    )
    epochs = len(campaign.engagement.epochs_s)
    logs = {
        name: Log(name, candidate, draw, runs, epochs)
        for name, candidate in campaign.filters.items()
        if chunk == 0 or name not in campaign.slow
    }
    # The same trajectory in all runs has one bound: the first chunk's.
    bounds = _Bounds(draw, motion, epochs) if draw.emitter.ndim > 1 or chunk == 0 else None
    for k, moment in enumerate(moments):
        scan = measure(campaign.engagement, moment, of_noise, runs)
        for log in logs.values():
            log.step(k, moment, scan)
        if bounds is not None:
            bounds.step(k, moment, scan)
    tallies = {name: log.tally() for name, log in logs.items()}
    if bounds is None:
        nothing = np.zeros((epochs, 4))
        return FormationResult(tallies, BoundTally(0, nothing), BoundTally(0, nothing))
    return FormationResult(tallies, *bounds.tallies())


class Log:
    """One filter flying through a chunk, and its errors so far.

    Args:
        name: Its name.
        candidate: The filter.
        draw: The chunk's beginning.
        runs: Runs of the chunk.
        epochs: Epochs it will be given.
    """

    def __init__(
        self, name: str, candidate: BatchFilter, draw: Draw, runs: int, epochs: int
    ) -> None:
        self._name = name
        self._filter = candidate
        self._start = candidate.start(draw.prior)
        self._belief = self._start
        self._error = np.empty((epochs, runs, 4))
        self._variance = np.empty((epochs, runs, 4))
        self._covariance = np.empty((epochs, runs))
        self._guarded = np.zeros(epochs, dtype=int)
        self._broken = np.zeros(runs, dtype=np.bool_)

    def step(self, k: int, moment: Moment, scan: Scan) -> None:
        """Take epoch k.

        Raises:
            EstimationError: The filter failed; names it and the epoch.
        """
        truth = moment.emitter
        if self._filter.relative:
            truth = truth - np.concatenate([moment.reference, moment.velocity], axis=-1)
        try:
            # A run that overflows is counted as broken; it need not be announced.
            with np.errstate(all="ignore"):
                belief = self._filter.step(self._belief, scan)
                estimate = self._filter.estimate(belief, scan)
            self._error[k] = estimate.x - truth
            self._variance[k] = np.linalg.diagonal(estimate.P)
            self._covariance[k] = estimate.P[..., 0, 1]
        except Exception as error:  # a researcher's filter may raise anything
            raise EstimationError(f"{self._name} failed at epoch {k}: {error}") from error
        if belief.guarded is not None:
            self._guarded[k] = np.count_nonzero(belief.guarded & ~self._broken)
        self._belief = self._without_broken(belief, k)

    def _without_broken(self, belief: Belief, k: int) -> Belief:
        """Mark runs that broke down as lost, and give the filter its first belief for them.

        One run that is no number would spoil the whole batch.
        """
        sound: Mask = np.isfinite(belief.x.sum(-1) + belief.P.sum((-2, -1)))
        if sound.all():
            if self._broken.any():
                self._error[k, self._broken] = np.nan
            return belief
        self._broken |= ~sound
        self._error[k, self._broken] = np.nan
        return Belief(
            np.where(sound[:, None], belief.x, self._start.x),
            np.where(sound[:, None, None], belief.P, self._start.P),
        )

    def tally(self, at: Sequence[int] | slice = slice(None)) -> Tally:
        """The statistics at all epochs, or at some."""
        return Tally.of(
            self._error[at], self._variance[at], self._covariance[at], self._guarded[at]
        )


class _Bounds:
    """The two bounds along the trajectories of a chunk."""

    def __init__(self, draw: Draw, motion: ConstantVelocity, epochs: int) -> None:
        P = draw.prior.covariance
        self._cv = CramerRaoBound(P[np.ix_(CV, CV)], motion)
        self._ca = CramerRaoBound(P[np.ix_(CA, CA)], ConstantAcceleration(JUMP))
        self._cv_variance = np.empty((epochs, 4))
        self._ca_variance = np.empty((epochs, 4))
        self._count = 1 if draw.emitter.ndim == 1 else len(draw.emitter)

    def step(self, k: int, moment: Moment, scan: Scan) -> None:
        for bound in (self._cv, self._ca):
            if moment.dt > 0.0:
                bound.predict(moment.dt)
        emitter = moment.emitter[..., :2]
        at = (emitter, moment.reference, moment.companions)
        self._cv.update(*at, scan.rd_covariance, scan.sigma_p)
        relative = effective_relative_covariance(
            scan.rd_covariance, scan.sigma_p, emitter - moment.reference, scan.truth.baselines
        )
        self._ca.update(*at, relative, 0.0)
        for variance, bound in ((self._cv_variance, self._cv), (self._ca_variance, self._ca)):
            diagonal = np.linalg.diagonal(bound.covariance)[..., :4]
            variance[k] = diagonal if diagonal.ndim == 1 else diagonal.sum(0)

    def tallies(self) -> Iterator[BoundTally]:
        yield BoundTally(self._count, self._cv_variance)
        yield BoundTally(self._count, self._ca_variance)
