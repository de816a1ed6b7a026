"""Serves simulated vehicles, emitter and broker, as ``swarmctl sim`` does.

The simulator learns of a mission through its own plain configuration only. In flight, nothing of
the controller reaches it but bytes over UDP and MQTT.
"""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path

from sim.serve import serve, serve_receivers
from swarmctl.errors import SwarmError, UsageError
from swarmctl.feed.broker import embedded_broker
from swarmctl.feed.client import BrokerAddress
from swarmctl.link.endpoints.url import EndpointUrl, parse_url
from swarmctl.mission.mission_file import Mission
from swarmctl.ops.sim_config import sim_config

READY = "simulating"
"""First word of the line that a simulator process prints when it serves."""

LISTEN = "udpin://127.0.0.1:14600"
"""Where the receivers hear the MAVLink of vehicles that others fly, by default."""


async def serve_mission(
    mission: Mission,
    *,
    seed: int | None,
    speedup: float,
    broker: str | None,
    utc_start_s: float,
    ready: Callable[[], None],
    stop: asyncio.Event,
) -> None:
    """Serve a mission's vehicles, emitter and broker until ``stop`` is set.

    Args:
        mission: A mission with a ``sim`` section.
        seed: Overrides the section's seed.
        speedup: Simulated seconds per second.
        broker: URL of an outside broker; None starts the embedded one at ``feed.broker``.
        utc_start_s: UTC at simulation time 0, s.
        ready: Called once everything is served.
        stop: Ends the simulation.

    Raises:
        SwarmError: If a port is in use or the broker cannot be reached.
    """
    config = sim_config(mission, seed, utc_start_s, speedup)
    async with _broker(mission, broker) as (address, credentials):
        await serve(
            config,
            controllers=controller_addresses(mission),
            broker=address,
            credentials=credentials,
            speedup=speedup,
            ready=ready,
            stop=stop,
        )


async def serve_receivers_of(
    mission: Mission,
    *,
    listen: str,
    seed: int | None,
    speedup: float,
    broker: str | None,
    ready: Callable[[], None],
    stop: asyncio.Event,
) -> None:
    """Serve a mission's emitter, receivers and broker, for vehicles that others fly.

    Args:
        mission: A mission with a ``sim`` section.
        listen: Where their MAVLink is heard, ``udpin://host:port``.
        seed: Overrides the section's seed.
        speedup: Simulated seconds per second, for vehicles whose UTC does not follow it.
        broker: URL of an outside broker; None starts the embedded one at ``feed.broker``.
        ready: Called once everything is served.
        stop: Ends the simulation.

    Raises:
        SwarmError: If a port is in use or the broker cannot be reached.
    """
    config = sim_config(mission, seed, 0.0)
    url = parse_url(listen)
    if url.scheme != "udpin":
        raise UsageError(
            f"--listen is {listen!r}: it should be udpin://host:port, as in {LISTEN}, where"
            " `swarmctl run --forward udpout://host:port` sends the vehicles' MAVLink."
        )
    async with _broker(mission, broker) as (address, credentials):
        await serve_receivers(
            config,
            here=(url.host, url.port),
            broker=address,
            credentials=credentials,
            speedup=speedup,
            ready=ready,
            stop=stop,
        )


@contextlib.asynccontextmanager
async def _broker(
    mission: Mission, url: str | None
) -> AsyncIterator[tuple[tuple[str, int], tuple[str, str | None] | None]]:
    """The simulator's broker, embedded or outside: its host and port, and credentials."""
    address = BrokerAddress.parse(url or mission.feed.broker)
    if address.tls:
        raise UsageError("The simulator speaks no TLS: give it a broker at mqtt://, on loopback.")
    async with contextlib.AsyncExitStack() as stack:
        if url is None:
            await stack.enter_async_context(embedded_broker(address.host, address.port))
        credentials = (address.username, address.password) if address.username else None
        yield (address.host, address.port), credentials


def controller_addresses(mission: Mission) -> list[tuple[str, int]]:
    """Hosts and ports that simulated vehicles send to.

    Each vehicle has a port of its own if the mission listens on as many; else all have the first.

    Raises:
        UsageError: If the mission listens on none.
    """
    urls = [url for url in map(parse_url, mission.swarm.link) if url.scheme == "udpin"]
    if not urls:
        raise UsageError(
            f"swarm.link is {' and '.join(mission.swarm.link)}: simulated vehicles need one"
            " udpin://host:port among them, as in udpin://127.0.0.1:14550."
        )
    addresses = [_address(url) for url in urls]
    return addresses if len(urls) == len(mission.swarm.vehicles) else addresses[:1]


def _address(url: EndpointUrl) -> tuple[str, int]:
    return ("127.0.0.1" if url.host == "0.0.0.0" else url.host, url.port)


@contextlib.asynccontextmanager
async def simulated(
    mission_path: str | Path,
    *,
    seed: int | None = None,
    speedup: float = 1.0,
    broker: str | None = None,
) -> AsyncIterator[None]:
    """Run a mission's simulator in a process of its own for as long as the context lasts.

    The process ignores Ctrl-C (the controller first brings the swarm home) and ends with this
    one, however this one ends.

    Raises:
        UsageError: If the simulator says that an argument is wrong.
        SwarmError: If it cannot serve, or ended before the context did; the message is the
            simulator's own.
    """
    arguments = ["sim", str(mission_path), "--with-parent", "--speedup", repr(speedup)]
    if seed is not None:
        arguments += ["--seed", str(seed)]
    if broker is not None:
        arguments += ["--broker", broker]
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "swarmctl", *arguments, stdin=pipe, stdout=pipe, stderr=pipe
    )
    if process.stdin is None or process.stdout is None or process.stderr is None:
        raise SwarmError("the simulator's process has no pipes")
    try:
        line = await process.stdout.readline()
        if not line.decode().startswith(READY):
            message = (await process.stderr.read()).decode().strip()
            kind = UsageError if await process.wait() == UsageError.exit_code else SwarmError
            raise kind(message or "the simulator ended before it was ready")
        yield
        if process.returncode is not None:
            message = (await process.stderr.read()).decode().strip()
            raise SwarmError(f"the simulator ended in mid-flight: {message or 'without a word'}")
    finally:
        process.stdin.close()
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(process.wait(), timeout=5.0)
        if process.returncode is None:
            process.kill()
            await process.wait()
