"""TCP connections and serial lines: streams that are opened again when they are lost."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from types import ModuleType
from typing import cast

from swarmctl.errors import LinkError
from swarmctl.link.address import Address
from swarmctl.link.codec.framing import Framer
from swarmctl.link.endpoints.udp import OnData
from swarmctl.link.endpoints.url import EndpointUrl

FIRST_PAUSE_S = 0.5
"""Pause before the first try to open a lost connection again, s; later ones double."""
LONGEST_PAUSE_S = 8.0
"""No pause is longer than this, s."""
OPENING_TIMEOUT_S = 5.0
"""A server that has not answered in this time counts as absent, s."""
BACKLOG_BYTES = 16_384
"""With this much unsent, new data is dropped: old setpoints are useless, and more follow."""

OnConnection = Callable[[bool], None]
"""Called when a connection was lost (False) and when it is back (True)."""


class _Connection(asyncio.Protocol):
    """One connection's life, with a framer of its own."""

    transport: asyncio.Transport

    def __init__(self, on_bytes: Callable[[bytes], None]) -> None:
        self._on_bytes = on_bytes
        self._framer = Framer()
        self.lost: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by asyncio."""
        self.transport = cast(asyncio.Transport, transport)

    def data_received(self, data: bytes) -> None:
        """Called by asyncio."""
        whole = self._framer.feed(data)
        if whole:
            self._on_bytes(whole)

    def connection_lost(self, exc: Exception | None) -> None:
        """Called by asyncio."""
        if not self.lost.done():
            self.lost.set_result(None)


class StreamEndpoint:
    """A connection that is opened again whenever it is lost; use :func:`open_stream`.

    Args:
        url: ``tcp://host:port`` or ``serial:///dev/name:baud``.
        endpoint: Its number among our endpoints.
        on_data: Called in the event loop with whole frames.
        on_connection: Called in the event loop when the connection is lost, and when it is back.
    """

    def __init__(
        self, url: EndpointUrl, endpoint: int, on_data: OnData, on_connection: OnConnection
    ) -> None:
        self._url = url
        self._on_data = on_data
        self._on_connection = on_connection
        self._connection: _Connection | None = None
        self._keeper: asyncio.Task[None] | None = None
        self.remote = Address(url.host, url.port, endpoint)

    async def open(self) -> None:
        """Open it for the first time, and keep it open from then on.

        Raises:
            LinkError: If it cannot be opened.
        """
        try:
            self._connection = await self._connect()
        except (OSError, ValueError) as error:  # pyserial calls a bad baud rate a ValueError
            what = (
                "is the device plugged in, and may you use it?"
                if self._url.scheme == "serial"
                else "is the vehicle or the router started?"
            )
            reason = getattr(error, "strerror", None) or str(error) or "it does not answer"
            raise LinkError(f"{self._url} cannot be opened ({reason}): {what}") from error
        self._keeper = asyncio.create_task(self._keep())

    def send(self, data: bytes, _address: Address) -> None:
        """Send; data that cannot be sent now is lost, as on any radio."""
        connection = self._connection
        if connection is None or connection.transport.get_write_buffer_size() > BACKLOG_BYTES:
            return
        connection.transport.write(data)

    def close(self) -> None:
        """Close it for good."""
        if self._keeper is not None:
            self._keeper.cancel()
        if self._connection is not None:
            self._connection.transport.close()

    async def _keep(self) -> None:
        while self._connection is not None:
            await self._connection.lost
            self._connection = None
            self._on_connection(False)
            pause_s = FIRST_PAUSE_S
            while self._connection is None:
                await asyncio.sleep(pause_s)
                pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)
                with contextlib.suppress(OSError):
                    self._connection = await self._connect()
            self._on_connection(True)

    async def _connect(self) -> _Connection:
        """Open the connection; OSError if that fails."""
        url, loop = self._url, asyncio.get_running_loop()

        def protocol() -> _Connection:
            return _Connection(lambda data: self._on_data(data, self.remote))

        if url.scheme == "serial":
            library = _serial_library()
            _, connection = await library.create_serial_connection(
                loop, protocol, url.host, baudrate=url.port, exclusive=True
            )
        else:
            async with asyncio.timeout(OPENING_TIMEOUT_S):  # its TimeoutError is an OSError
                _, connection = await loop.create_connection(protocol, url.host, url.port)
        return cast(_Connection, connection)


def _serial_library() -> ModuleType:
    """The library pyserial for asyncio, which only serial lines need.

    Raises:
        LinkError: If it is not installed.
    """
    try:
        import serial_asyncio_fast  # noqa: PLC0415 - an option
    except ImportError as error:
        raise LinkError(
            "A serial:// link needs pyserial-asyncio-fast, which is not installed: "
            "pip install 'swarmctl[serial]'."
        ) from error
    return serial_asyncio_fast


async def open_stream(
    url: EndpointUrl, endpoint: int, on_data: OnData, on_connection: OnConnection
) -> StreamEndpoint:
    """Connect to a TCP server or open a serial line; arguments as of :class:`StreamEndpoint`.

    Raises:
        LinkError: If it cannot be opened, or the library for it is not installed.
    """
    opened = StreamEndpoint(url, endpoint, on_data, on_connection)
    await opened.open()
    return opened
