"""The other end of an endpoint, on this computer."""

from __future__ import annotations

import asyncio

from swarmctl.link.address import Address
from swarmctl.link.endpoints.url import EndpointUrl
from tests.brokers import free_port

LOOPBACK = EndpointUrl("udpin", "127.0.0.1", 0)


class Inbox:
    """What an endpoint received, waited for with patience."""

    def __init__(self) -> None:
        self._queue: asyncio.Queue[tuple[bytes, Address]] = asyncio.Queue()

    def put(self, data: bytes, address: Address) -> None:
        self._queue.put_nowait((data, address))

    async def get(self) -> tuple[bytes, Address]:
        async with asyncio.timeout(5.0):
            return await self._queue.get()


def ignore(_data: bytes, _address: Address) -> None:
    pass


class Server:
    """A TCP server, as SITL and routers are, that can hang up and come back."""

    def __init__(self) -> None:
        self.port = free_port()
        self.inbox = Inbox()
        self._server: asyncio.Server | None = None
        self._served: list[asyncio.StreamWriter] = []
        self._writers: asyncio.Queue[asyncio.StreamWriter] = asyncio.Queue()

    @property
    def url(self) -> EndpointUrl:
        return EndpointUrl("tcp", "127.0.0.1", self.port)

    async def start(self) -> None:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", self.port)

    async def client(self) -> asyncio.StreamWriter:
        async with asyncio.timeout(5.0):
            return await self._writers.get()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._served.append(writer)
        self._writers.put_nowait(writer)
        while data := await reader.read(1000):
            self.inbox.put(data, Address("client", 0))

    async def stop(self) -> None:
        assert self._server is not None
        self._server.close()
        for writer in self._served:
            writer.close()
            await writer.wait_closed()
        self._served.clear()
        await self._server.wait_closed()
