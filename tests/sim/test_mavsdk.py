"""An independent client flies the simulated vehicles of each personality: MAVSDK 4."""

from __future__ import annotations

import asyncio
import contextlib
import math
import socket
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from typing import Any

import pytest

from sim.serve import serve
from swarmctl.feed.broker import embedded_broker
from tests.brokers import free_port
from tests.sim.flying import ALT, LAT, simulation, vehicle

try:
    from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
    from mavsdk.asyncio.plugins.action import ActionAsync, ActionError
    from mavsdk.asyncio.plugins.info import InfoAsync
    from mavsdk.asyncio.plugins.offboard import OffboardAsync
    from mavsdk.asyncio.plugins.param import ParamAsync
    from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
    from mavsdk.plugins.offboard import PositionNedYaw, VelocityNedYaw
except (ImportError, OSError) as error:
    pytest.skip(f"MAVSDK's native library cannot be loaded: {error}", allow_module_level=True)

SPEEDUP = 6.0
"""MAVSDK streams 20 setpoints a second of real time; PX4 wants two a second of its own."""


@contextlib.asynccontextmanager
async def connected(autopilot: str) -> AsyncIterator[Any]:
    """MAVSDK's system of a simulated vehicle."""
    port = free_port(socket.SOCK_DGRAM)
    stop = asyncio.Event()
    async with asyncio.timeout(60.0), embedded_broker(port=0) as broker:
        simulator = asyncio.create_task(
            serve(
                simulation(vehicle(3, autopilot=autopilot)),
                controllers=[("127.0.0.1", port)],
                broker=(broker.host, broker.port),
                speedup=SPEEDUP,
                stop=stop,
            )
        )
        settings = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        async with Mavsdk(settings) as client:
            await client.add_any_connection(f"udpin://127.0.0.1:{port}")
            yield await client.first_autopilot(timeout_s=10.0)
        stop.set()
        await simulator


async def until(stream: AsyncGenerator[Any, None], holds: Callable[[Any], bool]) -> Any:  # noqa: ANN401 - whatever MAVSDK hands out
    """The first value of a subscription for which something holds."""
    async with contextlib.aclosing(stream) as values:
        async for value in values:
            if holds(value):
                return value
    raise AssertionError("the subscription ended")


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
async def test_mavsdk_connects_arms_takes_off_flies_setpoints_and_lands(autopilot: str) -> None:
    async with connected(autopilot) as system:
        action, telemetry = ActionAsync(system), TelemetryAsync(system)
        offboard = OffboardAsync(system)
        version = await InfoAsync(system).get_version()
        assert version.flight_sw_major == (4 if autopilot == "ardupilot" else 1)

        await telemetry.set_rate_position(20.0)
        await telemetry.set_rate_position_velocity_ned(20.0)
        await telemetry.set_rate_home(5.0)
        await telemetry.set_rate_in_air(20.0)
        await telemetry.set_rate_health(10.0)  # of SYS_STATUS, which ArduCopter keeps to itself
        health = await until(
            telemetry.subscribe_health(), lambda h: h.is_armable and h.is_global_position_ok
        )
        assert health.is_home_position_ok
        home = await until(telemetry.subscribe_home(), lambda h: h.latitude_deg != 0.0)
        assert home.latitude_deg == pytest.approx(math.degrees(LAT), abs=1e-5)
        assert home.absolute_altitude_m == pytest.approx(ALT, abs=0.1)

        await action.set_takeoff_altitude(5.0)
        await action.arm()
        assert await until(telemetry.subscribe_armed(), bool)
        await action.takeoff()
        await until(telemetry.subscribe_position(), lambda p: p.relative_altitude_m > 4.6)

        await offboard.set_position_velocity_ned(
            PositionNedYaw(6.0, 4.0, -5.0, 0.0), VelocityNedYaw(0.0, 0.0, 0.0, 0.0)
        )
        await offboard.start()
        reached = await until(
            telemetry.subscribe_position_velocity_ned(),
            lambda o: math.hypot(o.position.north_m - 6.0, o.position.east_m - 4.0) < 0.5,
        )
        assert reached.position.down_m == pytest.approx(-5.0, abs=0.6)
        assert await offboard.is_active()

        await action.land()
        await until(telemetry.subscribe_armed(), lambda armed: not armed)


async def test_mavsdk_is_refused_arming_until_it_sees_that_px4_is_ready() -> None:
    async with connected("px4") as system:
        action = ActionAsync(system)
        with pytest.raises(ActionError):
            await action.arm()
        await until(TelemetryAsync(system).subscribe_health(), lambda h: h.is_armable)
        await action.arm()


@pytest.mark.parametrize(
    ("autopilot", "whole", "real"),
    [("ardupilot", "FS_GCS_ENABLE", "GUID_TIMEOUT"), ("px4", "NAV_DLL_ACT", "COM_OF_LOSS_T")],
)
async def test_mavsdk_reads_and_sets_parameters(autopilot: str, whole: str, real: str) -> None:
    async with connected(autopilot) as system:
        params = ParamAsync(system)
        assert await params.get_param_int(whole) == 0
        await params.set_param_int(whole, 1)
        assert await params.get_param_int(whole) == 1
        await params.set_param_float(real, 2.25)
        assert await params.get_param_float(real) == 2.25
        everything = await params.get_all_params()
        assert len(everything.int_params) + len(everything.float_params) > 200
