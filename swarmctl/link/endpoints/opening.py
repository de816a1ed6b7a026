"""All endpoints of a ground station, opened together."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from swarmctl.link.address import Address
from swarmctl.link.endpoints.stream import StreamEndpoint, open_stream
from swarmctl.link.endpoints.udp import OnData, UdpEndpoint, open_udp
from swarmctl.link.endpoints.url import EndpointUrl, parse_url

OnConnection = Callable[[Address, str, bool], None]
"""Called with an endpoint's address and URL, and False when it is lost, True when it is back."""


class Endpoints:
    """Several endpoints that send and receive as one; use :func:`open_endpoints`.

    Attributes:
        called: Addresses of the endpoints that call instead of listening, connected or not.
    """

    def __init__(self) -> None:
        self._opened: list[UdpEndpoint | StreamEndpoint] = []

    @property
    def called(self) -> list[Address]:
        """Addresses of the endpoints that call instead of listening."""
        return [opened.remote for opened in self._opened if opened.remote is not None]

    def send(self, data: bytes, address: Address) -> None:
        """Send by the endpoint to which an address belongs."""
        self._opened[address.endpoint].send(data, address)

    def close(self) -> None:
        """Close all of them."""
        for opened in self._opened:
            opened.close()

    async def open(self, url: EndpointUrl, on_data: OnData, on_connection: OnConnection) -> None:
        """Open one more endpoint.

        Raises:
            LinkError: If it cannot be opened.
        """
        number = len(self._opened)
        if url.scheme in {"udpin", "udpout"}:
            self._opened.append(await open_udp(url, number, on_data))
            return

        def connection(connected: bool) -> None:
            on_connection(Address(url.host, url.port, number), str(url), connected)

        self._opened.append(await open_stream(url, number, on_data, connection))


async def open_endpoints(
    urls: Sequence[str], on_data: OnData, on_connection: OnConnection
) -> Endpoints:
    """Open endpoints; the number of each is its place in the list.

    Args:
        urls: See :func:`swarmctl.link.endpoints.url.parse_url`.
        on_data: Called in the event loop with what came in, and where from.
        on_connection: Called in the event loop when a connection is lost, and when it is back.

    Raises:
        UsageError: If a URL is wrong.
        LinkError: If an endpoint cannot be opened; the others are closed again.
    """
    parsed = [parse_url(url) for url in urls]
    endpoints = Endpoints()
    try:
        for url in parsed:
            await endpoints.open(url, on_data, on_connection)
    except BaseException:
        endpoints.close()
        raise
    return endpoints
