"""The URLs of MAVLink endpoints."""

from __future__ import annotations

import re
from typing import Literal, cast
from urllib.parse import urlsplit

import msgspec

from swarmctl.errors import UsageError

Scheme = Literal["udpin", "udpout", "tcp", "serial"]

_MAX_BAUD = 10_000_000
_MAX_PORT = 65_535


class EndpointUrl(msgspec.Struct, frozen=True):
    """Where MAVLink comes from and goes to.

    Attributes:
        scheme: ``udpin`` listens on a UDP port, ``udpout`` sends to one, ``tcp`` connects to a
            server, ``serial`` opens a serial line.
        host: Host to listen on, or of the other side; of a serial line, the device.
        port: Port; of a serial line, the baud rate.
    """

    scheme: Scheme
    host: str
    port: int

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}:{self.port}"


def parse_url(url: str) -> EndpointUrl:
    """Read an endpoint's URL.

    Raises:
        UsageError: If it is not such a URL.
    """
    serial = re.fullmatch(r"serial://(/[^:\s]+):(\d{1,8})", url)
    if serial is not None and 0 < int(serial[2]) <= _MAX_BAUD:
        return EndpointUrl("serial", serial[1], int(serial[2]))
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:  # a port that is no port, brackets that do not close
        raise _unusable(url) from None
    is_socket = parts.scheme in {"udpin", "udpout", "tcp"}
    least_port = 0 if parts.scheme == "udpin" else 1  # udpin://host:0 takes a free one
    if (
        not is_socket
        or not parts.hostname
        or parts.path
        or port is None
        or not least_port <= port <= _MAX_PORT
    ):
        raise _unusable(url)
    return EndpointUrl(cast(Scheme, parts.scheme), parts.hostname, port)


def _unusable(url: str) -> UsageError:
    return UsageError(
        f"{url!r} is no MAVLink link: it should be udpin://host:port (listens for vehicles, as in "
        f"udpin://0.0.0.0:14550), udpout://host:port, tcp://host:port or serial:///dev/name:baud."
    )
