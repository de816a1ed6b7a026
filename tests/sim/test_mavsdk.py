"""An independent client flies a simulated vehicle: MAVSDK arms it, takes off and lands."""

from __future__ import annotations

import asyncio
import contextlib
import socket

import pytest

from sim.serve import serve
from swarmctl.feed.broker import embedded_broker
from tests.brokers import free_port
from tests.sim.flying import simulation, vehicle

try:
    from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
    from mavsdk.asyncio.plugins.action import ActionAsync, ActionError
    from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
except (ImportError, OSError) as error:
    pytest.skip(f"MAVSDK's native library cannot be loaded: {error}", allow_module_level=True)


async def test_mavsdk_arms_takes_off_and_lands() -> None:
    port = free_port(socket.SOCK_DGRAM)
    stop = asyncio.Event()
    async with asyncio.timeout(30.0), embedded_broker(port=0) as broker:
        simulator = asyncio.create_task(
            serve(
                simulation(vehicle(3)),
                controller=("127.0.0.1", port),
                broker=(broker.host, broker.port),
                speedup=20.0,
                stop=stop,
            )
        )
        settings = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        async with Mavsdk(settings) as client:
            await client.add_any_connection(f"udpin://127.0.0.1:{port}")
            system = await client.first_autopilot(timeout_s=10.0)
            action, telemetry = ActionAsync(system), TelemetryAsync(system)
            await telemetry.set_rate_position(20.0)
            for _ in range(100):  # it refuses for its first four simulated seconds
                with contextlib.suppress(ActionError):
                    await action.arm()
                    break
                await asyncio.sleep(0.02)
            await action.set_takeoff_altitude(6.0)
            await action.takeoff()
            async for position in telemetry.subscribe_position():
                if position.relative_altitude_m > 5.5:
                    break
            await action.land()
            async for armed in telemetry.subscribe_armed():
                if not armed:
                    break
        stop.set()
        await simulator
