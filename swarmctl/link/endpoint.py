"""The UDP socket: delivers datagrams to whoever opened it, and sends theirs. Nothing else."""

from __future__ import annotations

import asyncio
import errno
from collections.abc import Callable
from typing import cast
from urllib.parse import urlsplit

from swarmctl.errors import LinkError

OnDatagram = Callable[[bytes, tuple[str, int]], None]
"""Called with each datagram and the address (host, port) it came from."""


def parse_url(url: str) -> tuple[str, int]:
    """Host and port to listen on.

    Args:
        url: ``udpin://host:port``.

    Raises:
        LinkError: It is anything else.
    """
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:  # a port that is no port, brackets that do not close
        port = None
    if port is None or parts.scheme != "udpin" or not parts.hostname or parts.path:
        raise LinkError(
            f"swarm.link is {url!r}: only udpin://host:port is supported, which listens for "
            f"vehicles on a UDP port, for example udpin://0.0.0.0:14550."
        )
    return parts.hostname, port


class UdpEndpoint(asyncio.DatagramProtocol):
    """An open UDP port; use :func:`open_udp`.

    Args:
        on_datagram: Called in the event loop with each datagram.
    """

    _transport: asyncio.DatagramTransport

    def __init__(self, on_datagram: OnDatagram) -> None:
        self._on_datagram = on_datagram

    @property
    def address(self) -> tuple[str, int]:
        """Host and port it listens on."""
        host, port = self._transport.get_extra_info("sockname")[:2]
        return host, port

    def send(self, data: bytes, address: tuple[str, int]) -> None:
        """Send a datagram. One that cannot be delivered is lost, as on any radio."""
        self._transport.sendto(data, address)

    def close(self) -> None:
        """Stop listening. The port is free after the event loop's next turn."""
        self._transport.close()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by asyncio."""
        # A cast, because the class that asyncio hands over is no subclass of it in Python 3.11.
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Called by asyncio."""
        self._on_datagram(data, addr[:2])  # IPv6 adds flow and scope


async def open_udp(url: str, on_datagram: OnDatagram) -> UdpEndpoint:
    """Listen on a UDP port.

    Args:
        url: ``udpin://host:port``; port 0 takes a free one.
        on_datagram: Called in the event loop with each datagram.

    Raises:
        LinkError: The URL is no such URL, or the port cannot be opened.
    """
    host, port = parse_url(url)
    loop = asyncio.get_running_loop()
    try:
        _, endpoint = await loop.create_datagram_endpoint(
            lambda: UdpEndpoint(on_datagram), local_addr=(host, port)
        )
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise LinkError(
                f"UDP port {port} on {host} is in use: another ground station or swarmctl "
                f"listens there; stop it, or change swarm.link in the mission file."
            ) from error
        raise LinkError(
            f"swarm.link is {url!r}, which cannot be opened ({error.strerror}): use an address "
            f"of this computer, for example udpin://0.0.0.0:14550."
        ) from error
    return endpoint
