"""How the bytes of a live flight's vehicle link travel: by our own endpoints, or inside MAVSDK."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

from swarmctl.link.address import Address
from swarmctl.link.datagram_port import DatagramPort
from swarmctl.link.endpoints.opening import Endpoints, open_endpoints
from swarmctl.link.mavlink_link import MavlinkLink
from swarmctl.link.vehicle_link import VehicleLink
from swarmctl.ops.recording import Recording
from swarmctl.ops.station import Station

if TYPE_CHECKING:
    from swarmctl.link.mavsdk_link import MavsdkLink

Do = Callable[[Callable[[float], None]], None]
"""Calls something with the time, s, and then does whatever follows from it."""


class Transport(Protocol):
    """Moves the bytes of a vehicle link.

    Attributes:
        link: The link.
    """

    @property
    def link(self) -> VehicleLink:
        """The link."""

    async def open(self, station: Station, do: Do) -> None:
        """Open what the link speaks through.

        Args:
            station: Is told of a lost connection.
            do: Acts on what arrives. It must be called in the event loop.

        Raises:
            UsageError: If a URL is wrong.
            LinkError: If one cannot be opened.
        """

    def start(self, now: float) -> None:
        """Begin to speak: the flight begins."""

    def flush(self) -> None:
        """Send what waits to be sent."""

    def close(self) -> None:
        """Close everything."""


class EndpointTransport:
    """Moves datagrams between our endpoints and a native link, and records every frame.

    Args:
        link: The link.
        urls: Where the vehicles are.
        forward: Other ground stations that MAVLink is passed on to.
        recording: Keeps the frames.
        utc_offset_s: UTC less the station's monotonic time, s.
    """

    def __init__(
        self,
        link: MavlinkLink,
        urls: Sequence[str],
        forward: Sequence[str],
        recording: Recording,
        utc_offset_s: float,
    ) -> None:
        self.link = link
        self._port: DatagramPort = link
        self._urls = tuple(urls)
        self._forward = tuple(forward)
        self._recording = recording
        self._utc_offset_s = utc_offset_s
        self._endpoints = Endpoints()

    async def open(self, station: Station, do: Do) -> None:
        """See :class:`Transport`."""

        def datagram(data: bytes, address: Address) -> None:
            do(lambda now: self._port.receive_datagram(data, address, now))

        def connection(address: Address, url: str, connected: bool) -> None:
            def tell(now: float) -> None:
                if connected:
                    self._port.open(address, now)
                else:
                    self._port.close(address)
                station.connection(url, connected, now)

            do(tell)

        self._endpoints = await open_endpoints((*self._urls, *self._forward), datagram, connection)

    def start(self, now: float) -> None:
        """See :class:`Transport`."""
        self._port.listen(self._urls, now)
        for address in self._endpoints.called:
            if address.endpoint < len(self._urls):
                self._port.open(address, now)

    def flush(self) -> None:
        """See :class:`Transport`."""
        self._recording.traffic(self._port.traffic(), self._utc_offset_s)
        for data, address in self._port.datagrams():
            self._endpoints.send(data, address)

    def close(self) -> None:
        """See :class:`Transport`."""
        self._endpoints.close()


class MavsdkTransport:
    """Lets MAVSDK move the bytes, on a thread of its own.

    Args:
        link: The link.
        urls: Where the vehicles are.
    """

    def __init__(self, link: MavsdkLink, urls: Sequence[str]) -> None:
        self.link = link
        self._urls = tuple(urls)

    async def open(self, station: Station, do: Do) -> None:
        """See :class:`Transport`."""
        loop = asyncio.get_running_loop()

        def wake() -> None:
            # Something is in the link's inbox: its timer is due.
            loop.call_soon_threadsafe(do, lambda _now: None)

        self.link.connect(self._urls, wake)

    def start(self, now: float) -> None:
        """Nothing to do: MAVSDK speaks from the beginning."""

    def flush(self) -> None:
        """Nothing to do: MAVSDK sends at once."""

    def close(self) -> None:
        """See :class:`Transport`."""
        self.link.close()
