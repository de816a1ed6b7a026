"""The plot of the receivers' clock and navigation errors, estimated and true.

It has one row per receiver and one column per kind of error, always less the reference's: the
estimate with its 2-sigma band, and the truth where a simulator published it.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from swarmctl.recorder.debrief import Debrief
from swarmctl.recorder.plot_style import (
    FAINT,
    INK,
    dress,
    legend_below,
    mark_phases,
    name_phases,
    rows,
    vehicle_colours,
)

_Floats = NDArray[np.float64]

_COLUMNS = ("Clock (m; 1 m is 3.3 ns)", "Navigation, east (m)", "Navigation, north (m)")
_SETTLING = 0.2
"""Share of the time whose bands may leave the plot: at first they are too wide to scale by."""


def draw_receivers(debrief: Debrief) -> Figure | None:
    """Draw the receivers' errors; None if none was estimated.

    A kind of error has no column if none was estimated and none was there.
    """
    found = {
        sysid: (series, _differences_of_truth(debrief, sysid, series))
        for sysid, series in ((k, rows(s, 9)) for k, s in debrief.series.receivers.items())
    }
    shown = [
        k
        for k in range(len(_COLUMNS))
        if any(np.any(s[6 + k] > 0.0) or np.nansum(np.abs(t[k])) > 0.0 for s, t in found.values())
    ]
    if not shown:
        return None
    figure = Figure(figsize=(2.6 + 4.2 * len(shown), 1.6 + 1.75 * len(found)), layout="constrained")
    grid = figure.subplots(len(found), len(shown), sharex=True, squeeze=False)
    colours = vehicle_colours(debrief)
    for row, (sysid, (series, truth)) in zip(grid, sorted(found.items()), strict=True):
        for axes, k in zip(row, shown, strict=True):
            dress(axes, _COLUMNS[k] if axes in grid[0] else "", pad=24)
            mark_phases(axes, debrief)
            _draw(axes, series, k, truth[k], colours.get(sysid, FAINT))
        row[0].set_ylabel(f"UAV {sysid}", fontweight="bold", color=INK)
    times = np.concatenate([series[0] for series, _ in found.values()])
    for top, bottom in zip(grid[0], grid[-1], strict=True):
        top.set_xlim(times.min(), max(times.max(), times.min() + 1.0))
        name_phases(top, debrief)
        bottom.set_xlabel("mission time (s)")
    others = {int(other) for series, _ in found.values() for other in series[2]}
    whose = f"UAV {others.pop()}" if len(others) == 1 else "the reference UAV"
    figure.suptitle(
        f"Errors of the receivers relative to {whose}", x=0.01, ha="left", color=INK,
        fontsize=13, fontweight="bold",
    )  # fmt: skip
    figure.align_ylabels(grid[:, 0])
    legend_below(figure, grid[0, 0])
    return figure


def _differences_of_truth(debrief: Debrief, sysid: int, series: _Floats) -> _Floats:
    """True errors less the reference's, (3, rows), m; NaN where they are not known."""
    truths = {k: rows(s, 4) for k, s in debrief.series.receiver_truths.items()}
    nothing = np.full((4, 1), np.nan)

    def at(sysid: int, epochs: _Floats) -> _Floats:
        epoch, *values = truths.get(sysid, nothing)
        return np.array([np.interp(epochs, epoch, v, np.nan, np.nan) for v in values])

    epochs, others = series[1], series[2]
    difference = at(sysid, epochs)
    for other in np.unique(others):
        difference[:, others == other] -= at(int(other), epochs[others == other])
    return difference


def _draw(axes: Axes, series: _Floats, k: int, truth: _Floats, colour: str) -> None:
    """Draw one kind of error of one receiver; a line ends where the reference changes."""
    breaks = np.flatnonzero(np.diff(series[2])) + 1
    time, value, sigma, true = (
        np.insert(column, breaks, np.nan)
        for column in (series[0], series[3 + k], series[6 + k], truth)
    )
    low, high = value - 2.0 * sigma, value + 2.0 * sigma
    axes.fill_between(time, low, high, color=colour, alpha=0.22, lw=0, label="2 sigma", zorder=2)
    axes.plot(time, value, color=colour, lw=1.5, label="estimate", zorder=3)
    if not np.all(np.isnan(true)):
        axes.plot(time, true, color=INK, lw=1.2, ls="--", label="truth", zorder=4)
    settled = series[0] >= np.quantile(series[0], _SETTLING)
    settled = np.insert(settled, breaks, False)
    seen = np.concatenate([value, true, low[settled], high[settled]])
    bottom, top = np.nanmin(seen), np.nanmax(seen)
    margin = 0.08 * (top - bottom) + 0.05
    axes.set_ylim(bottom - margin, top + margin)
    words = f"at last {_tenths(value[-1])} ± {sigma[-1]:.1f} m"
    if np.isfinite(true[-1]):
        words += f", truth {_tenths(true[-1])} m"
    axes.text(
        0.985, 0.95, words, transform=axes.transAxes, ha="right", va="top", fontsize=8.5,
        color=INK, zorder=5, bbox={"fc": "white", "ec": "none", "alpha": 0.75, "pad": 1.0},
    )  # fmt: skip


def _tenths(value: float) -> str:
    """A number with one decimal, never -0.0."""
    return f"{round(float(value), 1) + 0.0:.1f}"
