"""Where somebody is heard and answered."""

from __future__ import annotations

from typing import NamedTuple


class Address(NamedTuple):
    """Where somebody is heard and answered.

    Attributes:
        host: Host of the other side; of a serial line, the device.
        port: Its port; of a serial line, the baud rate.
        endpoint: Number of our own endpoint, counted from 0.
    """

    host: str
    port: int
    endpoint: int = 0

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"
