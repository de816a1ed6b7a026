"""One pass through a data set: epochs in, the estimate after each out. Streams; no I/O."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swarmctl.datasets.pair_covariance import LARGEST_RHO, rows_of
from swarmctl.datasets.reading import Epoch, ReceiverPositions
from swarmctl.errors import EstimationError, UsageError
from swarmctl.estimation.estimate import Counts, Estimate
from swarmctl.estimation.filters import FILTERS, Filters
from swarmctl.estimation.integrity.gate import GATE
from swarmctl.estimation.integrity.health import Verdict
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.estimation.model.rows import Rows
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.estimation.track.track import Track
from swarmctl.units import Array

_APERTURES = 2.0
"""1-sigma of the prior per axis, where none is given, in distances of the outermost receiver
from their middle: wide enough for an emitter in their midst or a few apertures away."""
_GATE = 3.0
"""Sigmas beyond which a row is set aside. Outliers of a room are of all sizes, and those near the
gate do the harm; the one good row in 370 that goes with them is not missed among hundreds."""
_SURE = 1.96
"""Sigmas within which a normal number is with 95 %."""
_HEIGHT_SIGMA_M = 0.01
_CLIMB_SIGMA_MPS = 1e-3
"""1-sigma of a height that is known, and of its rate of change."""


@dataclass(frozen=True)
class Assumptions:
    """What is assumed of a data set; in SI units.

    Attributes:
        sigma_m: White 1-sigma of a range difference (RD) that brings none of its own.
        colour_m: 1-sigma of an RD's correlated error (multipath); 0 for none.
        tau_s: Its correlation time.
        rho: Share of an RD's white variance that each of its two arrivals has, 0 to ½. At 0
            every RD stands by itself, and so do outliers: otherwise they are of a receiver.
        clock_bias_m: 1-sigma of a receiver's clock; 0 for good clocks.
        clock_drift_mps: 1-sigma of its drift.
        navigation_m: 1-sigma of the receivers' positions per axis; 0 for exact ones.
        navigation_tau_s: Its correlation time.
        process_noise: Spectral density of the emitter's acceleration per axis, m²/s³.
        speed_mps: 1-sigma of its velocity at the beginning per axis.
        at: Where it is at the beginning, (east, north, up), m; None for the middle of the
            receivers.
        within_m: 95 % sure within so many metres of there along each axis; None for four times
            the distance of the outermost receiver from their middle.
        height_m: Known height of the emitter, m; None for one that is estimated.

    Raises:
        UsageError: A number is outside its interval.
    """

    sigma_m: float = 0.1
    colour_m: float = 0.2
    tau_s: float = 0.5
    rho: float = 0.5
    clock_bias_m: float = 0.0
    clock_drift_mps: float = 0.0
    navigation_m: float = 0.0
    navigation_tau_s: float = 60.0
    process_noise: float = 0.2
    speed_mps: float = 1.0
    at: tuple[float, float, float] | None = None
    within_m: float | None = None
    height_m: float | None = None

    def __post_init__(self) -> None:
        above_0 = ["sigma_m", "tau_s", "navigation_tau_s", "speed_mps"]
        if self.within_m is not None:
            above_0.append("within_m")
        # Written so that NaN fails too.
        for name in above_0:
            if not 0.0 < getattr(self, name) < math.inf:
                raise UsageError(f"{name} must be above 0, not {getattr(self, name):g}.")
        for name in (
            "colour_m",
            "clock_bias_m",
            "clock_drift_mps",
            "navigation_m",
            "process_noise",
        ):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise UsageError(f"{name} must be 0 or above, not {getattr(self, name):g}.")
        if self.clock_drift_mps > 0.0 and self.clock_bias_m == 0.0:
            raise UsageError("A clock that drifts has a bias: clock_bias_m must be above 0.")
        if not 0.0 <= self.rho <= 0.5:
            raise UsageError(f"rho must be from 0 to 0.5, not {self.rho:g}.")
        if self.height_m is not None and not math.isfinite(self.height_m):
            raise UsageError(f"height_m must be a finite number, not {self.height_m:g}.")

    @property
    def errors(self) -> ReceiverErrors:
        """The receivers' error model."""
        return ReceiverErrors(
            bias_m=self.clock_bias_m,
            drift_mps=self.clock_drift_mps,
            navigation_m=self.navigation_m,
            navigation_tau_s=self.navigation_tau_s,
            colour_m=self.colour_m / math.sqrt(2.0),  # two arrivals make a range difference
            colour_tau_s=self.tau_s,
        )

    @property
    def dof(self) -> int:
        """Axes of the position that are estimated: those of the NEES."""
        return 3 if self.height_m is None else 2

    @property
    def behaviour(self) -> Behaviour:
        """How emitter and receivers are taken to behave."""
        level, upward = self.process_noise, self.process_noise * (self.dof == 3)
        return Behaviour((level, level, upward), self.errors)


class TrackedEpoch(NamedTuple):
    """What is known after an epoch.

    Attributes:
        epoch_s: Time of the epoch, s.
        estimate: The emitter's estimate; None while there is none.
        verdict: Health of the track.
    """

    epoch_s: float
    estimate: Estimate | None
    verdict: Verdict


class DataSetCounts(NamedTuple):
    """What became of a data set.

    Attributes:
        epochs: Epochs with at least one row that could be used.
        unplaced: Rows left out because a receiver's position is not recorded at that time.
        restarts: How often the track was begun again after it had diverged.
        rows: What became of the rows that reached the track.
    """

    epochs: int = 0
    unplaced: int = 0
    restarts: int = 0
    rows: Counts = Counts()


def prior_of(assumed: Assumptions, receivers_at: Array) -> Prior:
    """What is known of the emitter before the first measurement.

    Args:
        assumed: What is assumed, with a prior or without.
        receivers_at: Positions of the receivers, (R, 3), m.
    """
    middle = receivers_at.mean(0)
    aperture = float(np.sqrt(((receivers_at - middle) ** 2).sum(-1)).max())
    if assumed.within_m is None:
        sigma = _APERTURES * max(aperture, 1e-3)
    else:
        sigma = assumed.within_m / _SURE
    mean = np.zeros(6)
    mean[:3] = middle if assumed.at is None else assumed.at
    sigmas = np.array([sigma] * 3 + [assumed.speed_mps] * 3)
    if assumed.height_m is not None:
        mean[2] = assumed.height_m
        sigmas[2], sigmas[5] = _HEIGHT_SIGMA_M, _CLIMB_SIGMA_MPS
    return Prior(mean, np.diag(sigmas**2))


class DataSetTracking:
    """Tracks the emitter through a data set.

    Args:
        name: One of the filters'.
        assumed: What is assumed.
        receivers: Where the receivers were.
        filters: What there is to choose from.

    Attributes:
        counts: What became of the measurements read so far.
    """

    def __init__(
        self,
        name: str,
        assumed: Assumptions,
        receivers: ReceiverPositions,
        filters: Filters = FILTERS,
    ) -> None:
        self._name = name
        self._assumed = assumed
        self._receivers = receivers
        self._filters = filters
        self.counts = DataSetCounts()

    def run(self, epochs: Iterable[Epoch]) -> Iterator[TrackedEpoch]:
        """Track through the epochs.

        A track that has diverged is begun again, with no prior but the receivers' middle.

        Args:
            epochs: The measurements in the order of time; read as they are needed.

        Raises:
            UsageError: There is no such filter.
        """
        assumed, receivers = self._assumed, self._receivers
        found: Track | None = None
        anywhere: Prior | None = None
        for epoch in epochs:
            rows, unplaced = rows_of(epoch, receivers, assumed.rho)
            self._count(unplaced=unplaced)
            if rows is None:
                continue
            self._count(epochs=1)
            if found is None or anywhere is None:
                places = [trajectory.at(epoch.epoch_s) for trajectory in receivers.trajectories]
                at = np.stack([place for place in places if place is not None])
                found = self._filters.track(
                    self._name, prior_of(assumed, at), assumed.behaviour, gate=_GATE
                )
                anywhere = prior_of(
                    Assumptions(speed_mps=assumed.speed_mps, height_m=assumed.height_m), at
                )
            try:
                there = False
                for part in _parts(rows, assumed.rho):
                    there = found.update(part)
                best = found.estimates()[0] if there else None
            except EstimationError:  # no finite result: begin again
                best, failed = None, True
            else:
                failed = found.verdict.status == "diverged"
            self.counts = self.counts._replace(rows=found.counts)
            yield TrackedEpoch(epoch.epoch_s, best, found.verdict)
            if failed:
                self._count(restarts=1)
                found.restart(anywhere)

    def _count(self, *, epochs: int = 0, unplaced: int = 0, restarts: int = 0) -> None:
        counts = self.counts
        self.counts = counts._replace(
            epochs=counts.epochs + epochs,
            unplaced=counts.unplaced + unplaced,
            restarts=counts.restarts + restarts,
        )


def _parts(rows: Rows, rho: float) -> Iterator[Rows]:
    """What is updated with at once: all rows of an epoch, or each where they are independent."""
    if len(rows.rd) == 1 or (rho > 0.0 and _is_one_signal(rows, rho)):
        yield rows
        return
    for row in np.eye(len(rows.rd), dtype=np.bool_):
        yield rows.where(row)


def _is_one_signal(rows: Rows, rho: float) -> bool:
    """Whether an epoch's RDs can be the differences of one set of arrivals.

    Then those along a loop of pairs (ab, bc, ca) add up to nothing but what is each
    row's own. Loops that do not close are of signals one after the other, in a data set whose
    clock is coarser than their distance.
    """
    own = GATE * math.sqrt(2.0 * (1.0 - 2.0 * min(rho, LARGEST_RHO)))
    limits = own * np.sqrt(np.diagonal(rows.covariance))
    # For each receiver: the group that pairs connect it with, and its arrival in there, m.
    known: dict[int, tuple[int, float]] = {}
    for first, second, rd, limit in zip(rows.first, rows.second, rows.rd, limits, strict=True):
        group, begin = known.setdefault(first, (first, 0.0))
        other, end = known.setdefault(second, (second, 0.0))
        if group == other:
            if abs(end - begin - rd) > limit:
                return False
            continue
        for receiver, (its, arrival) in known.items():
            if its == other:
                known[receiver] = (group, arrival + begin + rd - end)
    return True
