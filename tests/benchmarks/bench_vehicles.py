"""How much of a core fifty simulated vehicles cost: ``python -m tests.benchmarks.bench_vehicles``.

Fifty vehicles of each personality fly circles; each is sent ten setpoints a second and sends ten
positions a second and whatever its personality sends unasked. One core simulates them in real
time if a second takes a second; the goal is half of that.
"""

from __future__ import annotations

import math
import time

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.config import NavigationConfig, WindConfig
from sim.dynamics import Command, State, step
from sim.world import World
from tests.sim.flying import POSITION_AND_VELOCITY, simulation, vehicle

VEHICLES = 50
FLIGHT_S = 20.0


def swarm(autopilot: str) -> World:
    """The world of fifty vehicles with every error switched on."""
    vehicles = [vehicle(i, 20.0 * i, autopilot=autopilot) for i in range(1, VEHICLES + 1)]
    navigation = NavigationConfig(white_sigma_m=0.5, correlated_sigma_m=1.0)
    wind = WindConfig((4.0, 2.0, 0.0), gust_sigma_mps=0.7)
    return World(simulation(*vehicles, navigation=navigation, wind=wind))


def setpoint(encoder: mavlink.MAVLink, sysid: int, time_s: float) -> bytes:
    """A point on a circle of 50 m at 5 m/s."""
    angle = 0.1 * time_s
    north, east = 50.0 * math.cos(angle), 50.0 * math.sin(angle)
    message = mavlink.MAVLink_set_position_target_local_ned_message(
        *(0, sysid, 1, mavlink.MAV_FRAME_LOCAL_NED, POSITION_AND_VELOCITY),
        *(north, east, -30.0, -0.1 * east, 0.1 * north, 0.0),
        *(0.0, 0.0, 0.0, 0.0, 0.0),
    )
    return bytes(message.pack(encoder))


def flight(autopilot: str) -> tuple[float, int]:
    """CPU seconds per simulated second, and datagrams sent per second."""
    world, encoder = swarm(autopilot), mavlink.MAVLink(None, srcSystem=77)
    sysids = range(1, VEHICLES + 1)

    def command(sysid: int, number: int, *params: float) -> None:
        values = [*params, *([0.0] * (7 - len(params)))]
        message = mavlink.MAVLink_command_long_message(sysid, 1, number, 0, *values)
        world.receive_datagram(sysid, message.pack(encoder))

    def stream_until(end_s: float) -> None:
        while world.time_s < end_s:
            for sysid in sysids:
                world.receive_datagram(sysid, setpoint(encoder, sysid, world.time_s))
            world.advance(world.time_s + 0.1)

    world.advance(5.0)
    position = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
    for sysid in sysids:
        if autopilot == "ardupilot":
            command(sysid, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, position, 1e5)
        command(sysid, mavlink.MAV_CMD_DO_SET_MODE, 1, 4, 3)  # GUIDED, or AUTO_LOITER
        command(sysid, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        height = 30.0 if autopilot == "ardupilot" else 430.0
        command(sysid, mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height)
    world.advance(35.0)
    stream_until(36.0)
    if autopilot == "px4":
        for sysid in sysids:
            command(sysid, mavlink.MAV_CMD_DO_SET_MODE, 1, 6)
    stream_until(40.0)
    world.datagrams()
    began = time.process_time()
    stream_until(40.0 + FLIGHT_S)
    cpu_s = time.process_time() - began
    moving = sum(math.hypot(*world.vehicle_state(i).velocity_enu) > 2.0 for i in sysids)
    if moving != VEHICLES:
        raise RuntimeError(f"only {moving} of {VEHICLES} vehicles fly their circle")
    return cpu_s / FLIGHT_S, round(len(world.datagrams()) / FLIGHT_S)


def dynamics_us() -> float:
    """CPU time of one step of the airframe, µs."""
    config = vehicle()
    state = State((0.0, 0.0, 30.0), (1.0, 0.0, 0.0), on_ground=False)
    command, steps = Command((40.0, 3.0, 1.0), (1.0, 0.0, 0.0), 1.0), 50_000
    began = time.process_time()
    for _ in range(steps):
        state = step(state, command, (3.0, 1.0, 0.0), config.limits, 0.0, 0.02)
    return (time.process_time() - began) / steps * 1e6


def main() -> None:
    """Print the figures."""
    print(f"one step of the airframe: {dynamics_us():.1f} µs")
    for autopilot in ("ardupilot", "px4"):
        share, datagrams = flight(autopilot)
        print(
            f"{VEHICLES} vehicles, {autopilot}: {100.0 * share:.0f} % of a core"
            f" in real time, {datagrams} datagrams/s"
        )


if __name__ == "__main__":
    main()
