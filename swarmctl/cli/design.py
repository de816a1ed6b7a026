"""``swarmctl design``: the best formation for given noise and range. Parses and prints."""

from __future__ import annotations

import json
import math
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from swarmctl.errors import UsageError

if TYPE_CHECKING:
    from swarmctl.formation.design_report import DesignReport


class ObjectiveName(StrEnum):
    """What a formation is judged by."""

    RMS = "rms"
    DETERMINANT = "determinant"
    TRACK = "track"


def design(
    n: Annotated[int, typer.Option("--n", help="Companions, the reference UAV not counted.")] = 3,
    d_max: Annotated[float, typer.Option("--d-max", help="Greatest distance, m.")] = 300.0,
    range_m: Annotated[float, typer.Option("--range", help="Range to the emitter, m.")] = 5000.0,
    sigma_r: Annotated[
        float, typer.Option("--sigma-r", help="1-sigma of a range difference, m.")
    ] = 0.5,
    sigma_p: Annotated[
        float, typer.Option("--sigma-p", help="1-sigma of a UAV position per axis, m.")
    ] = 0.5,
    rho: Annotated[
        float, typer.Option("--rho", help="Share of sigma-r² from the reference receiver.")
    ] = 0.5,
    name: Annotated[str, typer.Option("--design", help="Which one to show.")] = "optimal",
    objective: Annotated[
        ObjectiveName, typer.Option("--objective", help="What the optimal design minimises.")
    ] = ObjectiveName.RMS,
    separation: Annotated[
        float, typer.Option("--separation", help="Least distance of two UAVs, m.")
    ] = 10.0,
    sector: Annotated[
        float, typer.Option("--sector", help="Half sector of the LOS for worst_case, deg.")
    ] = 30.0,
    ahead: Annotated[
        bool, typer.Option("--ahead", help="Axis slots ahead of the reference, not behind.")
    ] = False,
    time_s: Annotated[float, typer.Option("--time", help="Time that is measured, s.")] = 10.0,
    rate_hz: Annotated[float, typer.Option("--rate", help="Measurements a second, Hz.")] = 10.0,
    speed: Annotated[
        float, typer.Option("--speed", help="Speed of the approach, for --objective track, m/s.")
    ] = 10.0,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Draw the design into this PNG.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show where the companions should stand, and what that is worth."""
    from swarmctl.formation.design_report import objective_named, report  # noqa: PLC0415 - loads scipy
    from swarmctl.formation.requirements import Noise, Requirements  # noqa: PLC0415

    requirements = Requirements(
        companions=n,
        max_slot_distance_m=d_max,
        separation_m=separation,
        range_m=range_m,
        noise=Noise(sigma_r, sigma_p, rho),
        ahead=ahead,
        sector_rad=math.radians(sector),
    )
    found = report(
        requirements,
        objective_named(
            objective.value, requirements, time_s=time_s, rate_hz=rate_hz, speed_mps=speed
        ),
        name,
        time_s=time_s,
        rate_hz=rate_hz,
    )
    if plot is not None:
        from swarmctl.study import design_plot  # noqa: PLC0415 - loads matplotlib

        try:
            design_plot.draw_design(found, requirements, plot)
        except (OSError, ValueError) as error:
            raise UsageError(f"--plot {plot} cannot be written: {error}.") from error
    if as_json:
        typer.echo(json.dumps(_document(found, objective), indent=1))
    else:
        _print(found, objective)


def _document(found: DesignReport, objective: ObjectiveName) -> dict[str, object]:
    return {
        "design": found.name,
        "objective": objective.value,
        "slots": [
            {"theta_rad": theta, "d_m": d, "along_m": along, "cross_m": cross}
            for (theta, d), (along, cross) in zip(
                found.design.tolist(), found.slots_m.tolist(), strict=True
            )
        ],
        "predicted": {
            "sigma_along_m": _finite(found.sigma_along_m),
            "sigma_cross_m": _finite(found.sigma_cross_m),
            "time_s": found.time_s,
            "rate_hz": found.rate_hz,
            "objective_m": _finite(found.objective_m),
        },
        "compared": {name: _finite(ratio) for name, ratio in found.compared.items()},
        "unfit": found.unfit,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _print(found: DesignReport, objective: ObjectiveName) -> None:
    console = Console(highlight=False)
    console.print(f"{found.name}:")
    slots = Table("companion", box=box.SIMPLE, pad_edge=False)
    for column in ("theta (deg)", "d (m)", "along LOS (m)", "across (m)"):
        slots.add_column(column, justify="right")
    for j, ((theta, d), (along, cross)) in enumerate(
        zip(found.design.tolist(), found.slots_m.tolist(), strict=True), start=1
    ):
        slots.add_row(
            str(j), f"{math.degrees(theta):.1f}", f"{d:.1f}", f"{along:.1f}", f"{cross:.1f}"
        )
    console.print(slots)
    if math.isfinite(found.sigma_along_m):
        console.print(
            f"1-sigma after {found.time_s:g} s at {found.rate_hz:g} Hz: {found.sigma_along_m:.3g} m"
            f" along the line of sight, {found.sigma_cross_m:.3g} m across."
        )
    else:
        console.print("From one place these range differences do not tell where the emitter is.")
    if math.isnan(found.compared["optimal"]):
        return
    console.print(f"\n{objective.value} of each design, over that of optimal:")
    compared = Table(box=box.SIMPLE, pad_edge=False)
    compared.add_column("design")
    compared.add_column("ratio", justify="right")
    for name, ratio in found.compared.items():
        compared.add_row(name, f"{ratio:.3f}")
    console.print(compared)
    for name, why in found.unfit.items():
        console.print(f"{name} does not fit: {why}", markup=False)
