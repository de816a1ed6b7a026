"""The shell over real sockets and a real broker."""

from __future__ import annotations

import asyncio
import socket
from functools import partial
from typing import cast

import aiomqtt
import msgspec
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.faults import Faults
from sim.serve import LONGEST_TURN_S, Shell, serve
from swarmctl.errors import SimulationError
from swarmctl.feed.broker import embedded_broker
from swarmctl.feed.schema import TruthMessage
from tests.brokers import free_port
from tests.sim.flying import simulation, vehicle

pytestmark = pytest.mark.live


class Controller(asyncio.DatagramProtocol):
    """Asks every vehicle it hears for one position stream and counts what comes."""

    def __init__(self) -> None:
        self.streaming: set[int] = set()
        self.peers: dict[int, tuple[str, int]] = {}
        self.done = asyncio.Event()
        self._encoder = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        # asyncio's own datagram transport is not declared as one.
        self._transport = cast("asyncio.DatagramTransport", transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        decoder = mavlink.MAVLink(None)
        for message in decoder.parse_buffer(data):
            sysid = message.get_srcSystem()
            if sysid not in self.peers:
                self.peers[sysid] = addr
                ask = mavlink.MAVLink_command_long_message(
                    sysid, 1, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, 33, 1e5, 0, 0, 0, 0, 0
                )
                self._transport.sendto(bytes(ask.pack(self._encoder)), addr)
            if message.get_type() == "GLOBAL_POSITION_INT" and message.lat != 0:
                self.streaming.add(sysid)
                if self.streaming == {1, 2}:
                    self.done.set()


async def test_vehicles_speak_udp_and_the_truth_comes_over_mqtt() -> None:
    async with asyncio.timeout(10.0), embedded_broker(port=0) as broker:
        controller_port = free_port(socket.SOCK_DGRAM)
        ready, stop = asyncio.Event(), asyncio.Event()
        async with aiomqtt.Client(broker.host, broker.port) as subscriber:
            await subscriber.subscribe("swarm/alpha/#")
            simulator = asyncio.create_task(
                serve(
                    simulation(vehicle(1), vehicle(2, 10.0)),
                    controllers=[("127.0.0.1", controller_port)],
                    broker=(broker.host, broker.port),
                    speedup=20.0,
                    ready=ready.set,
                    stop=stop,
                )
            )
            await ready.wait()
            # Until the first truth nobody listens: the refused datagrams must not matter.
            message = await anext(aiter(subscriber.messages))
            assert message.topic.value == "swarm/alpha/truth"
            assert isinstance(message.payload, bytes)
            truth = msgspec.json.decode(message.payload, type=TruthMessage)
            assert truth.epoch_utc_s > simulation().utc_start_s
            transport, controller = await asyncio.get_running_loop().create_datagram_endpoint(
                Controller, local_addr=("127.0.0.1", controller_port)
            )
            await controller.done.wait()
            assert len(set(controller.peers.values())) == 2
            transport.close()
        stop.set()
        await simulator


async def test_every_vehicle_may_send_to_a_port_of_its_own() -> None:
    loop = asyncio.get_running_loop()
    async with asyncio.timeout(10.0), embedded_broker(port=0) as broker:
        heard: list[set[int]] = [set(), set()]
        both, stop = asyncio.Event(), asyncio.Event()

        class Port(asyncio.DatagramProtocol):
            def __init__(self, number: int) -> None:
                self._number = number

            def datagram_received(self, data: bytes, _addr: tuple[str, int]) -> None:
                heard[self._number].add(data[5])  # the system id of a MAVLink 2 frame
                if all(heard):
                    both.set()

        ports = [
            await loop.create_datagram_endpoint(partial(Port, i), local_addr=("127.0.0.1", 0))
            for i in (0, 1)
        ]
        serving = serve(
            simulation(vehicle(1), vehicle(2, 10.0)),
            controllers=[port.get_extra_info("sockname") for port, _ in ports],
            broker=(broker.host, broker.port),
            speedup=20.0,
            stop=stop,
        )

        async def hear_both() -> None:
            await both.wait()
            stop.set()

        await asyncio.gather(serving, hear_both())
        for port, _ in ports:
            port.close()
    assert heard == [{1}, {2}]


async def test_simulation_time_runs_at_the_speed_up() -> None:
    async with asyncio.timeout(10.0), embedded_broker(port=0) as broker:
        stop, started = asyncio.Event(), asyncio.Event()
        loop = asyncio.get_running_loop()
        async with aiomqtt.Client(broker.host, broker.port) as subscriber:
            await subscriber.subscribe("swarm/alpha/truth")
            simulator = asyncio.create_task(
                serve(
                    simulation(),
                    controllers=[("127.0.0.1", free_port(socket.SOCK_DGRAM))],
                    broker=(broker.host, broker.port),
                    speedup=20.0,
                    ready=started.set,
                    stop=stop,
                )
            )
            await started.wait()
            began, count = loop.time(), 0
            async for _ in subscriber.messages:
                count += 1
                if count == 30:
                    break
            # 30 truths are 15 simulated seconds: 0.75 s, and on a loaded machine more; without
            # the speed-up the test would time out.
            assert loop.time() - began > 0.7
        stop.set()
        await simulator


async def test_a_dead_broker_is_one_clear_sentence() -> None:
    port = free_port()
    with pytest.raises(
        SimulationError, match=rf"no MQTT broker at 127\.0\.0\.1:{port} .*start one"
    ):
        await serve(
            simulation(),
            controllers=[("127.0.0.1", 14550)],
            broker=("127.0.0.1", port),
            stop=asyncio.Event(),
        )


async def test_a_broker_that_goes_away_is_one_clear_sentence() -> None:
    ready = asyncio.Event()
    async with asyncio.timeout(10.0):
        async with embedded_broker(port=0) as broker:
            simulator = asyncio.create_task(
                serve(
                    simulation(),
                    controllers=[("127.0.0.1", free_port(socket.SOCK_DGRAM))],
                    broker=(broker.host, broker.port),
                    speedup=20.0,
                    ready=ready.set,
                    stop=asyncio.Event(),
                )
            )
            await ready.wait()
        with pytest.raises(SimulationError, match="no MQTT broker at"):
            await simulator


async def test_an_unreachable_controller_is_one_clear_sentence() -> None:
    with pytest.raises(
        SimulationError, match=r"UAV 1 cannot send to the controller at nowhere\.invalid"
    ):
        await serve(
            simulation(),
            controllers=[("nowhere.invalid", 14550)],
            broker=("127.0.0.1", 1),
            stop=asyncio.Event(),
        )


def test_a_machine_too_slow_slows_the_simulation_down() -> None:
    # A million times real time: uncapped, a turn would not come back.
    shell = Shell(simulation(vehicle(faults=Faults(silent=True))), speedup=1e6)
    shell.start()
    for _ in range(5):
        truths = shell.turn()
        assert len(truths) <= 2.0 * LONGEST_TURN_S
