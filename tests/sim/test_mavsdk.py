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
from tests.sim.flying import ALT, LAT, LON, simulation, vehicle

pytestmark = pytest.mark.live

try:
    from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
    from mavsdk.asyncio.plugins.action import ActionAsync, ActionError
    from mavsdk.asyncio.plugins.info import InfoAsync
    from mavsdk.asyncio.plugins.mission import MissionAsync
    from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
    from mavsdk.asyncio.plugins.offboard import OffboardAsync
    from mavsdk.asyncio.plugins.param import ParamAsync
    from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
    from mavsdk.plugins.mission import MissionItem, MissionPlan
    from mavsdk.plugins.mission_raw import MissionItem as RawItem
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


@pytest.mark.slow
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


NORTH_DEG = 30.0 / 111_320.0


def planned() -> MissionPlan:
    """Up, 30 m north, 30 m east."""
    lat, lon = math.degrees(LAT), math.degrees(LON)
    take_off = MissionItem.VehicleAction.TAKEOFF
    places = ((lat, lon), (lat + NORTH_DEG, lon), (lat + NORTH_DEG, lon + 30.0 / 75_900.0))
    return MissionPlan(
        [
            MissionItem(
                latitude_deg=place[0],
                longitude_deg=place[1],
                relative_altitude_m=8.0,
                is_fly_through=True,
                vehicle_action=take_off if n == 0 else None,
            )
            for n, place in enumerate(places)
        ]
    )


async def fly_mission(system: Any, mission: Any) -> None:  # noqa: ANN401 - MAVSDK is untyped
    """Arm, fly the whole mission and land at home."""
    action, telemetry = ActionAsync(system), TelemetryAsync(system)
    await telemetry.set_rate_position(20.0)
    await telemetry.set_rate_health(10.0)
    await until(telemetry.subscribe_health(), lambda h: h.is_armable and h.is_home_position_ok)
    await action.arm()
    await mission.start_mission()
    await until(
        telemetry.subscribe_position(),
        lambda p: abs(p.latitude_deg - math.degrees(LAT) - NORTH_DEG) < 0.1 * NORTH_DEG,
    )
    await until(telemetry.subscribe_armed(), lambda armed: not armed)
    landed = await until(telemetry.subscribe_position(), bool)
    assert landed.latitude_deg == pytest.approx(math.degrees(LAT), abs=0.1 * NORTH_DEG)


@pytest.mark.slow
async def test_mavsdk_flies_a_mission_with_px4() -> None:
    async with connected("px4") as system:
        mission = MissionAsync(system)
        await mission.set_return_to_launch_after_mission(True)
        await mission.upload_mission(planned())
        assert len((await mission.download_mission()).mission_items) == 3
        flying = asyncio.create_task(fly_mission(system, mission))
        await until(mission.subscribe_mission_progress(), lambda p: p.current == p.total == 3)
        await flying
        assert await mission.is_mission_finished()


@pytest.mark.slow
async def test_mavsdk_flies_a_raw_mission_with_ardupilot() -> None:
    """Its other plugin does not know that ArduPilot's item 0 is home."""
    async with connected("ardupilot") as system:
        mission = MissionRawAsync(system)
        home = (round(math.degrees(LAT) * 1e7), round(math.degrees(LON) * 1e7))
        north = (home[0] + round(NORTH_DEG * 1e7), home[1])
        waypoint, return_, take_off = 16, 20, 22
        flown = ((waypoint, home), (take_off, home), (waypoint, north), (return_, (0, 0)))
        items = [
            RawItem(
                seq=seq,
                frame=3 if seq else 0,
                command=command,
                current=int(seq == 0),
                autocontinue=1,
                param1=0.0,
                param2=0.0,
                param3=0.0,
                param4=0.0,
                x=x,
                y=y,
                z=8.0,
                mission_type=0,
            )
            for seq, (command, (x, y)) in enumerate(flown)
        ]
        await mission.upload_mission(items)
        back = await mission.download_mission()
        assert [(item.command, item.x, item.y) for item in back[1:]] == [
            (item.command, item.x, item.y) for item in items[1:]
        ]
        await fly_mission(system, mission)


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
