"""TCP and serial endpoints on real loopback sockets and pseudo-terminals."""

from __future__ import annotations

import asyncio
import os
import pty
import sys
import tty

import pytest

from swarmctl.errors import LinkError
from swarmctl.link.address import Address
from swarmctl.link.endpoints import stream
from swarmctl.link.endpoints.stream import open_stream
from swarmctl.link.endpoints.url import EndpointUrl
from tests.brokers import free_port
from tests.link.endpoints.loopback import Inbox, Server, ignore
from tests.link.wire import Sender

pytestmark = pytest.mark.live


class Changes:
    """Waits for losses and returns of a connection."""

    def __init__(self) -> None:
        self.seen: list[bool] = []
        self._queue: asyncio.Queue[bool] = asyncio.Queue()

    def __call__(self, connected: bool) -> None:
        self.seen.append(connected)
        self._queue.put_nowait(connected)

    async def get(self) -> bool:
        async with asyncio.timeout(5.0):
            return await self._queue.get()


async def test_a_frame_in_two_pieces_arrives_whole_and_answers_go_back() -> None:
    server, inbox = Server(), Inbox()
    await server.start()
    endpoint = await open_stream(server.url, 4, inbox.put, Changes())
    client = await server.client()
    frame = Sender(1).heartbeat()
    client.write(frame + frame[:9])
    assert await inbox.get() == (frame, Address("127.0.0.1", server.port, 4))
    client.write(frame[9:])
    assert (await inbox.get())[0] == frame
    endpoint.send(b"our answer", endpoint.remote)
    assert (await server.inbox.get())[0] == b"our answer"
    endpoint.close()
    await server.stop()


async def test_a_lost_connection_is_told_once_and_opened_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(stream, "FIRST_PAUSE_S", 0.01)
    monkeypatch.setattr(stream, "LONGEST_PAUSE_S", 0.02)
    server, inbox, changes = Server(), Inbox(), Changes()
    await server.start()
    endpoint = await open_stream(server.url, 0, inbox.put, changes)
    frame = Sender(1).heartbeat()
    client = await server.client()
    client.write(frame + frame[:9])  # what was cut off must not spoil the next connection
    await inbox.get()
    await server.stop()
    assert await changes.get() is False
    endpoint.send(b"lost", endpoint.remote)
    await asyncio.sleep(0.1)  # several tries at a server that is down
    await server.start()
    assert await changes.get() is True
    assert changes.seen == [False, True]
    (await server.client()).write(frame)
    assert (await inbox.get())[0] == frame
    endpoint.send(b"found", endpoint.remote)
    assert (await server.inbox.get())[0] == b"found"
    endpoint.close()
    await server.stop()


async def test_a_server_that_is_not_there_is_named() -> None:
    port = free_port()
    with pytest.raises(LinkError) as caught:
        await open_stream(EndpointUrl("tcp", "127.0.0.1", port), 0, ignore, Changes())
    assert f"tcp://127.0.0.1:{port} cannot be opened" in str(caught.value)
    assert "is the vehicle or the router started?" in str(caught.value)


async def test_a_serial_line_carries_whole_frames_both_ways() -> None:
    radio, line = pty.openpty()
    tty.setraw(radio)
    inbox = Inbox()
    url = EndpointUrl("serial", os.ttyname(line), 57600)
    endpoint = await open_stream(url, 1, inbox.put, Changes())
    frame = Sender(1).heartbeat()
    os.write(radio, frame[:9])
    os.write(radio, frame[9:])
    assert await inbox.get() == (frame, Address(os.ttyname(line), 57600, 1))
    endpoint.send(frame, endpoint.remote)
    assert os.read(radio, 1000) == frame
    with pytest.raises(LinkError, match="lock"):  # two stations on one radio hear half each
        await open_stream(url, 2, ignore, Changes())
    endpoint.close()
    await asyncio.sleep(0.01)
    os.close(line)
    os.close(radio)


async def test_a_serial_line_that_is_not_there_or_runs_at_no_such_rate_is_named() -> None:
    with pytest.raises(LinkError, match=r"/dev/nothing:57600 cannot be opened .* plugged in"):
        await open_stream(EndpointUrl("serial", "/dev/nothing", 57600), 0, ignore, Changes())


async def test_a_serial_link_without_its_library_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "serial_asyncio_fast", None)
    with pytest.raises(LinkError, match=r"pip install 'swarmctl\[serial\]'"):
        await open_stream(EndpointUrl("serial", "/dev/nothing", 57600), 0, ignore, Changes())
