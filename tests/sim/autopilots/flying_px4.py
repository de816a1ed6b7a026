"""A simulated PX4 in the air, for tests."""

from __future__ import annotations

from sim.config import VehicleConfig
from tests.sim.flying import ACCEPTED, ALT, Station, simulation, vehicle

POSCTL, OFFBOARD = 3 << 16, 6 << 16
HOLD, RTL, LAND = (4 << 16 | sub << 24 for sub in (3, 5, 6))


def px4(**parameters: float) -> VehicleConfig:
    """A PX4 whose owner has set some parameters."""
    return vehicle(autopilot="px4", parameters=tuple(parameters.items()))


def up(config: VehicleConfig, height_m: float = 20.0) -> Station:
    """A vehicle that holds at a height."""
    station = Station(simulation(config))
    station.advance(5.0)
    assert station.arm() == ACCEPTED
    assert station.take_off(ALT + height_m) == ACCEPTED
    station.advance(5.0 + height_m)
    assert mode(station) == HOLD
    return station


def mode(station: Station) -> int:
    """The custom mode that HEARTBEAT shows."""
    return int(station.heartbeat().custom_mode)


def stream(station: Station, duration_s: float, north_m: float = 0.0) -> None:
    """Send setpoints 20 m above home at 10 Hz for a duration (s)."""
    for _ in range(round(duration_s * 10)):
        station.setpoint((0.0, north_m, 20.0))
        station.advance(0.1)
