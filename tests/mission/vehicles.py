"""Vehicles as the controller knows them, each with its heartbeat and its position."""

from __future__ import annotations

from swarmctl.events import Heartbeat, Mode, VehiclePosition
from swarmctl.mission.fleet import Fleet, VehicleState
from swarmctl.mission.mission_file import Mission
from swarmctl.units import Vector


def beat(vehicle: VehicleState, now: float, mode: Mode = Mode.GUIDED) -> None:
    """Let an armed vehicle's heartbeat be heard at ``now``, s."""
    vehicle.heartbeat = Heartbeat(
        received_s=now,
        sysid=vehicle.sysid,
        autopilot="ardupilot",
        is_multirotor=True,
        mode=mode,
        mode_name=mode.upper(),
        armed=True,
    )


def report(
    fleet: Fleet,
    sysid: int,
    place: Vector,
    now: float,
    *,
    utc_s: float | None = None,
    velocity: Vector = (0.0, 0.0, 0.0),
) -> None:
    """Let a vehicle's position (ENU, m) and velocity (m/s) be heard at ``now``, s."""
    lat, lon, alt = fleet.frame.to_geodetic(*place)
    fleet.observe(
        VehiclePosition(
            received_s=now,
            sysid=sysid,
            boot_s=now,
            epoch_utc_s=utc_s,
            lat_rad=lat,
            lon_rad=lon,
            alt_amsl_m=alt,
            velocity_enu=velocity,
        )
    )


def fleet_of(mission: Mission) -> Fleet:
    """A mission's vehicles, of which nothing has been heard."""
    states = {v.sysid: VehicleState(v.sysid, v.altitude_amsl_m) for v in mission.swarm.vehicles}
    return Fleet(mission.frame, states)
