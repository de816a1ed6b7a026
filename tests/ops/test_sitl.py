"""Vehicles that somebody else simulates: their receivers hear them through ``--forward``."""

from __future__ import annotations

import asyncio
import contextlib
import math
import socket
import sys
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from sim.sitl_receivers import SitlReceivers
from sim.world import World
from swarmctl.decisions import Notice
from swarmctl.errors import SwarmError, UsageError
from swarmctl.link.address import Address
from swarmctl.link.endpoints.udp import open_udp
from swarmctl.mission.mission_file_loading import load_mission, parse_mission
from swarmctl.ops.live import fly
from swarmctl.ops.sim_config import sim_config
from swarmctl.ops.simulation import serve_receivers_of, simulated
from swarmctl.ops.station import Station
from swarmctl.ops.vehicle_links import native_link
from tests.brokers import free_port
from tests.link.endpoints.loopback import LOOPBACK
from tests.link.wire import unpack
from tests.missions import BRIEF, short_mission_text
from tests.summaries import known

Short = Callable[..., Path]

SPEEDUP = 10.0
UTC0 = 1_790_000_000.0
STEP_S = 0.02
HEARTBEAT, POSITION = dialect.MAVLINK_MSG_ID_HEARTBEAT, dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT


class Witness:
    """Another station, which keeps the last of each kind of message."""

    def __init__(self) -> None:
        self._last: dict[tuple[int, int], bytes] = {}

    def hear(self, data: bytes, _: Address) -> None:
        # System and message id of a MAVLink 2 frame; all those used here are below 256.
        self._last[data[5], data[7]] = data

    def last(self, sysid: int, message: int) -> Any:  # noqa: ANN401 - pymavlink is untyped
        return unpack(self._last[sysid, message])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("autopilot", "publish"), [("ardupilot", "range_differences"), ("px4", "arrival_times")]
)
def test_receivers_that_only_listen_are_all_a_mission_needs(autopilot: str, publish: str) -> None:
    """On a virtual clock: nothing of the vehicles reaches the receivers but what is forwarded.

    The simulator has a speed-up, which its PX4s' UTC does not follow; its vehicles were started
    one after the other, and their simulations are not all as fast as they should be.
    """
    mission = parse_mission(
        short_mission_text(
            **BRIEF,
            swarm__autopilot=autopilot,
            sim__autopilot=autopilot,
            sim__receivers={"publish": publish},
        )
    )
    ear = Address("receivers", 14600, 1)
    config = sim_config(mission, 1, UTC0, speedup=5.0)
    unequal = tuple(
        replace(vehicle, boot_delay_s=delay_s, clock=replace(vehicle.clock, drift=drift))
        for vehicle, delay_s, drift in zip(
            config.vehicles, (0.0, 3.0, 6.0, 11.0), (0.0, -0.03, 0.02, -0.06), strict=True
        )
    )
    config = replace(config, vehicles=unequal)
    world, listening = World(config), SitlReceivers(config, speedup=5.0)
    link = native_link(mission, stations=[ear], speedup=5.0)
    station = Station(mission, link, 0.0, UTC0, None)
    steps = 0
    while not station.ended:
        steps += 1
        now = steps * STEP_S
        assert now < 600.0, f"still {station.snapshot(now).phase}"
        world.advance(now)
        for sysid, data in world.datagrams():
            link.receive_datagram(data, Address("memory", sysid), now)
        for topic, payload in listening.publications():
            station.message(topic, payload, now)
        if now >= station.next_wake():
            station.wake(now)
        else:
            station.settle(now)
        for data, address in link.datagrams():
            if address == ear:
                listening.receive(data)
            else:
                world.receive_datagram(address.port, data)
    assert station.controller.result[0] == "located", station.controller.result[1]
    assert listening.complaints() == []
    for vehicle in station.controller.fleet.vehicles.values():
        assert not vehicle.is_armed
        assert world.vehicle_state(vehicle.sysid).on_ground


@contextlib.asynccontextmanager
async def receivers_only(mission: Path, listen: str) -> AsyncIterator[None]:
    """``swarmctl sim --receivers-only`` in a process of its own."""
    pipe = asyncio.subprocess.PIPE
    arguments = ["sim", str(mission), "--receivers-only", "--listen", listen, "--with-parent"]
    arguments += ["--speedup", str(SPEEDUP)]
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "swarmctl", *arguments, stdin=pipe, stdout=pipe
    )
    assert process.stdin is not None
    assert process.stdout is not None
    assert f"heard at {listen}" in (await process.stdout.readline()).decode()
    yield
    process.stdin.close()
    assert await process.wait() == 0


@pytest.mark.live
@pytest.mark.slow
async def test_a_mission_finds_the_emitter_for_vehicles_simulated_elsewhere(
    short_mission: Short, tmp_path: Path
) -> None:
    links = [f"udpin://127.0.0.1:{free_port(socket.SOCK_DGRAM)}" for _ in range(4)]
    # PX4's UTC does not follow its simulator's speed-up.
    path = short_mission(**BRIEF, swarm__link=links, swarm__autopilot="px4", sim__autopilot="px4")
    # The vehicles' own simulation knows nothing of our broker: all measurements come from
    # what the vehicles report.
    elsewhere = tmp_path / "elsewhere.yaml"
    elsewhere.write_text(
        short_mission_text(
            **BRIEF,
            swarm__link=links,
            swarm__autopilot="px4",
            sim__autopilot="px4",
            feed__broker=f"mqtt://127.0.0.1:{free_port()}",
        )
    )
    witness = Witness()
    station = await open_udp(LOOPBACK, 0, witness.hear)
    listen = f"127.0.0.1:{free_port(socket.SOCK_DGRAM)}"
    forward = [f"udpout://{listen}", f"udpout://127.0.0.1:{station.address[1]}"]
    said: list[Notice] = []
    async with receivers_only(path, f"udpin://{listen}"), simulated(elsewhere, speedup=SPEEDUP):
        summary = await fly(path, forward=forward, speedup=SPEEDUP, on_notice=said.append)
    station.close()
    assert summary.result == "located", [notice.text for notice in said]
    # Its own word for it, and the truth's: three of its sigmas.
    error, sigma = known(summary.final_error_m), known(summary.final_sigma_m)
    assert error < 3.0 * sigma
    mission = load_mission(path)
    for i, sysid in enumerate(mission.swarm.sysids):
        assert not witness.last(sysid, HEARTBEAT).base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED
        at = witness.last(sysid, POSITION)
        east, north, up = mission.frame.to_enu(
            math.radians(at.lat / 1e7), math.radians(at.lon / 1e7), at.alt / 1e3
        )
        # Home is within 3 m by a report with 0.5 m of noise per axis, and so is this report: 3 m
        # and three sigmas of their difference.
        assert math.dist((east, north), (20.0 * i, 0.0)) < 3.0 + 3.0 * math.sqrt(2.0) * 0.5
        assert up < 3.0


async def test_what_cannot_be_listened_to_is_a_sentence() -> None:
    mission = parse_mission(short_mission_text(feed__broker=f"mqtt://127.0.0.1:{free_port()}"))

    async def listen(url: str) -> None:
        await serve_receivers_of(
            mission,
            listen=url,
            seed=None,
            speedup=1.0,
            broker=None,
            ready=lambda: None,
            stop=asyncio.Event(),
        )

    with pytest.raises(
        UsageError, match=r"--listen is 'tcp://10\.0\.0\.1:5760'.* udpin://host:port"
    ):
        await listen("tcp://10.0.0.1:5760")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        with pytest.raises(SwarmError, match=rf"cannot listen on UDP port {port}.*--listen"):
            await listen(f"udpin://127.0.0.1:{port}")
