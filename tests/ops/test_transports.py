"""How the bytes of a live flight travel: endpoints, port and recording joined."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from swarmctl.events import LinkConnection, Record
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.ops.recording import Recording
from swarmctl.ops.station import Station
from swarmctl.ops.transports import EndpointTransport
from swarmctl.ops.vehicle_links import native_link, station_addresses
from tests.link.wire import unpack
from tests.missions import DEMO, short_mission_text

UTC_S = 1_790_000_000.0
CONNECTED_S = 5.0


class Tape:
    """Keeps what is recorded."""

    def __init__(self) -> None:
        self.records: list[Record] = []

    def record(self, record: Record, utc_s: float) -> None:
        self.records.append(record)


class Frames(Recording):
    """Keeps the frames alone."""

    def __init__(self) -> None:
        super().__init__(parse_mission(DEMO.read_text()), Path(), None, None)
        self.raw: list[bytes] = []

    def traffic(self, frames: Iterable[tuple[float, bytes]], utc_offset_s: float) -> None:
        self.raw += [raw for _, raw in frames]
        assert utc_offset_s == UTC_S


@pytest.mark.live
async def test_vehicles_are_called_stations_are_not_and_a_lost_connection_is_told() -> None:
    heard = asyncio.Queue[bytes]()
    writers: list[asyncio.StreamWriter] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writers.append(writer)
        while data := await reader.read(512):
            heard.put_nowait(data)

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        ear.setblocking(False)
        urls = [f"tcp://127.0.0.1:{port}"]
        forward = [f"udpout://127.0.0.1:{ear.getsockname()[1]}"]
        mission = parse_mission(short_mission_text())
        link = native_link(mission, stations=station_addresses(forward, first=1))
        tape, frames = Tape(), Frames()
        transport = EndpointTransport(link, urls, forward, frames, UTC_S)
        station = Station(mission, link, 0.0, UTC_S, tape)
        told = asyncio.Event()

        def do(action: Callable[[float], None]) -> None:
            action(1.0)
            told.set()

        await transport.open(station, do)
        try:
            transport.start(0.0)
            station.wake(0.0)
            transport.flush()
            # The vehicles' side gets our heartbeat, the other ground station does not.
            sent = await asyncio.wait_for(heard.get(), CONNECTED_S)
            assert unpack(sent).get_type() == "HEARTBEAT"
            assert frames.raw == [sent]
            with pytest.raises(BlockingIOError):
                ear.recv(512)
            writers[0].close()
            await asyncio.wait_for(told.wait(), CONNECTED_S)
            assert tape.records[-1:] == [
                LinkConnection(received_s=1.0, url=urls[0], connected=False)
            ]
            station.wake(2.0)
            assert link.datagrams() == []  # nobody is called any more
        finally:
            transport.close()
            server.close()
