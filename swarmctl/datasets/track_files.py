"""``swarmctl track`` from files to files: reads a data set, tracks, writes what was found.

``estimates.csv``  after each epoch: position, velocity, covariance, NIS, health
``summary.json``   what was assumed, and the figures
``track.png``, ``error.png``  the plots
"""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from swarmctl.datasets.accuracy import TrackHistory, TrackingSummary
from swarmctl.datasets.reading import read_epochs, read_receivers, read_truth
from swarmctl.datasets.tracking import Assumptions, DataSetTracking, TrackedEpoch
from swarmctl.errors import UsageError

ESTIMATES_FILE, SUMMARY_FILE = "estimates.csv", "summary.json"

_STATES = ("east", "north", "up", "v_east", "v_north", "v_up")
_UPPER = np.triu_indices(6)
COLUMNS = (
    "time_s",
    *("east_m", "north_m", "up_m", "v_east_mps", "v_north_mps", "v_up_mps"),
    *(f"cov_{_STATES[i]}_{_STATES[j]}" for i, j in zip(*_UPPER, strict=True)),
    "nis",
    "health",
    "cause",
)
"""Columns of ``estimates.csv``. Covariances are in m², m²/s and m²/s²; numbers are empty while
there is no estimate."""


def track_files(
    receivers_file: Path,
    measurements_file: Path,
    truth_file: Path | None,
    out: Path,
    *,
    name: str,
    assumed: Assumptions,
) -> TrackingSummary:
    """Track a data set and write what was found.

    The files of an earlier run in ``out`` are replaced only if this one gets to the end of the
    measurements.

    Args:
        receivers_file: The receivers, as :mod:`~swarmctl.datasets.reading` describes the file.
        measurements_file: The measurements; read while they are tracked.
        truth_file: The truth; None if it is not known.
        out: Directory to write to; made if it is not there.
        name: Name of the filter.
        assumed: What is assumed of the data set.

    Returns:
        The contents of ``summary.json``.

    Raises:
        UsageError: A file or an argument is wrong; the message says where, and what would be
            right.
    """
    receivers = read_receivers(receivers_file)
    truth = None if truth_file is None else read_truth(truth_file)
    history = TrackHistory(assumed.dof, truth)
    tracking = DataSetTracking(name, assumed, receivers)
    epochs = read_epochs(measurements_file, receivers, assumed.sigma_m)
    begin_s = time.perf_counter()
    try:
        out.mkdir(parents=True, exist_ok=True)
        unfinished = out / f"{ESTIMATES_FILE}.part"
        try:
            with unfinished.open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow(COLUMNS)
                writer.writerows(_cells(tracking.run(epochs), history))
            if not tracking.counts.epochs:
                raise UsageError(
                    f"{measurements_file}: no line has the positions of both its receivers in"
                    f" {receivers_file} at its time; overlapping times would be right."
                )
            unfinished.replace(out / ESTIMATES_FILE)
        finally:
            unfinished.unlink(missing_ok=True)
        summary = TrackingSummary(
            filter=name,
            receivers=len(receivers.names),
            assumed=assumed,
            figures=history.figures(tracking.counts, time.perf_counter() - begin_s),
            wrong=history.findings(receivers.names),
        )
        text = json.dumps(summary.to_json(), indent=1) + "\n"
        (out / SUMMARY_FILE).write_text(text, encoding="utf-8")
        from swarmctl.datasets.plots import write_plots  # noqa: PLC0415 - loads matplotlib

        write_plots(history.series(), receivers, assumed.dof, out)
    except OSError as error:
        raise UsageError(f"--out {out} cannot be written: {error.strerror}.") from error
    return summary


def _cells(steps: Iterator[TrackedEpoch], history: TrackHistory) -> Iterator[list[str]]:
    for step in steps:
        history.add(step)
        time_s = f"{step.epoch_s:.15g}"
        verdict = step.verdict
        health = [verdict.status, verdict.cause or ""]
        if step.estimate is None:
            yield [time_s, *[""] * (len(COLUMNS) - 3), *health]
        else:
            numbers = [*step.estimate.x, *step.estimate.P[_UPPER], verdict.nis]
            yield [time_s, *(f"{number:.7g}" for number in numbers), *health]
