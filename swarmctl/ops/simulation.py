"""Simulated vehicles, emitter and broker, as ``swarmctl sim`` serves them.

The simulator is told about a mission only through its own plain configuration; nothing of the
controller reaches it but bytes over UDP and MQTT.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import math
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path

from sim.config import (
    ClockConfig,
    EmitterConfig,
    NavigationConfig,
    ReceiverConfig,
    SimConfig,
    VehicleConfig,
    WindConfig,
)
from sim.faults import Faults
from sim.serve import serve, serve_receivers
from swarmctl.errors import SwarmError, UsageError
from swarmctl.feed.broker import embedded_broker
from swarmctl.feed.client import BrokerAddress
from swarmctl.frames import sped_up_utc_s
from swarmctl.link.endpoints.url import EndpointUrl, parse_url
from swarmctl.mission.mission_file import Mission, Simulation
from swarmctl.ops.signing import signing_key

READY = "simulating"
"""First word of the line a simulator process prints once it serves."""

LISTEN = "udpin://127.0.0.1:14600"
"""Where the receivers of vehicles that others fly hear their MAVLink."""

OWNERS_PARAMETERS = {
    "ardupilot": (("WPNAV_SPEED", 1500.0), ("WPNAV_SPEED_UP", 300.0), ("BATT_FS_LOW_ACT", 2.0)),
    "px4": (("MPC_XY_VEL_MAX", 15.0),),
}
"""What the owner of the simulated vehicles has set: as fast as their airframe can, and home on a
low battery."""


def sim_config(
    mission: Mission, seed: int | None, utc_start_s: float, speedup: float = 1.0
) -> SimConfig:
    """Configuration of a mission's simulation.

    Args:
        mission: A mission with a ``sim`` section.
        seed: Overrides the section's seed.
        utc_start_s: UTC at simulation time 0, s.
        speedup: Simulated seconds per second: as in SITL, UTC follows it on an ArduCopter, and
            not on a PX4.

    Raises:
        UsageError: If the mission has no ``sim`` section, or its signing key cannot be read.
    """
    key = signing_key(mission)
    other_key = hashlib.sha256(b"another than" + (key or b"")).digest()
    section = simulation_section(mission)
    clock = ClockConfig(speedup=speedup if section.autopilot == "px4" else 1.0)
    faults = {fault.sysid: fault for fault in section.faults}
    vehicles = []
    for i, sysid in enumerate(mission.swarm.sysids):
        lat, lon, alt = mission.frame.to_geodetic(i * section.launch_spacing_m, 0.0, 0.0)
        fault = faults.get(sysid)
        kind = fault.kind if fault is not None else None
        vehicles.append(
            VehicleConfig(
                sysid=sysid,
                launch_lat_rad=lat,
                launch_lon_rad=lon,
                launch_alt_amsl_m=alt,
                autopilot=section.autopilot,
                parameters=OWNERS_PARAMETERS[section.autopilot],
                signing_key=other_key if kind == "other_key" else key,
                full_boot=section.full_boot,
                clock=clock,
                boot_delay_s=0.1 * i,
                faults=Faults(
                    silent=kind == "silent",
                    refuses_arming=kind == "refuses_arming",
                    dies_at_s=fault.at_s if fault is not None and kind == "dies" else None,
                ),
            )
        )
    emitter, wind = section.emitter, section.wind
    lat, lon, alt = emitter.geodetic
    return SimConfig(
        swarm=mission.swarm.name,
        vehicles=tuple(vehicles),
        emitter=EmitterConfig(
            lat_rad=lat,
            lon_rad=lon,
            alt_amsl_m=alt,
            velocity_enu=_towards(emitter.course_deg, emitter.drift_mps),
            wander_mps_per_sqrt_s=emitter.wander_mps_per_sqrt_s,
        ),
        receivers=ReceiverConfig(
            reference=mission.swarm.reference,
            rate_hz=section.receivers.rate_hz,
            sigma_m=section.receivers.sigma_m,
            rho=section.receivers.rho,
            clock_bias_sigma_s=1e-9 * section.receivers.clock_bias_sigma_ns,
            clock_drift_sigma=1e-9 * section.receivers.clock_drift_sigma_ns_per_s,
            nlos_share=section.receivers.nlos_share,
            nlos_min_m=section.receivers.nlos_min_m,
            nlos_max_m=section.receivers.nlos_max_m,
            colour_sigma_m=section.receivers.colour_sigma_m,
            colour_tau_s=section.receivers.colour_tau_s,
            publish=section.receivers.publish,
        ),
        navigation=NavigationConfig(
            white_sigma_m=section.navigation.white_sigma_m,
            correlated_sigma_m=section.navigation.correlated_sigma_m,
            correlated_tau_s=section.navigation.correlated_tau_s,
        ),
        wind=WindConfig(
            mean_enu=_towards(wind.from_deg + 180.0, wind.speed_mps),
            gust_sigma_mps=wind.gust_sigma_mps,
        ),
        seed=section.seed if seed is None else seed,
        utc_start_s=sped_up_utc_s(utc_start_s, clock.speedup),
    )


def simulation_section(mission: Mission) -> Simulation:
    """The mission's ``sim`` section.

    Raises:
        UsageError: If it has none.
    """
    if mission.sim is None:
        raise UsageError(
            f"the mission {mission.name} has no sim section: only a mission that says where the"
            " simulated emitter is can be simulated. Add one, or fly real vehicles with"
            " `swarmctl run`."
        )
    return mission.sim


def _towards(course_deg: float, speed_mps: float) -> tuple[float, float, float]:
    course = math.radians(course_deg)
    return (speed_mps * math.sin(course), speed_mps * math.cos(course), 0.0)


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

    A port for each vehicle where the mission listens on as many; else the first, for all.

    Raises:
        UsageError: If it listens on none.
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

    It ignores Ctrl-C (the controller first brings the swarm home) and ends with this process,
    however that ends.

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
