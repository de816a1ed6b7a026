"""The ``swarmctl`` command: reads its arguments, starts what they ask for, prints the outcome.

Every error is a sentence and an exit code. What is slow to load is loaded by the command that
needs it, so that ``--help`` stays quick.
"""

from __future__ import annotations

import asyncio
import signal
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

import swarmctl
from swarmctl.cli import study
from swarmctl.cli.console import Reporter, print_summary
from swarmctl.cli.design import design
from swarmctl.cli.missions import find_mission
from swarmctl.cli.track import track
from swarmctl.errors import SwarmError, UsageError
from swarmctl.ops import exit_codes

app = typer.Typer(
    name="swarmctl",
    help="Fly a UAV swarm that finds a radio emitter by TDOA.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

app.command()(design)
app.command()(track)
app.add_typer(study.app, name="study")

MissionArgument = Annotated[
    str, typer.Argument(metavar="MISSION", help="A mission file, or the name of a shipped one.")
]
SpeedupOption = Annotated[
    float, typer.Option("--speedup", min=0.1, max=200.0, help="Mission seconds per second.")
]
SeedOption = Annotated[
    int | None,
    typer.Option("--seed", min=0, help="Seed of the simulation (default: the mission's)."),
]
BrokerOption = Annotated[
    str | None, typer.Option("--broker", help="An MQTT broker, mqtt://host:port.")
]
OutOption = Annotated[
    Path | None,
    typer.Option("--out", help="Directory of the recording (default: flights/NAME-TIME)."),
]
ForwardOption = Annotated[
    list[str] | None,
    typer.Option(
        "--forward",
        help="Pass MAVLink on to another ground station, udpout://host:port; may be repeated.",
    ),
]
HeadlessOption = Annotated[
    bool, typer.Option("--headless", help="Print a line every few seconds, no live console.")
]


def main() -> None:
    """Run the command line; every error a user can meet ends as one sentence."""
    try:
        app(standalone_mode=True)
    except SwarmError as error:
        _print_error(error)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        sys.exit(exit_codes.CANCELLED)


def _print_error(error: SwarmError) -> None:
    Console(stderr=True, highlight=False, soft_wrap=True).print(str(error), markup=False)


@app.callback(invoke_without_command=True)
def _version(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        typer.echo(f"swarmctl {swarmctl.__version__}")
        raise typer.Exit


@app.command()
def demo(
    mission: MissionArgument = "beacon_drift",
    headless: HeadlessOption = False,
    speedup: SpeedupOption = 12.0,
    seed: SeedOption = None,
    out: OutOption = None,
    broker: BrokerOption = None,
    forward: ForwardOption = None,
    in_memory: Annotated[
        bool,
        typer.Option("--in-memory", help="No sockets, a virtual clock, as fast as possible."),
    ] = False,
) -> None:
    """Fly a mission with simulated vehicles, emitter and broker, all on this machine."""
    from swarmctl.ops.sim_config import simulation_section  # noqa: PLC0415 - loads the simulator

    path = find_mission(mission)
    loaded = swarmctl.load_mission(path)
    section = simulation_section(loaded)
    seed = section.seed if seed is None else seed
    out = out or _default_out(loaded.name)
    if in_memory:
        if broker is not None:
            raise UsageError("--in-memory uses no broker: leave --broker out.")
        if forward:
            raise UsageError("--in-memory uses no sockets: leave --forward out.")
        with Reporter(loaded, headless=True) as reporter:
            summary = swarmctl.fly_in_memory(
                path,
                out,
                seed=seed,
                on_snapshot=reporter.snapshot,
                on_notice=reporter.notice,
            )
    else:

        async def fly_simulated() -> swarmctl.FlightSummary:
            async with swarmctl.simulated(path, seed=seed, speedup=speedup, broker=broker):
                return await swarmctl.fly(
                    path,
                    out,
                    broker=broker,
                    forward=forward or (),
                    speedup=speedup,
                    seed=seed,
                    on_snapshot=reporter.snapshot,
                    on_notice=reporter.notice,
                    snapshot_every_s=reporter.every_s,
                )

        with Reporter(loaded, headless=headless) as reporter:
            summary = asyncio.run(fly_simulated())
    _finish(summary, out)


@app.command()
def run(
    mission: MissionArgument,
    headless: HeadlessOption = False,
    speedup: SpeedupOption = 1.0,
    out: OutOption = None,
    broker: BrokerOption = None,
    shadow: Annotated[
        bool,
        typer.Option(
            "--shadow",
            help="Compute and record every command but send none: others fly the vehicles.",
        ),
    ] = False,
    forward: ForwardOption = None,
    set_failsafes: Annotated[
        bool,
        typer.Option(
            "--set-failsafes",
            help="Set the vehicles' failsafes for the flight where they are not right, and restore"
            " them after it, as swarm.set_failsafes in the mission does.",
        ),
    ] = False,
) -> None:
    """Fly a mission with whatever vehicles answer on its link."""
    path = find_mission(mission)
    loaded = swarmctl.load_mission(path)
    out = out or _default_out(loaded.name)
    with Reporter(loaded, headless=headless) as reporter:
        summary = asyncio.run(
            swarmctl.fly(
                path,
                out,
                broker=broker,
                forward=forward or (),
                speedup=speedup,
                shadow=shadow,
                set_failsafes=set_failsafes,
                on_snapshot=reporter.snapshot,
                on_notice=reporter.notice,
                snapshot_every_s=reporter.every_s,
            )
        )
    _finish(summary, out)


@app.command()
def sim(
    mission: MissionArgument,
    speedup: SpeedupOption = 1.0,
    seed: SeedOption = None,
    broker: BrokerOption = None,
    receivers_only: Annotated[
        bool,
        typer.Option(
            "--receivers-only",
            help="No vehicles: the emitter and the receivers of vehicles that others simulate"
            " (SITL), measured from the positions they report.",
        ),
    ] = False,
    listen: Annotated[
        str | None,
        typer.Option(
            "--listen",
            help="With --receivers-only: where `run --forward` sends the vehicles' MAVLink"
            " (default: udpin://127.0.0.1:14600).",
        ),
    ] = None,
    with_parent: Annotated[
        bool, typer.Option("--with-parent", hidden=True, help="End when standard input does.")
    ] = False,
) -> None:
    """Serve a mission's simulated vehicles, emitter and broker until Ctrl-C."""
    from swarmctl.ops.simulation import (  # noqa: PLC0415 - loads the simulator
        LISTEN,
        READY,
        controller_addresses,
        serve_mission,
        serve_receivers_of,
    )

    if listen is not None and not receivers_only:
        raise UsageError("--listen goes with --receivers-only: other vehicles are not heard.")
    if with_parent:
        # The controller answers Ctrl-C by bringing the swarm home: that needs the vehicles.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    loaded = swarmctl.load_mission(find_mission(mission))
    embedded = "embedded broker" if broker is None else "outside broker"
    listens_at = listen or LISTEN

    def ready() -> None:
        vehicles = len(loaded.swarm.vehicles)
        if receivers_only:
            served = f"an emitter and {vehicles} receivers; MAVLink is heard at {listens_at}"
        else:
            ports = " ".join(f"{host}:{port}" for host, port in controller_addresses(loaded))
            served = f"{vehicles} vehicles at {speedup:g} x real time; MAVLink goes to {ports}"
        print(  # noqa: T201 - a parent process waits for this line
            f"{READY} {served}, {embedded} {broker or loaded.feed.broker}; Ctrl-C ends", flush=True
        )

    async def serve() -> None:
        loop = asyncio.get_running_loop()
        stop = asyncio.Event()
        if with_parent:
            loop.add_reader(sys.stdin.fileno(), stop.set)
        else:
            for number in (signal.SIGINT, signal.SIGTERM):
                loop.add_signal_handler(number, stop.set)
        if receivers_only:
            await serve_receivers_of(
                loaded,
                listen=listens_at,
                seed=seed,
                speedup=speedup,
                broker=broker,
                ready=ready,
                stop=stop,
            )
        else:
            await serve_mission(
                loaded,
                seed=seed,
                speedup=speedup,
                broker=broker,
                utc_start_s=time.time(),
                ready=ready,
                stop=stop,
            )

    asyncio.run(serve())


def _default_out(name: str) -> Path:
    return Path("flights") / f"{name}-{datetime.now(UTC):%Y%m%d-%H%M%S}"


def _finish(summary: swarmctl.FlightSummary, out: Path) -> None:
    print_summary(summary, out)
    raise typer.Exit(exit_codes.exit_code(summary.result))
