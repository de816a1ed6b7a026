"""The estimates of a data set compared with the truth: errors, and whether sigmas are honest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import msgspec
import numpy as np

from swarmctl.datasets.reading import Trajectory
from swarmctl.datasets.tracking import Assumptions, DataSetCounts, TrackedEpoch
from swarmctl.estimation.bounds.consistency import nees
from swarmctl.estimation.integrity.health import Cause, Verdict, sentence
from swarmctl.units import Array

LOST_NEES = 30.0
"""An estimate with a larger NEES is lost: the emitter is elsewhere and the sigmas do not say so."""


class EstimateSeries(NamedTuple):
    """The K estimates of a track, one row each.

    Attributes:
        time: (K,), s.
        x: Position and velocity, (K, 6), SI.
        true: True position, (K, 3), m; NaN where it is not known.
        error: Distance of the estimate from the true position, (K,), m.
        sigma: Square root of the position's summed variances, (K,), m: what the RMSE should be.
        nees: Normalised estimation error squared of the position, (K,); NaN without truth.
        nis: Mean normalised innovation squared per row, as the health has it, (K,).
    """

    time: Array
    x: Array
    true: Array
    error: Array
    sigma: Array
    nees: Array
    nis: Array


class HealthFinding(msgspec.Struct, frozen=True):
    """One thing that was wrong with a track.

    Attributes:
        cause: What was wrong.
        share: Share of the epochs at which it was.
        first_s: Time of the first of them, s.
        sentence: The same in words.
    """

    cause: Cause
    share: float
    first_s: float
    sentence: str


class TrackingFigures(msgspec.Struct, frozen=True, kw_only=True):
    """The figures of a tracked data set. Those that need the truth are left out without it.

    Attributes:
        duration_s: Time from the first epoch to the last.
        elapsed_s: Wall time that tracking took.
        times_real_time: The first over the second.
        epochs: Epochs with at least one row.
        estimates: Epochs with an estimate.
        first_estimate_s: Time from the first epoch to the first estimate; None without one.
        used: Rows used.
        rejected: Rows set aside as outliers.
        share_rejected: Share of these two; None if both are 0.
        repeated: Rows left out as copies of earlier ones.
        without_receiver_position: Rows left out for want of a receiver's position.
        restarts: How often a track that had diverged was begun again.
        mean_nis: Mean normalised innovation squared per row: 1 is right.
        health: Share of the epochs by status.
        judged: Estimates compared with the truth.
        rmse_m: Root mean square of their errors.
        median_error_m: Median of their errors.
        nees_dof: Degrees of freedom of the NEES, which is its right mean.
        mean_nees: Mean NEES.
        median_nees: Median NEES.
        share_lost: Share with a NEES above :data:`LOST_NEES`.
    """

    duration_s: float
    elapsed_s: float
    times_real_time: float
    epochs: int
    estimates: int
    first_estimate_s: float | None
    used: int
    rejected: int
    share_rejected: float | None
    repeated: int
    without_receiver_position: int
    restarts: int
    mean_nis: float | None
    health: dict[str, float]
    judged: int | msgspec.UnsetType = msgspec.UNSET
    rmse_m: float | msgspec.UnsetType | None = msgspec.UNSET
    median_error_m: float | msgspec.UnsetType | None = msgspec.UNSET
    nees_dof: int | msgspec.UnsetType = msgspec.UNSET
    mean_nees: float | msgspec.UnsetType | None = msgspec.UNSET
    median_nees: float | msgspec.UnsetType | None = msgspec.UNSET
    share_lost: float | msgspec.UnsetType | None = msgspec.UNSET


class TrackingSummary(msgspec.Struct, frozen=True, kw_only=True):
    """The contents of ``summary.json``, with the figures beside the rest.

    Attributes:
        filter: Name of the filter.
        receivers: How many receivers there are.
        assumed: What was assumed.
        figures: What came of it.
        wrong: What was wrong with the track, the most frequent first.
    """

    filter: str
    receivers: int
    assumed: Assumptions
    figures: TrackingFigures
    wrong: list[HealthFinding]

    def to_json(self) -> dict[str, Any]:
        """The keys of ``summary.json`` in their order."""
        whole: dict[str, Any] = msgspec.to_builtins(self)
        figures, wrong = whole.pop("figures"), whole.pop("wrong")
        return {**whole, **figures, "wrong": wrong}


@dataclass
class TrackHistory:
    """Every epoch of a track, with the truth beside it where that is known.

    Attributes:
        dof: Axes of the position that count: 3, or 2 where the height was given.
        truth: Where the emitter was; None if that is not known.
    """

    dof: int
    truth: Trajectory | None
    _steps: list[TrackedEpoch] = field(default_factory=list)
    _true: list[Array] = field(default_factory=list)

    def add(self, step: TrackedEpoch) -> None:
        """Take the next step."""
        true = None if self.truth is None else self.truth.at(step.epoch_s)
        self._steps.append(step)
        self._true.append(np.full(3, np.nan) if true is None else true)

    @property
    def status(self) -> list[str]:
        """Health after each epoch."""
        return [step.verdict.status for step in self._steps]

    def findings(self, names: Sequence[str]) -> list[HealthFinding]:
        """What was wrong with the track, the most frequent first.

        Args:
            names: Names of the receivers, by id.
        """
        found: dict[Cause, list[tuple[float, Verdict]]] = {}
        for step in self._steps:
            if step.verdict.cause is not None:
                found.setdefault(step.verdict.cause, []).append((step.epoch_s, step.verdict))
        return [
            HealthFinding(
                cause=cause,
                share=len(when) / len(self._steps),
                first_s=when[0][0],
                sentence=sentence(when[len(when) // 2][1], lambda r: names[r]),
            )
            for cause, when in sorted(found.items(), key=lambda item: -len(item[1]))
        ]

    def series(self) -> EstimateSeries:
        """The estimates of the steps that have one."""
        found = [(k, step.estimate) for k, step in enumerate(self._steps) if step.estimate]
        there = [k for k, _ in found]
        x = np.array([estimate.x for _, estimate in found]).reshape(-1, 6)
        P = np.array([estimate.P for _, estimate in found]).reshape(-1, 6, 6)
        true = np.array([self._true[k] for k in there]).reshape(-1, 3)
        time = np.array([self._steps[k].epoch_s for k in there])
        nis = np.array([self._steps[k].verdict.nis for k in there])
        error = (x[:, :3] - true)[:, : self.dof]
        covariance = P[:, : self.dof, : self.dof]
        known = np.isfinite(error[:, 0])
        forms = np.full(len(time), np.nan)
        forms[known] = nees(error[known], covariance[known])
        sigma = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
        return EstimateSeries(time, x, true, np.linalg.norm(error, axis=1), sigma, forms, nis)

    def figures(self, counts: DataSetCounts, elapsed_s: float) -> TrackingFigures:
        """Work out the figures.

        Args:
            counts: What became of the measurements.
            elapsed_s: Wall time that tracking took, s.
        """
        series = self.series()
        begin_s, end_s = self._steps[0].epoch_s, self._steps[-1].epoch_s
        rows = counts.rows
        measured = rows.used + rows.aside
        status = self.status
        figures = TrackingFigures(
            duration_s=end_s - begin_s,
            elapsed_s=round(elapsed_s, 3),
            times_real_time=round((end_s - begin_s) / elapsed_s, 2),
            epochs=counts.epochs,
            estimates=len(series.time),
            first_estimate_s=float(series.time[0]) - begin_s if len(series.time) else None,
            used=rows.used,
            rejected=rows.aside,
            share_rejected=rows.aside / measured if measured else None,
            repeated=rows.repeated,
            without_receiver_position=counts.unplaced,
            restarts=counts.restarts,
            mean_nis=float(series.nis.mean()) if len(series.nis) else None,
            health={name: status.count(name) / len(status) for name in sorted(set(status))},
        )
        if self.truth is None:
            return figures
        known = np.isfinite(series.nees)
        error, forms = series.error[known], series.nees[known]
        return msgspec.structs.replace(
            figures,
            judged=int(known.sum()),
            rmse_m=_figure(error, lambda e: np.sqrt(np.mean(e**2))),
            median_error_m=_figure(error, np.median),
            nees_dof=self.dof,
            mean_nees=_figure(forms, np.mean),
            median_nees=_figure(forms, np.median),
            share_lost=_figure(forms, lambda n: np.mean(n > LOST_NEES)),
        )


def _figure(values: Array, of: Callable[[Array], Any]) -> float | None:
    return float(of(values)) if len(values) else None
