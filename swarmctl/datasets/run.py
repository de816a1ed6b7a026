"""From files to files: reads a recording, tracks, writes what was found.

``estimates.csv``  after each epoch: position, velocity, covariance, NIS, health
``summary.json``   what was assumed, and the figures
``track.png``, ``error.png``
"""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np

from swarmctl.datasets.accuracy import Judged
from swarmctl.datasets.dataset import read_epochs, read_receivers, read_truth
from swarmctl.datasets.tracking import Counts, Settings, Step, track
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
"""Columns of ``estimates.csv``. Covariances in m², m²/s, m²/s²; empty without an estimate."""


def run(
    receivers_file: Path,
    measurements_file: Path,
    truth_file: Path | None,
    out: Path,
    *,
    name: str,
    settings: Settings,
) -> dict[str, object]:
    """Track a recording.

    What an earlier run left in ``out`` stays as it was unless this one gets to the end of the
    measurements.

    Args:
        receivers_file: See :mod:`~swarmctl.datasets.dataset`, as for the other two.
        measurements_file: Read while it is tracked.
        truth_file: If the truth is known.
        out: Directory to write to; made if it is not there.
        name: The filter's name.
        settings: What is assumed.

    Returns:
        The contents of ``summary.json``.

    Raises:
        UsageError: Something is wrong with a file or an argument: which, where, and what would
            be right.
    """
    receivers = read_receivers(receivers_file)
    truth = None if truth_file is None else read_truth(truth_file)
    judged = Judged(settings.dof, truth)
    counts = Counts()
    epochs = read_epochs(measurements_file, receivers, settings.sigma_m)
    begin_s = time.perf_counter()
    try:
        out.mkdir(parents=True, exist_ok=True)
        unfinished = out / f"{ESTIMATES_FILE}.part"
        try:
            with unfinished.open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow(COLUMNS)
                writer.writerows(_cells(track(name, settings, receivers, epochs, counts), judged))
            if not counts.epochs:
                raise UsageError(
                    f"{measurements_file}: no line has the positions of both its receivers in"
                    f" {receivers_file} at its time; overlapping times would be right."
                )
            unfinished.replace(out / ESTIMATES_FILE)
        finally:
            unfinished.unlink(missing_ok=True)
        summary = {
            "filter": name,
            "receivers": len(receivers.names),
            "assumed": asdict(settings),
            **judged.summary(counts, time.perf_counter() - begin_s),
            "wrong": judged.wrong(receivers.names),
        }
        (out / SUMMARY_FILE).write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
        from swarmctl.datasets.plots import write_pictures  # noqa: PLC0415 - loads matplotlib

        write_pictures(judged.series(), receivers, settings.dof, out)
    except OSError as error:
        raise UsageError(f"--out {out} cannot be written: {error.strerror}.") from error
    return summary


def _cells(steps: Iterator[Step], judged: Judged) -> Iterator[list[str]]:
    for step in steps:
        judged.add(step)
        time_s = f"{step.epoch_s:.15g}"
        verdict = step.verdict
        health = [verdict.status, verdict.cause or ""]
        if step.x is None:
            yield [time_s, *[""] * (len(COLUMNS) - 3), *health]
        else:
            numbers = [*step.x, *step.P[_UPPER], verdict.nis]
            yield [time_s, *(f"{number:.7g}" for number in numbers), *health]
