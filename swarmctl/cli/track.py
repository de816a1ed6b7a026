"""``swarmctl track``: tracks a data set of any TDOA system. Parses and prints."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer
from rich import box
from rich.console import Console
from rich.table import Table

from swarmctl.errors import UsageError

if TYPE_CHECKING:
    from swarmctl.datasets.accuracy import TrackingSummary


class FilterName(StrEnum):
    """The filters to choose from."""

    TRACKER = "tracker"
    EKF = "ekf"


def track(
    receivers: Annotated[
        Path, typer.Option("--receivers", help="receiver,east_m,north_m,up_m[,time_s]")
    ],
    measurements: Annotated[
        Path, typer.Option("--measurements", help="time_s,receiver_i,receiver_j,rd_m[,sigma_m]")
    ],
    out: Annotated[Path, typer.Option("--out", help="Directory for the results.")],
    truth: Annotated[
        Path | None, typer.Option("--truth", help="time_s,east_m,north_m,up_m")
    ] = None,
    name: Annotated[
        FilterName, typer.Option("--filter", help="ekf: white noise only, to compare with.")
    ] = FilterName.TRACKER,
    sigma: Annotated[
        float,
        typer.Option("--sigma", help="White 1-sigma of a range difference without sigma_m, m."),
    ] = 0.1,
    colour: Annotated[
        float,
        typer.Option("--colour", help="1-sigma of the correlated error (multipath), m; 0: none."),
    ] = 0.2,
    tau: Annotated[
        float, typer.Option("--tau", help="Correlation time of the correlated error, s.")
    ] = 0.5,
    rho: Annotated[
        float,
        typer.Option("--rho", help="Share of the white variance from each receiver, 0 to 0.5."),
    ] = 0.5,
    clock_bias: Annotated[
        float, typer.Option("--clock-bias", help="1-sigma of a receiver's clock, m; 0: good ones.")
    ] = 0.0,
    clock_drift: Annotated[
        float, typer.Option("--clock-drift", help="1-sigma of a receiver's clock drift, m/s.")
    ] = 0.0,
    navigation: Annotated[
        float,
        typer.Option("--navigation", help="1-sigma of receivers' positions per axis, m; 0: exact."),
    ] = 0.0,
    navigation_tau: Annotated[
        float,
        typer.Option("--navigation-tau", help="Correlation time of that error, s."),
    ] = 60.0,
    process_noise: Annotated[
        float,
        typer.Option("--process-noise", help="Density of the emitter's acceleration, m²/s³."),
    ] = 0.2,
    speed: Annotated[
        float,
        typer.Option("--speed", help="1-sigma of its first velocity per axis, m/s."),
    ] = 1.0,
    at: Annotated[
        str | None,
        typer.Option(
            "--at",
            metavar="E,N,U",
            help="Where the emitter begins, m (default: amid the receivers).",
        ),
    ] = None,
    within: Annotated[
        float | None,
        typer.Option(
            "--within",
            help="The emitter begins this near to --at along each axis, 95 % sure, m"
            " (default: four apertures).",
        ),
    ] = None,
    height: Annotated[
        float | None,
        typer.Option("--height", help="Height of the emitter if known, m (2-D)."),
    ] = None,
) -> None:
    """Track the emitter in a data set of any TDOA system: radio, UWB, acoustic."""
    from swarmctl.datasets.track_files import track_files  # noqa: PLC0415
    from swarmctl.datasets.tracking import Assumptions  # noqa: PLC0415 - loads numpy

    assumed = Assumptions(
        sigma_m=sigma,
        colour_m=colour,
        tau_s=tau,
        rho=rho,
        clock_bias_m=clock_bias,
        clock_drift_mps=clock_drift,
        navigation_m=navigation,
        navigation_tau_s=navigation_tau,
        process_noise=process_noise,
        speed_mps=speed,
        at=None if at is None else _position(at),
        within_m=within,
        height_m=height,
    )
    summary = track_files(receivers, measurements, truth, out, name=name.value, assumed=assumed)
    _print(summary)
    typer.echo(f"estimates.csv, summary.json, track.png and error.png are in {out}")


def _position(text: str) -> tuple[float, float, float]:
    try:
        east, north, up = (float(part) for part in text.split(","))
    except ValueError:
        east = north = up = math.nan
    if not math.isfinite(east + north + up):
        raise UsageError(f"--at is {text!r}; three numbers E,N,U in metres would be right.")
    return east, north, up


_SHOWN = (
    ("duration", "duration_s", "{:.1f} s"),
    ("faster than real time", "times_real_time", "{:.1f} x"),
    ("first estimate after", "first_estimate_s", "{:.2f} s"),
    ("range differences rejected", "share_rejected", "{:.1%}"),
    ("left out: repeated", "repeated", "{}"),
    ("left out: no receiver position", "without_receiver_position", "{}"),
    ("begun again", "restarts", "{}"),
    ("mean NIS per row (1 is right)", "mean_nis", "{:.2f}"),
    ("RMSE", "rmse_m", "{:.3g} m"),
    ("median error", "median_error_m", "{:.3g} m"),
    ("mean NEES", "mean_nees", "{:.2f}"),
    ("median NEES", "median_nees", "{:.2f}"),
    ("degrees of freedom", "nees_dof", "{}"),
    ("lost", "share_lost", "{:.1%}"),
)


def _print(summary: TrackingSummary) -> None:
    figures = summary.figures
    shown = Table(box=box.SIMPLE, pad_edge=False, show_header=False)
    shown.add_column()
    shown.add_column(justify="right")
    for label, key, form in _SHOWN:
        value = getattr(figures, key)
        if value is not msgspec.UNSET:
            shown.add_row(label, "-" if value is None else form.format(value))
    for status, share in figures.health.items():
        shown.add_row(status, f"{share:.1%}")
    console = Console(highlight=False)
    console.print(shown)
    for finding in summary.wrong:
        console.print(f"{finding.share:.1%} of the time: {finding.sentence}", markup=False)
