"""What the operator sees of a flight: a live console, or one line every few seconds."""

from __future__ import annotations

import math
from collections import deque
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from swarmctl.mission.phases import Phase
from swarmctl.results import MissionResult

if TYPE_CHECKING:  # their modules load numpy and scipy
    from swarmctl.decisions import Notice
    from swarmctl.mission.mission_file import Mission
    from swarmctl.mission.snapshot import Snapshot, VehicleSnapshot
    from swarmctl.recorder.summary import FlightSummary

NOTICES_SHOWN = 5
LIVE_EVERY_S = 0.25
HEADLESS_EVERY_S = 3.0
_STYLES = {"info": "default", "warning": "yellow", "error": "bold red"}


class Reporter:
    """Shows a flight: live on a terminal, line by line where there is none.

    Args:
        mission: The mission.
        headless: Print lines even on a terminal.
    """

    def __init__(self, mission: Mission, *, headless: bool) -> None:
        self._console = Console(highlight=False)
        self._live = (
            Live(console=self._console, refresh_per_second=4, screen=True)
            if self._console.is_terminal and not headless
            else None
        )
        self._title = mission.description or mission.name
        self._notices: deque[Notice] = deque(maxlen=NOTICES_SHOWN)

    @property
    def every_s(self) -> float:
        """How often, in wall time, a snapshot is wanted, s."""
        return LIVE_EVERY_S if self._live is not None else HEADLESS_EVERY_S

    def __enter__(self) -> Reporter:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._live is not None:
            self._live.stop()
            for notice in self._notices:
                self._print(notice)

    def snapshot(self, snapshot: Snapshot) -> None:
        """Show a snapshot."""
        if self._live is not None:
            self._live.update(render(snapshot, self._title, list(self._notices)))
        else:
            self._console.print(headless_line(snapshot), soft_wrap=True, markup=False)

    def notice(self, notice: Notice) -> None:
        """Show a sentence for the operator."""
        self._notices.append(notice)
        if self._live is None:
            self._print(notice)

    def _print(self, notice: Notice) -> None:
        text = f"[{notice.at_s:5.0f} s] {notice.level}: {notice.text}"
        self._console.print(Text(text, style=_STYLES[notice.level]), soft_wrap=True)


_HEALTH: dict[str, str] = {
    "initialising": "yellow",
    "tracking": "green",
    "degraded": "yellow",
    "diverged": "bold red",
}


def headless_line(snapshot: Snapshot) -> str:
    """One line: time, phase, progress, estimate, formation."""
    parts = [f"[{snapshot.elapsed_s:5.0f} s] {snapshot.phase:<11} {snapshot.progress}"]
    estimate = snapshot.estimate
    if estimate.rd_count:
        parts.append(
            f"emitter ± {estimate.sigma_major_m:.1f} m (1σ), NIS {estimate.nis:.1f}"
            f" of {estimate.rd_count}, {snapshot.rd_rate_hz:.0f} RD/s, {estimate.health},"
            f" limited by {estimate.limit}"
        )
    errors = [v.slot_error_m for v in snapshot.vehicles if v.slot_error_m is not None]
    ranges = [
        v.range_to_reference_m for v in snapshot.vehicles if v.range_to_reference_m is not None
    ]
    if errors and ranges:
        parts.append(
            f"slots ≤ {max(errors):.1f} m, ranges ≤ {max(ranges):.0f} of {snapshot.d_max_m:.0f} m"
        )
    return " | ".join(parts)


def render(snapshot: Snapshot, title: str, notices: list[Notice]) -> RenderableType:
    """The live console's content."""
    head = Text.assemble(
        (f" {snapshot.phase.upper()} ", "bold white on blue"),
        f"  {snapshot.progress}",
        (f"   {snapshot.elapsed_s:.0f} s", "dim"),
    )
    parts: list[RenderableType] = [_phase_bar(snapshot.phase), head, _vehicles(snapshot)]
    parts.append(_estimate(snapshot))
    parts += [Text(f"• {notice.text}", style=_STYLES[notice.level]) for notice in notices]
    return Panel(Group(*parts), title=f"swarmctl · {title}", title_align="left")


def _phase_bar(current: str) -> Text:
    text, passed = Text(), True
    for phase in Phase:
        is_current = phase == current
        passed = passed and not is_current
        style = "bold cyan" if is_current else "green" if passed else "dim"
        text.append(f"{'●' if is_current or passed else '○'} {phase}  ", style=style)
    return text


def _vehicles(snapshot: Snapshot) -> Table:
    table = Table(expand=True, box=None, padding=(0, 1))
    for name in ("UAV", "mode", "altitude", "slot error", "range to reference", "battery", "link"):
        table.add_column(name, justify="left" if name in {"UAV", "mode", "link"} else "right")
    for vehicle in snapshot.vehicles:
        table.add_row(
            f"{vehicle.sysid} reference" if vehicle.is_reference else str(vehicle.sysid),
            Text(vehicle.mode or "-", style="green" if vehicle.armed else "dim"),
            _number(vehicle.alt_amsl_m, "{:.0f} m AMSL"),
            _limited(vehicle.slot_error_m, 3.0, 6.0, "{:.1f} m"),
            _range(vehicle, snapshot.d_max_m),
            _number(vehicle.battery_fraction, "{:.0%}"),
            _link(vehicle),
        )
    return table


def _estimate(snapshot: Snapshot) -> Text:
    estimate = snapshot.estimate
    text = Text("emitter  ", style="bold")
    text.append(
        f"{math.degrees(estimate.lat_rad):.5f}°, {math.degrees(estimate.lon_rad):.5f}°   1σ"
        f" {estimate.sigma_major_m:.1f} x {estimate.sigma_minor_m:.1f} m"
    )
    if not estimate.rd_count:
        text.append("   prior only: nothing measured yet", style="yellow")
        return text
    text.append(f"   NIS {estimate.nis:.1f} of {estimate.rd_count}")
    text.append(
        f"   {snapshot.rd_rate_hz:.0f} RD/s", style="green" if estimate.age_s < 2 else "red"
    )
    text.append(
        f"   {snapshot.rd_used} used, {snapshot.rd_aside} set aside as echoes,"
        f" {snapshot.rd_dropped} dropped",
        style="dim",
    )
    text.append(f"\n{estimate.health:<9}", style=_HEALTH[estimate.health])
    text.append(f"limited by {estimate.limit}")
    if estimate.health in {"degraded", "diverged"}:
        text.append(f"   {estimate.why}", style=_HEALTH[estimate.health])
    return text


def _number(value: float | None, pattern: str) -> str:
    return pattern.format(value) if value is not None else "-"


def _limited(value: float | None, good: float, bad: float, pattern: str) -> Text:
    if value is None:
        return Text("-")
    style = "green" if value <= good else "yellow" if value <= bad else "red"
    return Text(pattern.format(value), style=style)


def _range(vehicle: VehicleSnapshot, d_max_m: float) -> Text:
    pattern = f"{{:.0f}} of {d_max_m:.0f} m"
    return _limited(vehicle.range_to_reference_m, 0.97 * d_max_m, d_max_m, pattern)


def _link(vehicle: VehicleSnapshot) -> Text:
    if math.isinf(vehicle.silence_s):
        return Text("never heard", style="yellow")
    if vehicle.silence_s > 2.0:
        return Text(f"silent {vehicle.silence_s:.0f} s", style="red")
    latency = f", {vehicle.rtt_s * 1e3:.0f} ms" if vehicle.rtt_s is not None else ""
    return Text(f"{vehicle.rate_hz:.0f}/s, {vehicle.loss:.1%} lost{latency}", style="green")


_SUMMARY_ROWS = (
    ("final_error_m", "error of the final estimate", "{:.2f} m"),
    ("final_sigma_m", "its 1-sigma, larger axis", "{:.2f} m"),
    ("pcrb_final_m", "Cramér-Rao bound of the flown geometry", "{:.2f} m"),
    ("nees_mean", "mean position NEES (2 is right)", "{:.2f}"),
    ("slot_error_rms_m", "slot error of the followers, RMS", "{:.2f} m"),
    ("max_reference_range_m", "greatest range to the reference", "{:.1f} m"),
    ("min_separation_m", "least separation", "{:.1f} m"),
    ("min_standoff_m", "least distance from the emitter", "{:.1f} m"),
    ("duration_s", "mission time", "{:.0f} s"),
)


def print_summary(summary: FlightSummary, out: Path) -> None:
    """Print what came of a flight."""
    console = Console(highlight=False)
    good = summary.result is MissionResult.LOCATED
    console.print()
    console.print(
        Text.assemble(
            (f"{summary.result}", "bold green" if good else "bold red"),
            f": {summary.detail}",
        ),
        soft_wrap=True,
    )
    table = Table(box=None, show_header=False, padding=(0, 1))
    for key, label, pattern in _SUMMARY_ROWS:
        value = getattr(summary, key)
        if value is not None:
            table.add_row(label, pattern.format(value))
    wall_s, speedup = summary.wall_s, summary.duration_s / summary.wall_s
    table.add_row("wall time", f"{wall_s:.1f} s, {speedup:.0f} x real time")
    console.print(table)
    console.print(f"recording, plots and summary.json: {out}", soft_wrap=True)
