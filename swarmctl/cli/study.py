"""``swarmctl study``: Monte Carlo studies of estimators. Parses, wires, prints."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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

FILTER_RUNS = 500
"""Of a case of the filters, which costs seconds."""
TRACKER_RUNS = 40
"""Of a case of the live tracker, which costs half a second a run."""
HEALTH = "health"
"""The name of the case that flies :mod:`~swarmctl.study.track_health`."""


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
    from swarmctl.study import plots as figures  # noqa: PLC0415 - loads scipy and matplotlib
    from swarmctl.study import registry  # noqa: PLC0415 - loads scipy and matplotlib
    from swarmctl.study import table1 as study  # noqa: PLC0415

    registry.load(files or [])
    _make(out)
    with _flying(workers, executor, files) as (pool, progress):
        table = study.table1(runs=runs, seed=seed, rho=rho, executor=pool, on_progress=progress)
    study.write(table, out)
    figures.write_table1(table, out)
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
    runs: Annotated[
        int | None,
        typer.Option("--runs", min=2, help="Monte Carlo runs (default: 500; the tracker's 40)."),
    ] = None,
    seed: SeedOption = 0,
    case: Annotated[
        list[str] | None,
        typer.Option("--case", help="Only this case; may be repeated (default: all filters')."),
    ] = None,
    with_tracker: Annotated[
        bool, typer.Option("--tracker", help="All cases of the live tracker.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    workers: WorkersOption = 1,
    executor: ExecutorOption = None,
    files: WithOption = None,
) -> None:
    """Measure error against the Cramér-Rao bound, and NEES, with confidence intervals.

    The filters in white noise; with --tracker the live tracker with clocks, navigation errors,
    echoes, manoeuvres, gaps and faults, and the filters beside it.
    """
    from swarmctl.study import consistency as study  # noqa: PLC0415 - loads scipy
    from swarmctl.study import jsonable, registry  # noqa: PLC0415 - loads scipy and matplotlib
    from swarmctl.study import track_cases as tracker_cases  # noqa: PLC0415
    from swarmctl.study import track_consistency as tracker  # noqa: PLC0415 - loads scipy and matplotlib
    from swarmctl.study import track_health as health  # noqa: PLC0415 - loads scipy and matplotlib

    known = (*study.CASES, *tracker_cases.CASES, HEALTH)
    names = case or (() if with_tracker else tuple(study.CASES))
    if with_tracker:
        names = (*names, *tracker_cases.CASES, HEALTH)
    for name in names:
        if name not in known:
            raise UsageError(f"There is no case {name!r}; there are {', '.join(known)}.")
    of_filters = tuple(name for name in study.CASES if name in names)
    of_tracker = tuple(name for name in tracker_cases.CASES if name in names)
    faults = health.FAULTS if HEALTH in names else ()
    filter_runs, tracker_runs = runs or FILTER_RUNS, runs or TRACKER_RUNS
    registry.load(files or [])
    if of_tracker or faults:
        seconds = tracker_runs * (tracker.cost_s(of_tracker) + health.cost_s(faults))
        minutes = math.ceil(seconds / 60.0)
        typer.echo(f"{tracker_runs} runs a case take about {minutes} min on one core.", err=True)
    parts = [len(of_filters) * filter_runs, len(of_tracker) * tracker_runs]
    parts.append(len(faults) * tracker_runs)
    with _flying(workers, executor, files) as (pool, progress):

        def told(part: int) -> Callable[[int, int], None]:
            return lambda done, _: progress(sum(parts[:part]) + done, sum(parts))

        rows, tracker_rows, health_rows = [], [], []
        if of_filters:
            rows = study.consistency(
                runs=filter_runs, seed=seed, cases=of_filters, executor=pool, on_progress=told(0)
            )
        if of_tracker:
            tracker_rows = tracker.tracker(
                runs=tracker_runs, seed=seed, cases=of_tracker, executor=pool, on_progress=told(1)
            )
        if faults:
            health_rows = health.health(
                runs=tracker_runs, seed=seed, faults=faults, executor=pool, on_progress=told(2)
            )
    if as_json:
        flown = {"runs": tracker_runs, "rows": tracker_rows, "health": health_rows}
        document = {"runs": filter_runs, "seed": seed, "rho": study.RHO, "rows": rows}
        typer.echo(jsonable.dumps({**document, "tracker": flown}))
        return
    for name in of_filters:
        study_tables.print_case(study.CASES[name].title, [row for row in rows if row.case == name])
    for name in of_tracker:
        study_tables.print_tracker_case(
            tracker_cases.CASES[name].title, [row for row in tracker_rows if row.case == name]
        )
    if health_rows:
        study_tables.print_health(health_rows)
    missed = [f"{row.case}: {s}" for row in rows for s in row.shortfalls or ()]
    missed += [f"{row.case}: {s}" for row in tracker_rows for s in row.shortfalls or ()]
    missed += [f"{HEALTH}: {s}" for row in health_rows for s in row.shortfalls]
    typer.echo("\n".join(["Targets missed:", *missed]) if missed else "All targets are met.")


@app.command()
def information(
    runs: RunsOption = 200,
    epochs: Annotated[int, typer.Option("--epochs", min=2, help="Epochs of each run.")] = 10_000,
    seed: SeedOption = 0,
    out: OutOption = Path("study-information"),
    files: WithOption = None,
) -> None:
    """Appendix B: does the NCRKF's information converge to the OKF's, and what is it worth?"""
    from swarmctl.study import appendix_b as study  # noqa: PLC0415
    from swarmctl.study import (  # noqa: PLC0415 - loads scipy and matplotlib
        jsonable,
        registry,
    )
    from swarmctl.study import plots as figures  # noqa: PLC0415 - loads scipy and matplotlib

    registry.load(files or [])
    _make(out)
    studies = {
        name: study.information(runs=runs, epochs=epochs, seed=seed, formation=slots)
        for name, slots in registry.formations().items()
    }
    document = {"seed": seed, "formations": {n: s.to_json() for n, s in studies.items()}}
    (out / "information.json").write_text(jsonable.dumps(document) + "\n")
    figures.write_information(studies, out)
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
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    workers: WorkersOption = 1,
    executor: ExecutorOption = None,
) -> None:
    """Fly whole missions with each formation, and the transitions from one to the next.

    Which formation finds the emitter soonest? Does the swarm keep every limit while it changes?
    """
    from swarmctl.study import formation as study  # noqa: PLC0415 - loads the simulator
    from swarmctl.study import (  # noqa: PLC0415 - loads scipy and matplotlib
        jsonable,
        transitions,
    )

    flown = None
    if count:
        with _flying(workers, executor, None) as (pool, progress):
            flown = transitions.transitions(
                count=count, seed=seed, executor=pool, on_progress=progress
            )
    cells = []
    if runs:
        with _flying(workers, executor, None) as (pool, progress):
            cells = study.formation(
                runs=runs,
                seed=seed,
                designs=designs or study.DESIGNS,
                companions=companions or study.COMPANIONS,
                executor=pool,
                on_progress=progress,
            )
    if as_json:
        typer.echo(
            jsonable.dumps({"runs": runs, "seed": seed, "cells": cells, "transitions": flown})
        )
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
