"""Brokers to test against: the embedded one and a real mosquitto."""

from __future__ import annotations

import asyncio
import contextlib
import getpass
import itertools
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from swarmctl.feed.broker import embedded_broker
from swarmctl.feed.client import BrokerAddress

MOSQUITTO = Path("/usr/sbin/mosquitto")


def _candidates() -> Iterator[int]:
    """Ports below those the kernel hands out, a block of their own for each pytest worker."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    block = range(20_000 + 1_000 * (worker % 10), 21_000 + 1_000 * (worker % 10))
    first = os.getpid() % len(block)  # another pytest on this machine begins elsewhere
    return itertools.cycle((*block[first:], *block[:first]))


_ports = _candidates()


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    """A port on loopback that nobody uses, and that is not given again soon."""
    while True:
        port = next(_ports)
        with socket.socket(socket.AF_INET, kind) as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


class Embedded:
    """The embedded broker, to be started and stopped at will."""

    def __init__(self) -> None:
        self.address = BrokerAddress("127.0.0.1", free_port())
        self._stack = contextlib.AsyncExitStack()

    async def start(self) -> None:
        await self._stack.enter_async_context(embedded_broker(self.address.host, self.address.port))

    async def stop(self) -> None:
        await self._stack.aclose()


class Mosquitto:
    """A mosquitto process, to be started and killed at will."""

    def __init__(self, directory: Path, settings: str = "allow_anonymous true") -> None:
        self.address = BrokerAddress("127.0.0.1", free_port())
        self._config = directory / "mosquitto.conf"
        # mosquitto started by root would become a user who cannot read the directory.
        self._config.write_text(
            f"listener {self.address.port} 127.0.0.1\nuser {getpass.getuser()}\n"
            f"set_tcp_nodelay true\n{settings}\n"
        )
        self._process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        self._process = await asyncio.create_subprocess_exec(
            MOSQUITTO, "-c", self._config, stderr=asyncio.subprocess.DEVNULL
        )
        async with asyncio.timeout(10):
            while not await self._listening():  # noqa: ASYNC110
                # The process has no other sign of being ready than its open port.
                await asyncio.sleep(0.01)

    async def _listening(self) -> bool:
        try:
            _, writer = await asyncio.open_connection(self.address.host, self.address.port)
        except OSError:
            return False
        writer.close()
        await writer.wait_closed()
        return True

    async def stop(self) -> None:
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
            await self._process.wait()


needs_mosquitto = pytest.mark.skipif(
    not MOSQUITTO.exists(), reason=f"no mosquitto at {MOSQUITTO}: apt-get install mosquitto"
)
