"""Fixtures shared by all rooms: free ports, a short mission, a real mosquitto."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.brokers import MOSQUITTO, Mosquitto, free_port
from tests.missions import short_mission_text


@pytest.fixture
def short_mission(tmp_path: Path) -> Callable[..., Path]:
    """Writes the short mission, on free ports and with some fields changed."""

    def write(**changes: object) -> Path:
        ports: dict[str, object] = {
            "swarm__link": f"udpin://127.0.0.1:{free_port(socket.SOCK_DGRAM)}",
            "feed__broker": f"mqtt://127.0.0.1:{free_port()}",
        }
        file = tmp_path / "short.yaml"
        file.write_text(short_mission_text(**(ports | changes)))
        return file

    return write


@pytest.fixture
def mosquitto(tmp_path: Path) -> Iterator[str]:
    """URL of a mosquitto broker of our own, for tests that are not coroutines."""
    if not MOSQUITTO.exists():
        pytest.skip(f"no mosquitto at {MOSQUITTO}: apt-get install mosquitto")
    broker = Mosquitto(tmp_path)
    with asyncio.Runner() as runner:
        runner.run(broker.start())
        yield f"mqtt://{broker.address}"
        runner.run(broker.stop())
