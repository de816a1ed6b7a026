"""Estimates against the truth: how far off, and do the error bars tell it?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from swarmctl.datasets.dataset import Path3D
from swarmctl.datasets.tracking import Counts, Step
from swarmctl.estimation.bounds.consistency import nees
from swarmctl.estimation.integrity.health import Cause, Verdict, sentence
from swarmctl.units import Array

LOST_NEES = 30.0
"""An estimate with a larger NEES is lost: it is elsewhere and does not say so."""


class Series(NamedTuple):
    """The estimates, one row each.

    Attributes:
        time: (K,), s.
        x: Position and velocity, (K, 6), SI.
        true: True position, (K, 3), m; NaN where it is not known.
        error: Distance of the estimate from it, (K,), m.
        sigma: Square root of the position's summed variances, (K,), m: what the RMSE should be.
        nees: (K,).
        nis: (K,).
    """

    time: Array
    x: Array
    true: Array
    error: Array
    sigma: Array
    nees: Array
    nis: Array


@dataclass
class Judged:
    """The history of a track, and its errors where the truth is known.

    Attributes:
        dof: Axes of the position that count: 3, or 2 where the height was given.
        truth: Where the emitter was, if that is known.
    """

    dof: int
    truth: Path3D | None
    _steps: list[Step] = field(default_factory=list)
    _true: list[Array] = field(default_factory=list)

    def add(self, step: Step) -> None:
        """Take the next estimate."""
        true = None if self.truth is None else self.truth.at(step.epoch_s)
        self._steps.append(step)
        self._true.append(np.full(3, np.nan) if true is None else true)

    @property
    def status(self) -> list[str]:
        """Health after each epoch."""
        return [step.verdict.status for step in self._steps]

    def wrong(self, names: Sequence[str]) -> list[dict[str, object]]:
        """What was wrong, for how much of the time, since when, and as a sentence; longest first.

        Args:
            names: The receivers' names, by id.
        """
        found: dict[Cause, list[tuple[float, Verdict]]] = {}
        for step in self._steps:
            if step.verdict.cause is not None:
                found.setdefault(step.verdict.cause, []).append((step.epoch_s, step.verdict))
        return [
            {
                "cause": cause,
                "share": len(when) / len(self._steps),
                "first_s": when[0][0],
                "sentence": sentence(when[len(when) // 2][1], lambda r: names[r]),
            }
            for cause, when in sorted(found.items(), key=lambda item: -len(item[1]))
        ]

    def series(self) -> Series:
        """What the estimates were, where there were any."""
        there = [k for k, step in enumerate(self._steps) if step.x is not None]
        x = np.array([self._steps[k].x for k in there]).reshape(-1, 6)
        P = np.array([self._steps[k].P for k in there]).reshape(-1, 6, 6)
        true = np.array([self._true[k] for k in there]).reshape(-1, 3)
        time = np.array([self._steps[k].epoch_s for k in there])
        nis = np.array([self._steps[k].verdict.nis for k in there])
        error = (x[:, :3] - true)[:, : self.dof]
        covariance = P[:, : self.dof, : self.dof]
        known = np.isfinite(error[:, 0])
        forms = np.full(len(time), np.nan)
        forms[known] = nees(error[known], covariance[known])
        sigma = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
        return Series(time, x, true, np.linalg.norm(error, axis=1), sigma, forms, nis)

    def summary(self, counts: Counts, elapsed_s: float) -> dict[str, object]:
        """The figures of ``summary.json``.

        Args:
            counts: What became of the measurements.
            elapsed_s: How long it took, s.
        """
        series = self.series()
        begin_s, end_s = self._steps[0].epoch_s, self._steps[-1].epoch_s
        measured = counts.used + counts.aside
        status = self.status
        figures: dict[str, object] = {
            "duration_s": end_s - begin_s,
            "elapsed_s": round(elapsed_s, 3),
            "times_real_time": round((end_s - begin_s) / elapsed_s, 2),
            "epochs": counts.epochs,
            "estimates": len(series.time),
            "first_estimate_s": float(series.time[0]) - begin_s if len(series.time) else None,
            "used": counts.used,
            "rejected": counts.aside,
            "share_rejected": counts.aside / measured if measured else None,
            "repeated": counts.repeated,
            "without_receiver_position": counts.unplaced,
            "restarts": counts.restarts,
            "mean_nis": float(series.nis.mean()) if len(series.nis) else None,
            "health": {name: status.count(name) / len(status) for name in sorted(set(status))},
        }
        known = np.isfinite(series.nees)
        if self.truth is not None:
            error, forms = series.error[known], series.nees[known]
            figures |= {
                "judged": int(known.sum()),
                "rmse_m": _of(error, lambda e: np.sqrt(np.mean(e**2))),
                "median_error_m": _of(error, np.median),
                "nees_dof": self.dof,
                "mean_nees": _of(forms, np.mean),
                "median_nees": _of(forms, np.median),
                "share_lost": _of(forms, lambda n: np.mean(n > LOST_NEES)),
            }
        return figures


def _of(values: Array, figure: Callable[[Array], Any]) -> float | None:
    return float(figure(values)) if len(values) else None
