"""Flies a mission over real sockets: the asyncio shell around the station.

It moves bytes and re-arms one timer; the station decides. ``speedup`` scales its clock, for
simulators that run faster than real time.
"""

from __future__ import annotations

import asyncio
import contextlib
import signal
import time
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from pathlib import Path

from swarmctl.decisions import Notice
from swarmctl.errors import SwarmError
from swarmctl.feed.client import BrokerAddress, FeedClient, connect
from swarmctl.link.autopilots.personality import PERSONALITIES
from swarmctl.mission.mission_file_loading import load_mission
from swarmctl.mission.snapshot import Snapshot
from swarmctl.ops.mission_signing import signing
from swarmctl.ops.recording import Recording
from swarmctl.ops.station import Station
from swarmctl.ops.transports import EndpointTransport, MavsdkTransport, Transport
from swarmctl.ops.vehicle_links import mavsdk_link, native_link, station_addresses
from swarmctl.recorder.summary import FlightSummary

HICCUP_S = 1.0
"""Longest time that a busy computer keeps this process or the simulator waiting, s of wall time."""
ONE_INTERRUPT_S = 0.5
"""Signals this close together count as one: make and timeout repeat the signal, s."""
PUBLICATIONS_KEPT = 50
"""Most estimates that wait for a slow broker; older ones are useless and are dropped."""


class AbandonedError(SwarmError):
    """The operator left the swarm in flight. The message says what each vehicle does next."""

    exit_code = 130


async def fly(
    mission_path: str | Path,
    out: str | Path | None = None,
    *,
    broker: str | None = None,
    forward: Sequence[str] = (),
    speedup: float = 1.0,
    seed: int | None = None,
    shadow: bool = False,
    set_failsafes: bool = False,
    on_snapshot: Callable[[Snapshot], None] | None = None,
    on_notice: Callable[[Notice], None] | None = None,
    snapshot_every_s: float = 1.0,
) -> FlightSummary:
    """Fly a mission with whatever vehicles answer on its link.

    Ctrl-C (SIGINT or SIGTERM) brings the swarm home; a second one leaves at once.

    Args:
        mission_path: A mission file.
        out: Directory of the recording; None records nothing but still gives the summary.
        broker: URL of the MQTT broker; None takes the mission's.
        forward: Other ground stations that MAVLink is passed on to, ``udpout://host:port``.
        speedup: Seconds of mission time per second; 1 for real vehicles.
        seed: Stamped on the results of a simulated flight.
        shadow: Compute and record every command, but send only requests for information.
        set_failsafes: The operator's consent to set the vehicles' failsafes for the flight,
            whatever the mission says.
        on_snapshot: Called every ``snapshot_every_s`` of wall time.
        on_notice: Called with each sentence for the operator.
        snapshot_every_s: See ``on_snapshot``, s of wall time.

    Returns:
        The summary.

    Raises:
        SwarmError: If the mission, its link, broker or recording cannot be used.
        AbandonedError: If the operator left the swarm in flight.
    """
    mission = load_mission(mission_path)
    if set_failsafes:
        consenting = mission.swarm.model_copy(update={"set_failsafes": True})
        mission = mission.model_copy(update={"swarm": consenting})
    address = BrokerAddress.parse(broker or mission.feed.broker)
    links = mission.swarm.link
    loop = asyncio.get_running_loop()
    began = loop.time()
    with Recording(mission, Path(mission_path), out, seed) as recording:
        utc_start_s = time.time()
        async with contextlib.AsyncExitStack() as stack:
            transport: Transport
            if mission.swarm.backend == "mavsdk":
                transport = MavsdkTransport(mavsdk_link(mission, forward, speedup), links)
            else:
                native = native_link(
                    mission,
                    signing=await stack.enter_async_context(signing(mission, utc_start_s, speedup)),
                    stations=station_addresses(forward, first=len(links)),
                    speedup=speedup,
                )
                transport = EndpointTransport(native, links, forward, recording, utc_start_s)
            stack.callback(transport.close)
            station = Station(
                mission,
                transport.link,
                0.0,
                utc_start_s,
                recording,
                HICCUP_S * speedup,
                shadow=shadow,
            )
            shell = _Shell(station, transport, lambda: (loop.time() - began) * speedup, speedup)
            await transport.open(station, shell.do)
            feed = await stack.enter_async_context(
                connect(
                    address,
                    topics=station.topics,
                    on_message=shell.message,
                    on_state=shell.broker_state,
                )
            )
            stack.enter_context(_interrupts(loop, shell))
            await stack.enter_async_context(_reports(shell, on_snapshot, snapshot_every_s))
            # Only now: a port in use or a missing broker leaves no empty recording behind.
            recording.open()
            await shell.run(feed, on_notice)
        return recording.summary(station, loop.time() - began)


class _Shell:
    """Delivers, drains, sends, re-arms."""

    def __init__(
        self,
        station: Station,
        transport: Transport,
        clock: Callable[[], float],
        speedup: float,
    ) -> None:
        self.station = station
        self._transport = transport
        self._clock = clock
        self._speedup = speedup
        self._is_running = False
        self._done: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._timer: asyncio.TimerHandle | None = None
        self._outbox: asyncio.Queue[tuple[str, bytes]] = asyncio.Queue(PUBLICATIONS_KEPT)
        self._on_notice: Callable[[Notice], None] | None = None
        self._asked_at_s: float | None = None

    async def run(self, feed: FeedClient, on_notice: Callable[[Notice], None] | None) -> None:
        """Fly until the mission has ended or something raised."""
        self._is_running, self._on_notice = True, on_notice
        publisher = asyncio.create_task(self._publish(feed))
        try:
            self.do(self._transport.start)
            await self._done
        finally:
            publisher.cancel()
            if self._timer is not None:
                self._timer.cancel()

    def message(self, topic: str, payload: bytes) -> None:
        self.do(lambda now: self.station.message(topic, payload, now))

    def broker_state(self, connected: bool) -> None:
        self.do(lambda now: self.station.broker_state(connected, now))

    def interrupt(self) -> None:
        """Bring the swarm home; the second time, leave at once."""
        now_s = asyncio.get_running_loop().time()
        if self._asked_at_s is None:
            self._asked_at_s = now_s
            self.do(self.station.request_return)
        elif now_s - self._asked_at_s > ONE_INTERRUPT_S and not self._done.done():
            self._done.set_exception(AbandonedError(what_vehicles_do(self.station)))

    def snapshot(self) -> Snapshot:
        """The mission at this instant."""
        return self.station.snapshot(self._clock())

    def do(self, action: Callable[[float], None]) -> None:
        """Do something with the station at this instant, then everything that follows from it."""
        if self._done.done() or not self._is_running:
            return
        try:
            now = self._clock()
            action(now)
            if now >= self.station.next_wake():
                self.station.wake(now)
            else:
                self.station.settle(now)
            self._send()
            if self.station.ended:
                self._done.set_result(None)
            else:
                self._arm()
        except Exception as error:
            # Nobody catches what a callback raises: the flight's own coroutine raises it.
            error.add_note(what_vehicles_do(self.station))
            self._done.set_exception(error)

    def _arm(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        delay = max(0.0, (self.station.next_wake() - self._clock()) / self._speedup)
        self._timer = asyncio.get_running_loop().call_later(delay, self.do, lambda _now: None)

    def _send(self) -> None:
        self._transport.flush()
        for publication in self.station.publications():
            if self._outbox.full():
                self._outbox.get_nowait()
            self._outbox.put_nowait(publication)
        for notice in self.station.notices():
            if self._on_notice is not None:
                self._on_notice(notice)

    async def _publish(self, feed: FeedClient) -> None:
        while True:
            topic, payload = await self._outbox.get()
            await feed.publish(topic, payload)


def what_vehicles_do(station: Station) -> str:
    """What each vehicle does by itself without setpoints, one line each."""
    lines = ["swarmctl has left; nobody commands the vehicles now:"]
    for vehicle in station.controller.fleet.vehicles.values():
        beat = vehicle.heartbeat
        if beat is None:
            lines.append(f"  vehicle {vehicle.sysid} was never heard.")
            continue
        position = vehicle.position
        where = f", {position.alt_amsl_m:.0f} m AMSL" if position is not None else ""
        personality = PERSONALITIES.get(beat.autopilot)
        does = "does what its autopilot decides"
        if personality is not None:
            known = vehicle.known_parameters
            does = personality.after_controller_stops(beat.mode, beat.armed, known)
        lines.append(f"  vehicle {vehicle.sysid} ({beat.mode_name}{where}) {does}.")
    lines += [f"  set back yourself: {text}." for text in station.controller.unrestored_parameters]
    return "\n".join(lines)


@contextlib.contextmanager
def _interrupts(loop: asyncio.AbstractEventLoop, shell: _Shell) -> Iterator[None]:
    signals = (signal.SIGINT, signal.SIGTERM)
    for number in signals:
        loop.add_signal_handler(number, shell.interrupt)
    try:
        yield
    finally:
        for number in signals:
            loop.remove_signal_handler(number)


@contextlib.asynccontextmanager
async def _reports(
    shell: _Shell, on_snapshot: Callable[[Snapshot], None] | None, every_s: float
) -> AsyncIterator[None]:
    async def report() -> None:
        while on_snapshot is not None:
            on_snapshot(shell.snapshot())
            await asyncio.sleep(every_s)

    task = asyncio.create_task(report())
    try:
        yield
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
