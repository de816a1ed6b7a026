"""Serves a simulation in real time: UDP for the vehicles, MQTT for receivers and truth."""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from collections.abc import Callable, Sequence

import aiomqtt

from sim.config import SimConfig
from sim.feed_publisher import Publication
from sim.sitl_receivers import SitlReceivers
from sim.world import World
from swarmctl.errors import SimulationError

TURN_S = 0.002
"""Wall time between turns, s: at a speed-up of 20 a datagram waits at most 40 simulated ms."""
LONGEST_TURN_S = 1.0
"""Greatest simulated time of one turn, s.

On a machine that is too slow for its speed-up the simulation slows down, instead of serving its
sockets less and less often.
"""

RECEIVE_BUFFER = 1 << 22
"""Size of the receive buffer asked of the system, bytes; it may give less."""

# paho leaves Nagle's algorithm on. It holds a small message back until the last one is
# acknowledged: up to 40 ms, or almost a simulated second at a speed-up of 20.
_NO_DELAY = (socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

_log = logging.getLogger(__name__)


class _Socket(asyncio.DatagramProtocol):
    """A vehicle's UDP socket, connected to the controller."""

    def __init__(self, sysid: int, shell: Shell) -> None:
        self._sysid = sysid
        self._shell = shell

    def datagram_received(self, data: bytes, addr: tuple[str | int, int]) -> None:
        self._shell.received(self._sysid, data)

    def error_received(self, exc: Exception) -> None:
        # Nobody listens (yet, or any more). A radio would not notice either.
        _log.debug("UAV %d: %s", self._sysid, exc)


class Shell:
    """Moves bytes between a world and its sockets by the wall clock.

    Args:
        config: The simulation.
        speedup: Simulated seconds per second.
    """

    def __init__(self, config: SimConfig, speedup: float) -> None:
        self._world = World(config)
        self._speedup = speedup
        self._sockets: dict[int, asyncio.DatagramTransport] = {}
        self._origin_s = time.monotonic()

    async def open(self, sysid: int, controller: tuple[str, int]) -> None:
        """Open a vehicle's socket."""
        loop = asyncio.get_running_loop()
        try:
            self._sockets[sysid], _ = await loop.create_datagram_endpoint(
                lambda: _Socket(sysid, self), remote_addr=controller
            )
        except OSError as error:
            host, port = controller
            raise SimulationError(
                f"The simulated UAV {sysid} cannot send to the controller at {host}:{port} "
                f"({error}): name an address of this machine or its network."
            ) from error

    def close(self) -> None:
        """Close every socket."""
        for transport in self._sockets.values():
            transport.close()

    def start(self) -> None:
        """Start the simulation time now."""
        self._origin_s = time.monotonic()

    def turn(self) -> list[Publication]:
        """Simulate up to the wall clock; returns what is to be published."""
        wanted_s = (time.monotonic() - self._origin_s) * self._speedup
        reached_s = min(wanted_s, self._world.time_s + LONGEST_TURN_S)
        self._origin_s += (wanted_s - reached_s) / self._speedup
        self._world.advance(reached_s)
        self._send()
        return self._world.publications()

    def received(self, sysid: int, data: bytes) -> None:
        """Deliver a datagram to a vehicle and send its answers."""
        self._world.receive_datagram(sysid, data)
        self._send()

    def _send(self) -> None:
        for sysid, datagram in self._world.datagrams():
            self._sockets[sysid].sendto(datagram)


class _Listener(asyncio.DatagramProtocol):
    """A UDP port that hears vehicles that others fly; it never answers."""

    def __init__(self, listening: SitlReceivers) -> None:
        self._listening = listening

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        # At a speed-up, a short absence of this process is seconds of everybody's reports.
        transport.get_extra_info("socket").setsockopt(
            socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER
        )

    def datagram_received(self, data: bytes, addr: tuple[str | int, int]) -> None:
        self._listening.receive(data)


async def serve(
    config: SimConfig,
    *,
    controllers: Sequence[tuple[str, int]],
    broker: tuple[str, int],
    credentials: tuple[str, str | None] | None = None,
    speedup: float = 1.0,
    ready: Callable[[], None] | None = None,
    stop: asyncio.Event,
) -> None:
    """Simulate by the wall clock until told to stop.

    Every vehicle has its own UDP socket, which talks only to the controller. Measurements and
    truth are published at QoS 0.

    Args:
        config: The simulation.
        controllers: Host and port that each vehicle sends to, or one for all; they need not
            listen yet.
        broker: Host and port of the MQTT broker, which must be up.
        credentials: User name and password for the broker; None for an anonymous client.
        speedup: Simulated seconds per second.
        ready: Called once everything is open and time begins.
        stop: Ends the simulation when set.

    Raises:
        SimulationError: The configuration contradicts itself, a controller's address cannot be
            sent to, or the broker cannot be reached or goes away.
    """
    shell = Shell(config, speedup)

    def begin() -> None:
        shell.start()
        if ready is not None:
            ready()

    try:
        for i, vehicle in enumerate(config.vehicles):
            await shell.open(vehicle.sysid, controllers[i if len(controllers) > 1 else 0])
        await _publish(shell.turn, broker, credentials, begin, stop)
    finally:
        shell.close()


async def serve_receivers(
    config: SimConfig,
    *,
    here: tuple[str, int],
    broker: tuple[str, int],
    credentials: tuple[str, str | None] | None = None,
    speedup: float = 1.0,
    ready: Callable[[], None] | None = None,
    stop: asyncio.Event,
) -> None:
    """Simulate the emitter and the receivers of vehicles that others fly, until told to stop.

    Args:
        config: The simulation.
        here: Host and port on which the vehicles' MAVLink is heard.
        broker: Host and port of the MQTT broker, which must be up.
        credentials: User name and password for the broker; None for an anonymous client.
        speedup: Simulated seconds per second, for vehicles whose UTC does not follow it.
        ready: Called once everything is open.
        stop: Ends the simulation when set.

    Raises:
        SimulationError: The port cannot be opened, or the broker cannot be reached or goes away.
    """
    listening = SitlReceivers(config, speedup)
    loop = asyncio.get_running_loop()
    host, port = here
    try:
        transport, _ = await loop.create_datagram_endpoint(
            lambda: _Listener(listening), local_addr=here
        )
    except OSError as error:
        raise SimulationError(
            f"The simulator cannot listen on UDP port {port} of {host} ({error.strerror}): stop "
            "whoever does, or name another port with --listen and in run's --forward."
        ) from error

    def turn() -> list[Publication]:
        for complaint in listening.complaints():
            _log.warning(complaint)
        return listening.publications()

    try:
        await _publish(turn, broker, credentials, ready, stop)
    finally:
        transport.close()


async def _publish(
    turn: Callable[[], list[Publication]],
    broker: tuple[str, int],
    credentials: tuple[str, str | None] | None,
    ready: Callable[[], None] | None,
    stop: asyncio.Event,
) -> None:
    """Publish the result of every turn until told to stop."""
    host, port = broker
    user, password = credentials if credentials is not None else (None, None)
    try:
        async with aiomqtt.Client(
            host, port, username=user, password=password, socket_options=[_NO_DELAY]
        ) as client:
            if ready is not None:
                ready()
            while not stop.is_set():
                for topic, payload in turn():
                    await client.publish(topic, payload)
                await asyncio.sleep(TURN_S)
    except aiomqtt.MqttError as error:
        raise SimulationError(
            f"The simulator has no MQTT broker at {host}:{port} ({error}): "
            "start one there, or name one that runs."
        ) from error
