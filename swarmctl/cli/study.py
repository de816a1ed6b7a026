"""``swarmctl study``: Monte Carlo studies of estimators. Parses, wires, prints."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from swarmctl.cli import study_tables
from swarmctl.errors import UsageError

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from swarmctl.study.appendix_b import InformationStudy

app = typer.Typer(help="Monte Carlo studies: the paper's simulation, consistency, information.")

RunsOption = Annotated[int, typer.Option("--runs", min=2, help="Monte Carlo runs.")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="Seed of all draws.")]
OutOption = Annotated[Path, typer.Option("--out", help="Folder for figures and numbers.")]
WorkersOption = Annotated[
    int, typer.Option("--workers", min=1, help="Processes to spread the runs over.")
]
ExecutorOption = Annotated[
    str | None, typer.Option("--executor", help="A dask cluster instead, dask://host:port.")
]
WithOption = Annotated[
    list[Path] | None,
    typer.Option("--with", metavar="FILE.py", help="Registers filters or formations of yours."),
]
CaseOption = Annotated[
    list[str] | None,
    typer.Option("--case", help="Only this case; may be repeated (default: all)."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]


@app.command()
def table1(
    runs: RunsOption = 200,
    seed: SeedOption = 0,
    out: OutOption = Path("study-table1"),
    rho: Annotated[
        float,
        typer.Option("--rho", min=0.0, max=0.999, help="Noise share of the reference receiver."),
    ] = 0.0,
    workers: WorkersOption = 1,
    executor: ExecutorOption = None,
    files: WithOption = None,
) -> None:
    """Reproduce the paper's Table 1: Figs. 2-9, with the Cramér-Rao bound and the NEES."""
    from swarmctl.study import plots  # noqa: PLC0415 - loads matplotlib
    from swarmctl.study import table1 as study  # noqa: PLC0415 - loads scipy
    from swarmctl.study.registry import standard_registry  # noqa: PLC0415 - loads scipy

    registry = standard_registry(files or [])
    _make(out)
    with _flying(workers, executor, files) as (pool, progress):
        table = study.run_table1(
            registry, runs=runs, seed=seed, rho=rho, executor=pool, on_progress=progress
        )
    study.write_table1(table, out)
    plots.draw_table1(table, out)
    epochs = [round(t / table.campaign.engagement.period_s) for t in study.TIMES_S]
    for formation, result in table.results.items():
        shown = study_tables.table(
            formation, ["filter", "", *(f"{time_s:g} s" for time_s in study.TIMES_S)]
        )
        for name, tally in result.tallies.items():
            shown.add_row(name, "RMSE (m)", *(f"{tally.rmse[k]:.3g}" for k in epochs))
            shown.add_row("", "mean NEES", *(f"{tally.mean_nees[k]:.3g}" for k in epochs))
        for name, bound in (("CA", result.ca_bound), ("CV", result.cv_bound)):
            shown.add_row(f"bound, {name}", "m", *(f"{bound.rmse[k]:.3g}" for k in epochs))
        Console().print(shown)
    typer.echo(f"{runs} runs, seed {seed}; figures, table1.csv and table1.json in {out}")


@app.command()
def consistency(
    runs: RunsOption = 500,
    seed: SeedOption = 0,
    case: CaseOption = None,
    as_json: JsonOption = False,
    workers: WorkersOption = 1,
    executor: ExecutorOption = None,
    files: WithOption = None,
) -> None:
    """Compare the filters in white noise with the Cramér-Rao bound.

    Error over the bound, and NEES, with 95 % confidence intervals.
    """
    from swarmctl.study import consistency as study  # noqa: PLC0415 - loads scipy
    from swarmctl.study.registry import standard_registry  # noqa: PLC0415 - loads scipy

    cases = _chosen(case, study.CASES)
    registry = standard_registry(files or [])
    with _flying(workers, executor, files) as (pool, progress):
        rows = study.run_consistency(
            registry, runs=runs, seed=seed, cases=cases, executor=pool, on_progress=progress
        )
    if as_json:
        _print_json({"runs": runs, "seed": seed, "rho": study.RHO, "rows": rows})
        return
    for name in cases:
        study_tables.print_consistency_case(
            study.CASES[name].title, [row for row in rows if row.case == name]
        )
    _print_shortfalls(f"{row.case}: {s}" for row in rows for s in row.shortfalls or ())


@app.command()
def track(
    runs: RunsOption = 40,
    seed: SeedOption = 0,
    case: CaseOption = None,
    as_json: JsonOption = False,
    workers: WorkersOption = 1,
    executor: ExecutorOption = None,
    files: WithOption = None,
) -> None:
    """Fly the live track with clocks, navigation errors, echoes, manoeuvres and gaps.

    Error over the bound of the right model, and NEES; the filters beside it on the same draws.
    """
    from swarmctl.study import track_consistency as study  # noqa: PLC0415 - loads scipy
    from swarmctl.study.registry import standard_registry  # noqa: PLC0415 - loads scipy
    from swarmctl.study.track_cases import CASES  # noqa: PLC0415 - loads scipy

    cases = _chosen(case, CASES)
    registry = standard_registry(files or [])
    _announce(runs, runs * study.cost_s(cases))
    with _flying(workers, executor, files) as (pool, progress):
        rows = study.run_track_consistency(
            registry, runs=runs, seed=seed, cases=cases, executor=pool, on_progress=progress
        )
    if as_json:
        _print_json({"runs": runs, "seed": seed, "rows": rows})
        return
    for name in cases:
        study_tables.print_track_case(CASES[name].title, [row for row in rows if row.case == name])
    _print_shortfalls(f"{row.case}: {s}" for row in rows for s in row.shortfalls or ())


@app.command()
def health(
    runs: RunsOption = 40,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
    workers: WorkersOption = 1,
    executor: ExecutorOption = None,
) -> None:
    """Count how soon the live track names a feed that goes wrong, and its false alarms."""
    from swarmctl.study import track_health as study  # noqa: PLC0415 - loads scipy

    _announce(runs, runs * study.cost_s(study.FAULTS))
    with _flying(workers, executor, None) as (pool, progress):
        rows = study.run_track_health(runs=runs, seed=seed, executor=pool, on_progress=progress)
    if as_json:
        _print_json({"runs": runs, "seed": seed, "rows": rows})
        return
    study_tables.print_health(rows)
    _print_shortfalls(f"health: {s}" for row in rows for s in row.shortfalls)


@app.command()
def information(
    runs: RunsOption = 200,
    epochs: Annotated[int, typer.Option("--epochs", min=2, help="Epochs of each run.")] = 10_000,
    seed: SeedOption = 0,
    out: OutOption = Path("study-information"),
    files: WithOption = None,
) -> None:
    """Appendix B: does the NCRKF's information converge to the OKF's, and what is it worth?"""
    from swarmctl.study import appendix_b, plots  # noqa: PLC0415 - loads scipy and matplotlib
    from swarmctl.study.registry import standard_registry  # noqa: PLC0415 - loads scipy

    registry = standard_registry(files or [])
    _make(out)
    studies = {
        name: appendix_b.run_information(runs=runs, epochs=epochs, seed=seed, formation=slots)
        for name, slots in registry.formations().items()
    }
    appendix_b.write_information(studies, seed, out)
    plots.draw_information(studies, out)
    shown = study_tables.table(
        "Information of the NCRKF, averaged over k epochs", ["", "", *studies]
    )
    lines: tuple[tuple[str, str, Callable[[InformationStudy], float]], ...] = (
        ("relative difference from the OKF's, k = 1", "", lambda s: s.scaled.true_weight[0]),
        (f"the same, k = {epochs}", "", lambda s: s.scaled.true_weight[-1]),
        ("slope in log k (-1/2 is right)", "", lambda s: s.scaled.slope),
        ("its limit with R of measured values", "", lambda s: s.scaled.floor),
        ("position 1-sigma it claims, one epoch", "m", lambda s: s.claimed_m),
        ("Cramér-Rao bound", "m", lambda s: s.attainable_m),
        ("real error", "m", lambda s: s.error_m),
        ("NEES (3 is right)", "", lambda s: s.nees),
    )
    for label, unit, value in lines:
        shown.add_row(label, unit, *(f"{value(s):.3g}" for s in studies.values()))
    Console().print(shown)
    typer.echo(f"{runs} runs, seed {seed}; information.png and information.json in {out}")


@app.command()
def formation(
    runs: Annotated[
        int, typer.Option("--runs", min=0, help="Missions of each kind; 0 leaves them out.")
    ] = 100,
    seed: SeedOption = 0,
    companions: Annotated[
        list[int] | None,
        typer.Option("--n", min=1, help="Companions; may be repeated (default: 3, 4 and 6)."),
    ] = None,
    designs: Annotated[
        list[str] | None,
        typer.Option("--design", help="May be repeated (default: uniform, paper and optimal)."),
    ] = None,
    count: Annotated[
        int,
        typer.Option("--transitions", min=0, help="Transitions to fly; 0 leaves them out."),
    ] = 1000,
    as_json: JsonOption = False,
    workers: WorkersOption = 1,
    executor: ExecutorOption = None,
) -> None:
    """Fly whole missions with each formation, and the transitions from one to the next.

    Which formation finds the emitter soonest? Does the swarm keep every limit while it changes?
    """
    from swarmctl.study import formation as study  # noqa: PLC0415 - loads the simulator
    from swarmctl.study import transitions  # noqa: PLC0415 - loads the simulator

    flown = None
    if count:
        with _flying(workers, executor, None) as (pool, progress):
            flown = transitions.run_transitions(
                count=count, seed=seed, executor=pool, on_progress=progress
            )
    cells = []
    if runs:
        with _flying(workers, executor, None) as (pool, progress):
            cells = study.run_formation(
                runs=runs,
                seed=seed,
                designs=designs or study.DESIGNS,
                companions=companions or study.COMPANIONS,
                executor=pool,
                on_progress=progress,
            )
    if as_json:
        _print_json({"runs": runs, "seed": seed, "cells": cells, "transitions": flown})
        return
    shown = study_tables.table(
        f"time from forming up until 1-sigma < {study.CONVERGED_SIGMA_M:g} m, {runs} missions each",
        ["N", "design", "mean (s)", "of the best", "95 %", "RMSE then (m)", "lost"],
    )
    for cell in cells:
        low, high = cell.of_best_95
        shown.add_row(
            str(cell.companions),
            cell.design,
            f"{cell.mean_s:.1f}",
            f"{cell.of_best:.2f}",
            f"{low:.2f}-{high:.2f}",
            f"{cell.rmse_m:.1f}",
            f"{cell.lost}/{runs}",
        )
    if cells:
        Console().print(shown)
    if flown is not None:
        Console().print(
            f"{flown.transitions} transitions in {flown.flights} flights of"
            f" {transitions.COMPANIONS[0]} to {transitions.COMPANIONS[-1]} companions: nearest"
            f" {flown.separation_m:.1f} m (at least {flown.min_separation_m:g}), farthest from the"
            f" reference {flown.reach_m:.1f} m (at most {flown.d_max_m:g}), not formed up"
            f" {flown.not_formed}, slots exchanged without need {flown.swaps}."
        )


def _chosen(names: list[str] | None, cases: Mapping[str, object]) -> tuple[str, ...]:
    """The cases to fly: those asked for, in the study's order, or all."""
    for name in names or []:
        if name not in cases:
            raise UsageError(f"There is no case {name!r}; there are {', '.join(cases)}.")
    return tuple(name for name in cases if names is None or name in names)


def _announce(runs: int, seconds: float) -> None:
    minutes = math.ceil(seconds / 60.0)
    typer.echo(f"{runs} runs a case take about {minutes} min on one core.", err=True)


def _print_json(document: dict[str, object]) -> None:
    typer.echo(msgspec.json.format(msgspec.json.encode(document), indent=1))


def _print_shortfalls(sentences: Iterable[str]) -> None:
    missed = list(sentences)
    typer.echo("\n".join(["Out of tolerance:", *missed]) if missed else "All within tolerance.")


def _make(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"--out {out} cannot be made: {error.strerror}.") from error


@contextmanager
def _flying(
    workers: int, executor: str | None, files: list[Path] | None
) -> Iterator[tuple[Executor | None, Callable[[int, int], None]]]:
    """An executor, and a progress bar on standard error."""
    from swarmctl.study.executors import executing  # noqa: PLC0415 - loads the simulator

    bar = Progress(
        TextColumn("runs"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    with executing(workers, executor, files or []) as pool, bar:
        task = bar.add_task("runs")

        def progress(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        yield pool, progress
