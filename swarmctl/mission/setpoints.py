"""From a plan to setpoints, and from measured positions to slot errors."""

from __future__ import annotations

import math
from collections.abc import Sequence

from swarmctl.commands import GoTo
from swarmctl.decisions import Slot
from swarmctl.mission.fleet import Fleet
from swarmctl.mission.planner import PlannedMotion, Planner
from swarmctl.units import Vector


def setpoint_commands(planned: PlannedMotion, fleet: Fleet, ours: Sequence[bool]) -> list[GoTo]:
    """The setpoints of a plan, for the vehicles that are ours.

    Args:
        planned: Rows as the fleet's vehicles.
        fleet: The vehicles; each keeps its own altitude above the sea.
        ours: Whether each vehicle is ours to command, (n,).
    """
    found = []
    rows = zip(
        fleet.vehicles.values(),
        ours,
        planned.positions.tolist(),
        planned.velocities.tolist(),
        strict=True,
    )
    for vehicle, is_ours, position, velocity in rows:
        if is_ours:
            lat, lon, _ = fleet.frame.to_geodetic(*position)
            found.append(
                GoTo(
                    sysid=vehicle.sysid,
                    lat_rad=lat,
                    lon_rad=lon,
                    alt_amsl_m=vehicle.altitude_amsl_m,
                    velocity_enu=tuple(velocity),
                )
            )
    return found


def measured_slots(
    planned: PlannedMotion, fleet: Fleet, planner: Planner, utc_s: float | None
) -> list[Slot]:
    """Where the vehicles should be, and how far from it they are.

    Args:
        planned: Rows as the fleet's vehicles.
        fleet: The vehicles.
        planner: The planner, which knows who flies in the formation.
        utc_s: UTC of the comparison, s; None while it is unknown.
    """
    vehicles = list(fleet.vehicles.values())
    here = [v.position_at(utc_s) if utc_s is not None else None for v in vehicles]
    reference = here[planner.reference]
    found = []
    for row, (vehicle, position, slot, velocity) in enumerate(
        zip(vehicles, here, planned.slots.tolist(), planned.velocities.tolist(), strict=True)
    ):
        leads = row == planner.reference
        joined = leads or (row in planner.companions and row not in planner.returning)
        reach = None if leads else _distance(position, reference)
        error = _distance(position, slot)
        found.append(Slot(vehicle.sysid, tuple(slot), tuple(velocity), error, reach, joined))
    return found


def _distance(a: Vector | None, b: Vector | None) -> float | None:
    return None if a is None or b is None else math.dist(a, b)
