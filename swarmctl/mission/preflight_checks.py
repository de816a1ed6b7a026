"""The checks that a vehicle, and the fleet as a whole, must pass before anything is armed.

Each check comes with the sentence that names what is missing.
"""

from __future__ import annotations

import math

from swarmctl.formation.separation import least_distances
from swarmctl.mission.filter_settings import expected_enu
from swarmctl.mission.fleet import Fleet, VehicleState
from swarmctl.mission.mission_file import Mission

LEAST_POSITION_HZ = 2.0
"""With fewer the positions between two reports are too uncertain, and a loss is seen too late."""
CLOCK_SPAN_S = 3.0
"""SYSTEM_TIME is watched for this long before the clocks' rates are compared."""
CLOCK_TOLERANCE = 0.2
"""Greatest relative difference between a vehicle's clock rate and the controller's."""


def clock_rate(vehicle: VehicleState, span_s: float = CLOCK_SPAN_S) -> float | None:
    """Seconds of vehicle time in one second of the controller's.

    A vehicle has two times, UTC and time since boot; the one that is further off counts. The
    first dates its positions, the second is the time that it flies in.

    Args:
        vehicle: The vehicle.
        span_s: How long it must have been watched, by either clock, s; before that None.
    """
    first, last = vehicle.clock_first, vehicle.clock_last
    if first is None or last is None:
        return None
    own = last.received_s - first.received_s
    theirs = (last.utc_s - first.utc_s, last.boot_s - first.boot_s)
    if max(own, *theirs) < span_s or own <= 0.0:
        return None
    return max((span / own for span in theirs), key=lambda rate: abs(rate - 1.0))


def clock_fault(vehicle: VehicleState, hiccup_s: float) -> str | None:
    """A sentence if the vehicle's clock runs at another speed than the controller's.

    Args:
        vehicle: The vehicle.
        hiccup_s: Delay that this computer may be to blame for, s; the clock is watched for so
            long that it is within the tolerance.
    """
    rate = clock_rate(vehicle, CLOCK_SPAN_S + hiccup_s / CLOCK_TOLERANCE)
    if rate is None or abs(rate - 1.0) <= CLOCK_TOLERANCE:
        return None
    return (
        f"the clock of vehicle {vehicle.sysid} (SYSTEM_TIME) runs {rate:.2g} times as fast as this"
        " controller's: start `swarmctl run` with the same --speedup as the simulator, and"
        " without one for real vehicles; a simulator that cannot keep up needs a lower one"
    )


def _is_in_step(vehicle: VehicleState) -> bool:
    rate = clock_rate(vehicle)
    return rate is not None and abs(rate - 1.0) <= CLOCK_TOLERANCE


def unmet_checks(vehicle: VehicleState, mission: Mission, *, may_fly: bool = False) -> list[str]:
    """What still keeps one vehicle on the ground, as sentences' middles; empty when ready.

    Args:
        vehicle: The vehicle.
        mission: The mission.
        may_fly: Whether others may have armed it already.
    """
    unmet = []
    beat, status = vehicle.heartbeat, vehicle.status
    if beat is not None:
        wanted = mission.swarm.autopilot
        if beat.autopilot == "other":
            unmet.append("its autopilot is neither ArduPilot nor PX4")
        elif wanted not in {"auto", beat.autopilot}:
            unmet.append(f"its autopilot is {beat.autopilot}, not {wanted} (swarm.autopilot)")
        if not beat.is_multirotor:
            unmet.append("it is not a multirotor")
        if beat.armed and not may_fly:
            unmet.append("it is armed already; land and disarm it first")
    if vehicle.version is None:
        unmet.append("it has not told its hardware id (AUTOPILOT_VERSION)")
    if vehicle.fix is None or vehicle.fix.fix_type < 3:
        unmet.append("it has no 3-D GPS fix")
    if vehicle.position_enu is None or vehicle.position is None:
        unmet.append("it does not report its position (GLOBAL_POSITION_INT)")
    elif vehicle.position.epoch_utc_s is None or not _is_in_step(vehicle):
        unmet.append("its clock is not known yet (SYSTEM_TIME)")
    elif vehicle.position_hz is None or vehicle.position_hz < LEAST_POSITION_HZ:
        told = vehicle.position_hz
        rate = "not yet often enough to tell" if told is None else f"{told:.1f} times a second"
        unmet.append(
            f"it reports its position {rate}; {LEAST_POSITION_HZ:g} times a second are needed"
            " (GLOBAL_POSITION_INT)"
        )
    if vehicle.launch_enu is None:
        unmet.append("it has no home position (HOME_POSITION)")
    else:
        unmet += _place_checks(vehicle, mission)
    if status is None or not status.prearm_ok:
        unmet.append("its own pre-arm checks do not pass (SYS_STATUS)")
    elif status.battery_fraction is not None:
        reserve = mission.limits.battery_reserve
        if status.battery_fraction <= reserve:
            unmet.append(
                f"its battery is at {status.battery_fraction:.0%}, the reserve is {reserve:.0%}"
            )
    return unmet


def _place_checks(vehicle: VehicleState, mission: Mission) -> list[str]:
    if vehicle.launch_enu is None:
        return []
    unmet = []
    east, north, up = vehicle.launch_enu
    ground = mission.origin.alt_amsl_m + up
    if ground > vehicle.altitude_amsl_m - 5.0:
        unmet.append(
            f"it stands at {ground:.0f} m AMSL, not 5 m below its flight altitude of"
            f" {vehicle.altitude_amsl_m:g} m: correct altitude_amsl_m in the mission"
        )
    distance = math.hypot(east, north)
    if distance > mission.limits.geofence_radius_m:
        unmet.append(
            f"it stands {distance:.0f} m from the origin, outside the geofence of"
            f" {mission.limits.geofence_radius_m:g} m"
        )
    emitter = expected_enu(mission)
    away = math.hypot(east - emitter[0], north - emitter[1])
    if away < mission.limits.stand_off_m:
        unmet.append(
            f"it stands {away:.0f} m from the expected emitter, nearer than the stand-off of"
            f" {mission.limits.stand_off_m:g} m"
        )
    return unmet


def fleet_faults(fleet: Fleet, mission: Mission) -> list[str]:
    """What is wrong between vehicles: one hardware id twice, launch points too close.

    They climb and land straight above their launch points, so what counts is how far apart these
    are on the map, whatever the altitudes; plans of those that share a level begin and end there.
    """
    faults = []
    vehicles = list(fleet.vehicles.values())
    separation_m = mission.limits.min_separation_m
    margin_m = mission.formation.separation_margin_m
    planned = least_distances([v.altitude_amsl_m for v in vehicles], separation_m, margin_m)
    for i, a in enumerate(vehicles):
        for j, b in enumerate(vehicles[i + 1 :], i + 1):
            if a.version and b.version and a.version.uid == b.version.uid != 0:
                faults.append(
                    f"vehicles {a.sysid} and {b.sysid} have one hardware id: one of them answers"
                    " under two system ids"
                )
            if a.launch_enu and b.launch_enu:
                apart = math.dist(a.launch_enu[:2], b.launch_enu[:2])
                if apart < separation_m:
                    faults.append(
                        f"vehicles {a.sysid} and {b.sysid} stand {apart:.1f} m apart, less than"
                        f" limits.min_separation_m = {separation_m:g} m: move one of them"
                    )
                elif apart < planned[i, j]:
                    faults.append(
                        f"vehicles {a.sysid} and {b.sysid} stand {apart:.1f} m apart, less than"
                        f" the {planned[i, j]:.1f} m that formation.separation_margin_m ="
                        f" {margin_m:g} m keeps between them in flight: move one of them"
                    )
    return faults
