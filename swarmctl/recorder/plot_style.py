"""What the plots of a flight share: colours, axes over mission time, the phases' names."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from swarmctl.recorder.debrief import Debrief
from swarmctl.recorder.plot_series import Extremes, Series

INK = "#22272e"
FAINT = "#8b949e"
ESTIMATE = "#7b2cbf"
_OBSERVING = "#dcecdf"
FOLLOWERS = (
    "#0072b2", "#e08700", "#009e73", "#cc5a94", "#3fa7dc", "#8c6d1f",
    "#5b6ee1", "#6b8e23", "#b5651d", "#2f7f86", "#a05195", "#4d4d4d",
)  # fmt: skip
"""Colours of the followers, which most colour-blind eyes tell apart."""


def rows(series: Series | Extremes, columns: int) -> NDArray[np.float64]:
    """A series as an array (columns, rows), also when it is empty."""
    return np.array(series.rows, dtype=float).reshape(-1, columns).T


def vehicle_colours(debrief: Debrief) -> dict[int, str]:
    """Each vehicle's colour, the same in all plots, by system id."""
    reference = debrief.settings.reference
    followers = sorted(debrief.series.tracks.keys() - {reference})
    colours = {s: FOLLOWERS[k % len(FOLLOWERS)] for k, s in enumerate(followers)}
    return {reference: INK, **colours}


def timeline(debrief: Debrief, *titles: str) -> tuple[Figure, list[Axes]]:
    """Axes over mission time, one below the other, the observing phases shaded.

    Args:
        debrief: The flight.
        titles: Title of each.
    """
    figure = Figure(figsize=(11.0, 2.4 + 2.9 * len(titles)), layout="constrained")
    plots = list(figure.subplots(len(titles), 1, sharex=True, squeeze=False)[:, 0])
    end = max(debrief.duration_s, 1.0)
    for axes, title in zip(plots, titles, strict=True):
        dress(axes, title, pad=36 if axes is plots[0] else 8)
        axes.set_xlim(0.0, end)
        mark_phases(axes, debrief)
        for begin, until, name in phase_spans(debrief):
            if name in debrief.settings.observing_phases:
                axes.axvspan(begin, until, color=_OBSERVING, lw=0, zorder=0)
    name_phases(plots[0], debrief)
    plots[-1].set_xlabel("mission time (s)")
    return figure, plots


def _name_phase(axes: Axes, name: str, begin: float, until: float) -> None:
    """Write a phase's name where it fits; ``begin`` and ``until`` as shares of the width."""
    style: dict[str, Any] = {"transform": axes.transAxes, "fontsize": 8.5, "color": FAINT}
    if until - begin > 0.009 * len(name):
        axes.text(0.5 * (begin + until), 1.015, name, ha="center", va="bottom", **style)
    elif until - begin > 0.02:
        axes.text(
            begin + 0.008, 1.015, name, rotation=35, rotation_mode="anchor", va="bottom", **style
        )


def mark_phases(axes: Axes, debrief: Debrief) -> None:
    """Draw a line where each phase begins."""
    for begin, _, _ in phase_spans(debrief):
        axes.axvline(begin, color="#d0d7de", lw=0.8, zorder=1)


def name_phases(axes: Axes, debrief: Debrief) -> None:
    """Write the phases' names above a plot, as far as its time reaches."""
    first, last = axes.get_xlim()
    for begin, until, name in phase_spans(debrief):
        share = [(min(max(t, first), last) - first) / (last - first) for t in (begin, until)]
        _name_phase(axes, name, *share)


def phase_spans(debrief: Debrief) -> list[tuple[float, float, str]]:
    """Begin and end (mission time, s) and name of each phase."""
    phases = debrief.series.phases
    ends = [*(begin for begin, _ in phases[1:]), debrief.duration_s]
    return [(begin, end, name) for (begin, name), end in zip(phases, ends, strict=False)]


def observing_span(debrief: Debrief) -> tuple[float, float]:
    """First and last mission time of the observing phases, or of the flight without any, s."""
    observing = debrief.settings.observing_phases
    spans = [span for span in phase_spans(debrief) if span[2] in observing]
    if not spans:
        return 0.0, debrief.duration_s
    return spans[0][0], spans[-1][1]


def legend_below(figure: Figure, axes: Axes) -> None:
    """Put a legend below a figure, for the labels in one of its axes."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=7, frameon=False)


def dress(axes: Axes, title: str, pad: float = 8) -> None:
    """Set title, grid and frame of a plot; ``pad`` is the distance of the title, points."""
    axes.set_title(title, loc="left", fontsize=12, fontweight="bold", color=INK, pad=pad)
    axes.grid(visible=True, color="#e4e7ea", lw=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(colors=INK, labelsize=9)
    for side, spine in axes.spines.items():
        spine.set_visible(side in {"left", "bottom"})
        spine.set_color(FAINT)
