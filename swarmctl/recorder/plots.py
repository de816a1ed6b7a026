"""The plots of a flight. Import this only to draw: matplotlib is slow to load.

``map.png``        the flight from above, and the end of the search close up
``error.png``      how the estimate closed in on the emitter, and whether it could be believed
``slots.png``      how well the followers kept their slots
``ranges.png``     distances that have a limit
``receivers.png``  the receivers' clock and navigation errors, if any were estimated
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse
from numpy.typing import NDArray

from swarmctl.estimation.bounds.consistency import ellipse
from swarmctl.recorder.debrief import Debrief
from swarmctl.recorder.estimate_accuracy import CONVERGED_SIGMA_M
from swarmctl.recorder.plot_series import EXTREMES_INTERVAL_S, Series
from swarmctl.recorder.plot_style import (
    ESTIMATE,
    FAINT,
    FOLLOWERS,
    INK,
    dress,
    legend_below,
    observing_span,
    rows,
    timeline,
    vehicle_colours,
)
from swarmctl.recorder.receiver_plot import draw_receivers
from swarmctl.units import CHI2_95_2DOF

MAP_FILE, ERROR_FILE, SLOTS_FILE, RANGES_FILE = "map.png", "error.png", "slots.png", "ranges.png"
RECEIVERS_FILE = "receivers.png"

_EMITTER = "#c1121f"
_LIMIT = "#c1121f"
_HEALTH = {"degraded": "#f6d186", "diverged": "#eb9a97"}
"""Shades of the times at which the track was not healthy, by status."""
_LOST_S = 5.0
"""A vehicle that has been silent for this long is not drawn in the formation."""
_CLOSE_UP_S = 30.0
"""Time before the end of the observation that the close-up shows."""
_DPI = 130

_ELLIPSE_STEP = 1.9
"""An ellipse is drawn each time the estimate has become this much better."""


def write_plots(debrief: Debrief, directory: Path) -> tuple[Path, ...]:
    """Write the plots of a flight into a directory.

    Returns:
        The files written.
    """
    drawn = {
        MAP_FILE: _map(debrief),
        ERROR_FILE: _error(debrief),
        SLOTS_FILE: _slots(debrief),
        RANGES_FILE: _ranges(debrief),
    }
    receivers = draw_receivers(debrief)
    if receivers is not None:
        drawn[RECEIVERS_FILE] = receivers
    for name, figure in drawn.items():
        figure.savefig(directory / name, dpi=_DPI)
    return tuple(directory / name for name in drawn)


# --- The flight from above ---------------------------------------------------------------


def _map(debrief: Debrief) -> Figure:
    figure = Figure(figsize=(13.0, 7.4), layout="constrained")
    wide, close = figure.subplots(1, 2, width_ratios=(1.6, 1.0))
    _draw_flight(wide, debrief)
    wide.set_aspect("equal", adjustable="datalim")
    _draw_end(close, debrief)
    close.set_aspect("equal", adjustable="box", anchor="N")
    for axes, title in ((wide, "The flight"), (close, f"The last {_CLOSE_UP_S:g} s of observing")):
        axes.set_xlabel("east (m)")
        axes.set_ylabel("north (m)")
        dress(axes, title)
    handles, labels = wide.get_legend_handles_labels()
    close.legend(
        handles, labels, loc="upper left", bbox_to_anchor=(0.0, -0.13), ncols=2, frameon=False
    )
    return figure


def _draw_flight(axes: Axes, debrief: Debrief) -> None:
    series, settings = debrief.series, debrief.settings
    begin, end = observing_span(debrief)
    for sysid, colour in vehicle_colours(debrief).items():
        if sysid not in series.tracks:
            continue
        time, east, north, _ = rows(series.tracks[sysid], 4)
        role = "reference" if sysid == settings.reference else "UAV"
        axes.plot(east, north, color=colour, lw=0.8, alpha=0.4, zorder=3)
        at = (time >= begin) & (time <= end)
        axes.plot(east[at], north[at], color=colour, lw=1.6, label=f"{role} {sysid}", zorder=3)
        x, y, _ = series.launches[sysid]
        axes.plot(x, y, "s", color=colour, ms=4.5, mec="white", mew=0.6, zorder=4)
    _draw_formations(axes, debrief)

    time, east, north, ee, en, nn = rows(series.estimates, 6)
    at = time <= end
    axes.plot(east[at], north[at], color=ESTIMATE, lw=0.9, alpha=0.6, label="estimate", zorder=5)
    label = "95 % of the estimate"
    for k in _improvements(ee, en, nn):
        _ellipse(axes, (east[k], north[k]), (ee[k], en[k], nn[k]), label=label)
        label = "_"
    prior = np.asarray(settings.prior_covariance, dtype=float)
    horizontal = prior[0, 0], prior[0, 1], prior[1, 1]
    _ellipse(axes, settings.prior_mean, horizontal, label="95 % of the prior", ls=":", fill=0.0)

    final, estimate = debrief.final, debrief.final_estimate
    if final is not None:
        x, y, _ = final.emitter
        time, east, north, _ = rows(series.truth, 4)
        at = time <= end
        axes.plot(east[at], north[at], color=_EMITTER, lw=2.0, zorder=6)
        axes.plot(x, y, "*", color=_EMITTER, ms=13, mec="white", label="true emitter", zorder=8)
    if estimate is not None:
        x, y, _ = estimate.position_enu if final is None else final.emitter
        radius, label = settings.stand_off_m, f"stand-off {settings.stand_off_m:g} m"
        axes.add_patch(Circle((x, y), radius, fill=False, ec=_LIMIT, ls="--", lw=1.1, label=label))


def _draw_formations(axes: Axes, debrief: Debrief) -> None:
    """The formation at a few instants of the observing phases, as spokes from the reference."""
    series = debrief.series
    begin, end = observing_span(debrief)
    if end <= begin:
        return
    colours = vehicle_colours(debrief)
    for instant in np.linspace(begin, end, 5):
        leading = [sysid for since, sysid in series.references if since <= instant]
        at = {
            sysid: _track_at(track, instant)
            for sysid, track in series.tracks.items()
            if track.rows[-1][0] > instant - _LOST_S
        }
        if not leading or leading[-1] not in at:
            continue
        x0, y0 = at[leading[-1]]
        for sysid, (x, y) in at.items():
            axes.plot((x0, x), (y0, y), color=FAINT, lw=0.8, zorder=2)
            axes.plot(x, y, "o", color=colours[sysid], ms=5.5, mec="white", mew=0.8, zorder=7)
        axes.annotate(
            f"{instant:.0f} s", (x0, y0), xytext=(7, -11), textcoords="offset points",
            fontsize=8, color=INK, zorder=9,
            bbox={"fc": "white", "ec": "none", "alpha": 0.75, "pad": 0.6},
        )  # fmt: skip


def _draw_end(axes: Axes, debrief: Debrief) -> None:
    """Truth and estimate at the end of observing, at the scale of the last ellipse."""
    series, final, estimate = debrief.series, debrief.final, debrief.final_estimate
    if estimate is None:
        axes.text(0.5, 0.5, "no estimate", color=FAINT, ha="center", transform=axes.transAxes)
        return
    _, end = observing_span(debrief)
    at = estimate.position_enu[:2]
    covariance = estimate.covariance[0], estimate.covariance[1], estimate.covariance[7]
    reach = 1.5 * math.sqrt(CHI2_95_2DOF) * _major(*covariance)
    words = f"1-sigma {_major(*covariance):.1f} m"
    time, east, north, *_ = rows(series.estimates, 6)
    past = (time > end - _CLOSE_UP_S) & (time <= end)
    axes.plot([*east[past], at[0]], [*north[past], at[1]], color=ESTIMATE, lw=0.9, alpha=0.45)
    _ellipse(axes, at, covariance)
    axes.plot(*at, "o", color=ESTIMATE, ms=7, mec="white", zorder=7)
    if final is not None:
        true = final.emitter[:2]
        time, east, north, _ = rows(series.truth, 4)
        past = (time > end - _CLOSE_UP_S) & (time < end)
        axes.plot([*east[past], true[0]], [*north[past], true[1]], color=_EMITTER, lw=1.6)
        axes.plot((at[0], true[0]), (at[1], true[1]), color=INK, lw=1.0, ls=":", zorder=6)
        axes.plot(*true, "*", color=_EMITTER, ms=16, mec="white", zorder=8)
        reach = max(reach, 1.3 * final.error_m)
        words += f", error {final.error_m:.1f} m"
    axes.text(0.03, 0.03, words, transform=axes.transAxes, color=INK)
    axes.set_xlim(at[0] - reach, at[0] + reach)
    axes.set_ylim(at[1] - reach, at[1] + reach)


def _ellipse(
    axes: Axes,
    centre: Sequence[float],
    covariance: tuple[float, float, float],
    *,
    label: str = "_",
    ls: str = "-",
    fill: float = 0.07,
) -> None:
    ee, en, nn = covariance
    shape = ellipse(np.array([[ee, en], [en, nn]]))
    scale = 2.0 * math.sqrt(CHI2_95_2DOF)
    axes.add_patch(
        Ellipse(
            (centre[0], centre[1]), scale * float(shape.major), scale * float(shape.minor),
            angle=math.degrees(float(shape.angle_rad)), fc=(*_rgb(ESTIMATE), fill),
            ec=ESTIMATE, lw=0.9, ls=ls, label=label, zorder=4,
        )
    )  # fmt: skip


def _rgb(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return red, green, blue


def _improvements(
    ee: NDArray[np.float64], en: NDArray[np.float64], nn: NDArray[np.float64]
) -> list[int]:
    """Indices at which the estimate has become ``_ELLIPSE_STEP`` times better."""
    chosen: list[int] = []
    best = math.inf
    for k, covariance in enumerate(zip(ee, en, nn, strict=True)):
        axis = _major(*covariance)
        if axis * _ELLIPSE_STEP <= best:
            chosen.append(k)
            best = axis
    return chosen


def _major(ee: float, en: float, nn: float) -> float:
    return float(ellipse(np.array([[ee, en], [en, nn]])).major)


def _track_at(track: Series, time_s: float) -> tuple[float, float]:
    time, east, north, _ = rows(track, 4)
    return float(np.interp(time_s, time, east)), float(np.interp(time_s, time, north))


# --- Plots against mission time ----------------------------------------------------------


def _error(debrief: Debrief) -> Figure:
    figure, (axes,) = timeline(debrief, "How the estimate closed in on the emitter")
    series = debrief.series
    named: set[str] = set()
    for begin, end, status in debrief.health_spans:
        if status in _HEALTH:
            label = f"track {status}" if status not in named else "_"
            axes.axvspan(begin, end, color=_HEALTH[status], lw=0, zorder=0.5, label=label)
            named.add(status)
    axes.plot(*rows(series.sigmas, 2), color=ESTIMATE, lw=1.8, label="1-sigma it claims")
    axes.plot(*rows(series.errors, 2), color=INK, lw=1.0, label="its horizontal error")
    axes.plot(
        *rows(series.bounds, 2), color=FOLLOWERS[0], lw=1.8, ls="--", label="Cramér-Rao bound"
    )
    _log_scale(axes, "metres")
    _limit(axes, CONVERGED_SIGMA_M, f"converged below {CONVERGED_SIGMA_M:g} m", FAINT)
    legend_below(figure, axes)
    return figure


def _slots(debrief: Debrief) -> Figure:
    figure, (axes,) = timeline(debrief, "How the followers kept their slots")
    colours = vehicle_colours(debrief)
    for sysid, series in sorted(debrief.series.slot_errors.items()):
        colour = colours.get(sysid, FAINT)
        axes.plot(*rows(series, 2), color=colour, lw=1.2, label=f"UAV {sysid}")
    _log_scale(axes, f"distance from slot (m), worst in {EXTREMES_INTERVAL_S:g} s")
    legend_below(figure, axes)
    return figure


def _ranges(debrief: Debrief) -> Figure:
    figure, (upper, lower) = timeline(
        debrief, "Followers from the reference UAV", "Nearest UAV from the true emitter"
    )
    settings, colours = debrief.settings, vehicle_colours(debrief)
    for sysid, series in sorted(debrief.series.ranges.items()):
        colour = colours.get(sysid, FAINT)
        upper.plot(*rows(series, 2), color=colour, lw=1.2, label=f"UAV {sysid}")
    _limit(upper, settings.d_max_m, f"at most {settings.d_max_m:g} m while observing", _LIMIT)
    lower.plot(*rows(debrief.series.standoffs, 2), color=INK, lw=1.4)
    _limit(lower, settings.stand_off_m, f"at least {settings.stand_off_m:g} m", _LIMIT)
    for axes in (upper, lower):
        axes.set_ylabel("distance (m)")
        axes.set_ylim(0.0, 1.1 * axes.get_ylim()[1])
    legend_below(figure, upper)
    return figure


def _limit(axes: Axes, value: float, text: str, colour: str) -> None:
    axes.axhline(value, color=colour, lw=1.1, ls="--")
    axes.annotate(
        text, (0.995, value), xycoords=axes.get_yaxis_transform(), xytext=(0, 3),
        textcoords="offset points", ha="right", va="bottom", fontsize=8.5, color=colour,
        zorder=1.9,
    )  # fmt: skip


def _log_scale(axes: Axes, label: str) -> None:
    axes.set_yscale("log")
    axes.set_ylabel(label)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.grid(visible=True, which="minor", axis="y", color="#eef0f2", lw=0.5)
