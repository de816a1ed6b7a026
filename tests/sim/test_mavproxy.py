"""Another independent client: MAVProxy loads parameters, switches modes, arms and takes off."""

from __future__ import annotations

import asyncio
import contextlib
import math
import shutil
import socket
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from sim.serve import serve
from swarmctl.feed.broker import embedded_broker
from tests.brokers import free_port
from tests.sim.flying import ALT, LAT, LON, simulation, vehicle

MAVPROXY = Path(sys.executable).with_name("mavproxy.py")

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(
        not MAVPROXY.exists() and shutil.which("mavproxy.py") is None,
        reason="no mavproxy.py: pip install --no-deps MAVProxy",
    ),
]

SPEEDUP = 5.0
PATIENCE_S = 10.0
"""MAVProxy is never silent for so long while there is something to come."""


class Console:
    """MAVProxy's console.

    Args:
        process: MAVProxy, its standard streams piped.
    """

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self._process = process
        self._said = ""

    async def expect(self, text: str) -> None:
        """Wait until it says something; its prompt tells the mode."""
        assert self._process.stdout is not None
        while text not in self._said:
            try:
                async with asyncio.timeout(PATIENCE_S):
                    data = await self._process.stdout.read(4096)
            except TimeoutError:
                data = b""
            assert data, f"it says nothing of {text!r}, but {self._said!r}"
            self._said += data.decode(errors="replace")
        self._said = self._said.partition(text)[2]

    def type(self, line: str) -> None:
        """Type a line."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n".encode())


@contextlib.asynccontextmanager
async def console(autopilot: str, directory: Path) -> AsyncIterator[Console]:
    """MAVProxy connected to a simulated vehicle."""
    port, stop = free_port(socket.SOCK_DGRAM), asyncio.Event()
    async with embedded_broker(port=0) as broker:
        simulator = asyncio.create_task(
            serve(
                simulation(vehicle(7, autopilot=autopilot)),
                controllers=[("127.0.0.1", port)],
                broker=(broker.host, broker.port),
                speedup=SPEEDUP,
                stop=stop,
            )
        )
        script = MAVPROXY if MAVPROXY.exists() else shutil.which("mavproxy.py")
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-u", str(script), f"--master=udpin:127.0.0.1:{port}"),
            # The vehicles have no file transfer: it would first time out on that.
            *(f"--state-basedir={directory}", "--cmd=set param_ftp False"),
            cwd=directory,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
        )
        try:
            yield Console(process)
        finally:
            process.kill()
            await process.wait()
            stop.set()
            await simulator


async def test_mavproxy_flies_ardupilot(tmp_path: Path) -> None:
    async with console("ardupilot", tmp_path) as mavproxy:
        await mavproxy.expect("Received 483 parameters")
        mavproxy.type("param set GUID_TIMEOUT 2")
        mavproxy.type("mode GUIDED")
        await mavproxy.expect("GUIDED>")
        mavproxy.type("param fetch GUID_TIMEOUT")
        await mavproxy.expect("GUID_TIMEOUT = 2.0")
        mavproxy.type("arm throttle")
        await mavproxy.expect("ARMED")
        mavproxy.type("takeoff 3")
        await mavproxy.expect("NAV_TAKEOFF: ACCEPTED")
        mavproxy.type("mode LAND")
        await mavproxy.expect("LAND>")
        await mavproxy.expect("DISARMED")


async def test_mavproxy_flies_px4(tmp_path: Path) -> None:
    async with console("px4", tmp_path) as mavproxy:
        await mavproxy.expect("Received 435 parameters")
        mavproxy.type("arm throttle")
        await mavproxy.expect("ARMED")
        mavproxy.type("takeoff 3")
        await mavproxy.expect("TAKEOFF>")
        await mavproxy.expect("LOITER>")
        mavproxy.type("long NAV_LAND 0 0 0 0 0 0 0")
        await mavproxy.expect("LAND>")
        await mavproxy.expect("DISARMED")


async def test_mavproxy_loads_a_mission_and_ardupilot_flies_it(tmp_path: Path) -> None:
    lat, lon = math.degrees(LAT), math.degrees(LON)
    home, north = (lat, lon), (lat + 3e-4, lon)
    # Frames and commands: home, take-off, waypoint, return.
    items = ((0, 16, *home, ALT), (3, 22, *home, 8), (3, 16, *north, 8), (3, 20, 0, 0, 0))
    lines = [
        f"{seq}\t0\t{frame}\t{command}\t0\t0\t0\t0\t{x}\t{y}\t{z}\t1"
        for seq, (frame, command, x, y, z) in enumerate(items)
    ]
    (tmp_path / "mission.txt").write_text("\n".join(["QGC WPL 110", *lines]) + "\n")
    async with console("ardupilot", tmp_path) as mavproxy:
        await mavproxy.expect("Received 483 parameters")
        mavproxy.type("wp load mission.txt")
        await mavproxy.expect("Loaded 4 waypoint")
        await mavproxy.expect("Got MISSION_ACK: TYPE_MISSION: ACCEPTED")
        mavproxy.type("mode GUIDED")
        await mavproxy.expect("GUIDED>")
        mavproxy.type("arm throttle")
        await mavproxy.expect("ARMED")
        mavproxy.type("mode AUTO")
        await mavproxy.expect("AUTO>")
        mavproxy.type("long MISSION_START 0 0 0 0 0 0 0")
        for seq in (2, 3):
            await mavproxy.expect(f"waypoint {seq}")
        await mavproxy.expect("DISARMED")
