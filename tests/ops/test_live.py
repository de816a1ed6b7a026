"""The asyncio shell on real sockets: several links, another ground station, signing."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from swarmctl.decisions import Notice
from swarmctl.link.address import Address
from swarmctl.link.endpoints.udp import UdpEndpoint, open_udp
from swarmctl.ops.live import fly
from tests.brokers import Embedded, free_port
from tests.link.endpoints.loopback import LOOPBACK, Inbox, Server
from tests.link.signers import KEY, receiver
from tests.link.wire import Sender, unpack

pytestmark = pytest.mark.live

Short = Callable[..., Path]

# The mission gives up after 30 s without its vehicles: three seconds.
SPEEDUP = 10.0


@pytest.fixture
async def broker() -> AsyncIterator[str]:
    embedded = Embedded()
    await embedded.start()
    yield f"mqtt://{embedded.address}"
    await embedded.stop()


async def next_of(inbox: Inbox, name: str) -> bytes:
    """The next message of a name that is received."""
    while True:
        data, _ = await inbox.get()
        if unpack(data).get_type() == name:
            return data


@contextlib.asynccontextmanager
async def flight(
    mission: Path, broker: str, said: list[Notice], forward: tuple[str, ...] = ()
) -> AsyncIterator[None]:
    """A mission that waits for vehicles; it gives up at the end."""
    flying = asyncio.create_task(
        fly(mission, broker=broker, forward=forward, speedup=SPEEDUP, on_notice=said.append)
    )
    yield
    summary = await flying
    assert summary.result == "vehicle_silent"


async def test_vehicles_by_udp_and_tcp_and_a_station_that_listens_in(
    short_mission: Short, broker: str
) -> None:
    by_udp, qgc, server = Inbox(), Inbox(), Server()
    await server.start()
    radio = await open_udp(LOOPBACK, 0, by_udp.put)
    station: UdpEndpoint = await open_udp(LOOPBACK, 0, qgc.put)
    port = free_port()
    links = [f"udpin://127.0.0.1:{port}", str(server.url), f"udpin://127.0.0.1:{free_port()}"]
    mission = short_mission(swarm__link=links)
    said: list[Notice] = []
    host, qgc_port = station.address
    async with flight(mission, broker, said, (f"udpout://{host}:{qgc_port}",)):
        # It calls TCP servers; who sends by UDP is answered.
        assert unpack((await server.inbox.get())[0]).get_type() == "HEARTBEAT"
        two = Sender(2)
        (await server.client()).write(two.heartbeat() + b"noise")
        assert await next_of(qgc, "HEARTBEAT")
        one = Sender(1)
        radio.send(one.heartbeat(), Address("127.0.0.1", port))
        assert unpack(await next_of(by_udp, "COMMAND_LONG")).target_system == 1
        _, us = await qgc.get()
        arm = Sender(255, compid=190).pack("COMMAND_LONG", command=400, target_system=1)
        station.send(arm, us)
        while await next_of(by_udp, "COMMAND_LONG") != arm:
            pass
    texts = " ".join(notice.text for notice in said)
    assert f"Nothing was heard on {links[2]}" in texts
    assert links[0] not in texts.partition("Nothing was heard")[2].partition(":")[0]
    radio.close()
    station.close()
    await server.stop()


async def test_a_signing_key_signs_what_is_sent(
    short_mission: Short, broker: str, tmp_path: Path
) -> None:
    (tmp_path / "swarm.key").write_bytes(KEY)
    server = Server()
    await server.start()
    mission = short_mission(swarm__link=str(server.url), swarm__signing_key_file="swarm.key")
    said: list[Notice] = []
    async with flight(mission, broker, said):
        data, _ = await server.inbox.get()
        assert receiver(timestamp=0).decode(bytearray(data[:34])).get_signed()
        (await server.client()).write(Sender(1).heartbeat())
    assert any("without a signature" in notice.text for notice in said)
    await server.stop()
