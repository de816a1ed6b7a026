"""The tables that ``swarmctl study`` prints."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from swarmctl.study import consistency, track_consistency, track_health
    from swarmctl.study.tally import Interval


def print_consistency_case(title: str, rows: list[consistency.FilterRow]) -> None:
    """One case: the filters, each with its figures over time."""
    times = [f"{instant.time_s:g} s" for instant in rows[0].instants]
    shown = table(title, ["filter", "", *times])
    for row in rows:
        judged = row.shortfalls is not None
        shown.add_row(
            row.filter, "RMSE/bound", *(_figure(i.ratio_cv, judged) for i in row.instants)
        )
        shown.add_row("", "mean NEES", *(_figure(i.nees, judged) for i in row.instants))
        shown.add_row("", "lost", *[""] * (len(times) - 1), f"{row.lost}/{row.runs}")
    shown.add_row("bound, CV", "m", *(f"{i.cv_bound_m:.3g}" for i in rows[0].instants))
    shown.add_row("bound, CA", "m", *(f"{i.ca_bound_m:.3g}" for i in rows[0].instants))
    Console().print(shown)


def print_track_case(title: str, rows: list[track_consistency.TrackRow]) -> None:
    """One case of the track study, time after time, and what it asks for besides."""
    shown = Table(title=title, title_justify="left", box=box.SIMPLE, padding=(0, 1, 0, 0))
    for name in ("at", "", "bound (m)", *(row.filter for row in rows)):
        shown.add_column(
            name, justify="right" if name else "left", overflow="fold", no_wrap=not name
        )
    for k, instant in enumerate(rows[0].instants):
        figures = [(row.instants[k], row.shortfalls is not None) for row in rows]
        ratios = (_figure(i.ratio, judged) for i, judged in figures)
        shown.add_row(f"{instant.time_s:g} s", "RMSE/bound", f"{instant.bound_m:.3g}", *ratios)
        shown.add_row("", "mean NEES", "", *(_figure(i.nees, judged) for i, judged in figures))
    shown.add_row("", "lost", "", *(f"{row.lost}/{row.runs}" for row in rows))
    Console().print(shown)
    for measure in rows[0].measures:
        low, high = measure.figure.low, measure.figure.high
        interval = f" ({low:.3g} to {high:.3g})" if low < high else ""
        Console().print(f"{measure.name}: {measure.figure.value:.3g}{interval}", highlight=False)


def print_health(rows: list[track_health.HealthRow]) -> None:
    """What the track's health says of each fault."""
    shown = Table(
        title="health: what is said of a feed that goes wrong",
        title_justify="left",
        box=box.SIMPLE,
        padding=(0, 1, 0, 0),
    )
    for name in ("fault", "named as", "within 5 s", "latest (s)", "false/h", "in hours"):
        shown.add_column(name, overflow="fold")
    for row in rows:
        shown.add_row(
            row.fault,
            ", ".join(f"{cause} ({count})" for cause, count in row.causes.items()),
            "" if row.named is None else f"{row.named.value:.1%}",
            "" if row.named is None else f"{row.latest_s:.1f}",
            f"{row.false_alarms.value:.2g}",
            f"{row.hours:.2g}",
        )
    Console().print(shown)


def _figure(figure: Interval, with_interval: bool) -> str:
    if not with_interval:
        return f"{figure.value:.3g}"
    return f"{figure.value:.2f}±{0.5 * (figure.high - figure.low):.2f}"


def table(title: str, columns: list[str]) -> Table:
    """An empty one; its first two columns are words."""
    shown = Table(
        title=title, title_justify="left", box=box.SIMPLE, pad_edge=False, padding=(0, 1, 0, 0)
    )
    for index, column in enumerate(columns):
        shown.add_column(column, justify="right" if index > 1 else "left", no_wrap=True)
    return shown
