"""The plots of a tracked data set. Import this only to draw: matplotlib is slow to load.

``track.png``  the track from above, and its height
``error.png``  error and 1-sigma, NEES and NIS, against time
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from swarmctl.datasets.accuracy import EstimateSeries
from swarmctl.datasets.reading import ReceiverPositions
from swarmctl.units import Array

_INK = "#22272e"
_FAINT = "#8b949e"
_TRUTH = "#c1121f"
_ESTIMATE = "#7b2cbf"
_DPI = 130


def write_plots(
    series: EstimateSeries, receivers: ReceiverPositions, dof: int, directory: Path
) -> None:
    """Write the plots of a track.

    Args:
        series: The estimates.
        receivers: Where the receivers were.
        dof: Degrees of freedom of the NEES: axes of the position that count.
        directory: Directory of the files.
    """
    _track(series, receivers).savefig(directory / "track.png", dpi=_DPI)
    _error(series, dof).savefig(directory / "error.png", dpi=_DPI)


def _track(series: EstimateSeries, receivers: ReceiverPositions) -> Figure:
    figure = Figure(figsize=(11.0, 9.0), layout="constrained")
    above, height = figure.subplots(2, 1, height_ratios=(2.6, 1.0))
    label = "receivers"
    names: dict[tuple[float, float], list[str]] = {}
    for name, trajectory in zip(receivers.names, receivers.trajectories, strict=True):
        east, north, _ = trajectory.positions.T
        above.plot(east, north, color=_INK, lw=0.8, marker="^", ms=6, markevery=[-1], label=label)
        names.setdefault((float(east[-1]), float(north[-1])), []).append(name)
        label = "_"
    for place, together in names.items():
        above.annotate(", ".join(together), place, xytext=(5, 4), textcoords="offset points")
    known = np.isfinite(series.nees)
    east, north, up = series.x[:, :3].T
    above.plot(east, north, color=_ESTIMATE, lw=0.9, label="estimate")
    height.plot(series.time, up, color=_ESTIMATE, lw=0.9)
    if known.any():
        above.plot(*series.true[known, :2].T, color=_TRUTH, lw=1.2, label="truth")
        height.plot(series.time[known], series.true[known, 2], color=_TRUTH, lw=1.2)
    above.set_aspect("equal", adjustable="datalim")
    above.set_xlabel("east (m)")
    above.set_ylabel("north (m)")
    height.set_xlabel("time (s)")
    height.set_ylabel("up (m)")
    above.legend(loc="upper right", frameon=False)
    _dress(above, "The track from above")
    _dress(height, "Its height")
    return figure


def _error(series: EstimateSeries, dof: int) -> Figure:
    figure = Figure(figsize=(11.0, 8.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.plot(series.time, series.sigma, color=_ESTIMATE, lw=1.4, label="1-sigma it claims")
    lower.plot(series.time, series.nis, color=_ESTIMATE, lw=1.0, label="NIS per row (1 is right)")
    if np.isfinite(series.nees).any():
        upper.plot(series.time, series.error, color=_INK, lw=0.9, label="error")
        lower.plot(
            series.time, series.nees, color=_INK, lw=0.7, label=f"NEES ({dof} is right on average)"
        )
    upper.set_ylabel("metres")
    lower.set_xlabel("time (s)")
    for axes, values, title in (
        (upper, series.sigma, "Error, and what the covariance says"),
        (lower, series.nis, "Consistency"),
    ):
        _dress(axes, title)
        _log_scale(axes, values)
        axes.legend(loc="upper right", frameon=False)
    return figure


def _log_scale(axes: Axes, values: Array) -> None:
    if (values > 0.0).any():
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.grid(visible=True, which="minor", axis="y", color="#eef0f2", lw=0.5)


def _dress(axes: Axes, title: str) -> None:
    axes.set_title(title, loc="left", fontsize=12, fontweight="bold", color=_INK)
    axes.grid(visible=True, color="#e4e7ea", lw=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(colors=_INK, labelsize=9)
    for side, spine in axes.spines.items():
        spine.set_visible(side in {"left", "bottom"})
        spine.set_color(_FAINT)
