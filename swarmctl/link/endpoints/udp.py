"""UDP endpoints: a port that listens, or a socket that sends to a port elsewhere."""

from __future__ import annotations

import asyncio
import errno
from collections.abc import Callable
from typing import cast

from swarmctl.errors import LinkError
from swarmctl.link.address import Address
from swarmctl.link.endpoints.url import EndpointUrl

OnData = Callable[[bytes, Address], None]
"""Called with what came in, a datagram or whole frames of a stream, and where from."""


class UdpEndpoint(asyncio.DatagramProtocol):
    """An open UDP port; use :func:`open_udp`.

    Args:
        endpoint: Its number among our endpoints.
        on_data: Called in the event loop with each datagram.
        remote: Where ``udpout`` sends to; None for ``udpin``.
    """

    _transport: asyncio.DatagramTransport

    def __init__(self, endpoint: int, on_data: OnData, remote: Address | None) -> None:
        self._endpoint = endpoint
        self._on_data = on_data
        self.remote = remote

    @property
    def address(self) -> tuple[str, int]:
        """Host and port on this side."""
        host, port = self._transport.get_extra_info("sockname")[:2]
        return host, port

    def send(self, data: bytes, address: Address) -> None:
        """Send a datagram. One that cannot be delivered is lost, as on any radio."""
        self._transport.sendto(data, None if self.remote is not None else address[:2])

    def close(self) -> None:
        """Stop. The port is free after the event loop's next turn."""
        self._transport.close()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by asyncio."""
        # The class that asyncio hands over is not a subclass of it in Python 3.11.
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Called by asyncio."""
        # IPv6 adds flow and scope to the address.
        self._on_data(data, self.remote or Address(addr[0], addr[1], self._endpoint))


async def open_udp(url: EndpointUrl, endpoint: int, on_data: OnData) -> UdpEndpoint:
    """Open a UDP port.

    Args:
        url: ``udpin://host:port``, where port 0 takes a free one, or ``udpout://host:port``.
        endpoint: Its number among our endpoints.
        on_data: Called in the event loop with each datagram.

    Raises:
        LinkError: If the port cannot be opened or the host is unknown.
    """
    loop = asyncio.get_running_loop()
    here = (url.host, url.port)
    is_out = url.scheme == "udpout"
    remote = Address(url.host, url.port, endpoint) if is_out else None
    try:
        _, opened = await loop.create_datagram_endpoint(
            lambda: UdpEndpoint(endpoint, on_data, remote),
            local_addr=None if is_out else here,
            remote_addr=here if is_out else None,
        )
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise LinkError(
                f"UDP port {url.port} on {url.host} is in use: another ground station or swarmctl "
                f"listens there; stop it, or change swarm.link in the mission file."
            ) from error
        means = (
            "check the name and the network"
            if is_out
            else "use an address of this computer, for example udpin://0.0.0.0:14550"
        )
        raise LinkError(f"{url} cannot be opened ({error.strerror}): {means}.") from error
    return opened
