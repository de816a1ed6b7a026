"""What a console or a page shows: one frozen picture of the mission at an instant."""

from __future__ import annotations

import math
from dataclasses import dataclass

from swarmctl.estimation.bounds.consistency import ellipse
from swarmctl.estimation.integrity.health import Status, sentence
from swarmctl.mission.controller import Controller
from swarmctl.units import Vector


@dataclass(frozen=True)
class VehicleSnapshot:
    """One vehicle.

    Attributes:
        sysid: MAVLink system id.
        is_reference: Whether it is the reference UAV.
        mode: The autopilot's name of its mode; empty before the first heartbeat.
        armed: Whether it is armed.
        alt_amsl_m: Altitude, m; None before the first position.
        slot_error_m: Distance from where it should be, m.
        range_to_reference_m: 3-D distance from the reference UAV, m.
        battery_fraction: Charge left; None where unknown.
        silence_s: Time since it was last heard, s; infinite before the first time.
        loss: Fraction of its messages lost on the way, 0..1.
        rate_hz: Messages a second.
        rtt_s: Latest round trip to it and back, s; None where none was measured.
    """

    sysid: int
    is_reference: bool
    mode: str
    armed: bool
    alt_amsl_m: float | None
    slot_error_m: float | None
    range_to_reference_m: float | None
    battery_fraction: float | None
    silence_s: float
    loss: float
    rate_hz: float
    rtt_s: float | None = None


@dataclass(frozen=True)
class EstimateSnapshot:
    """The estimate, predicted to the instant of the snapshot.

    Attributes:
        position_enu: Position, m.
        lat_rad: Latitude, rad.
        lon_rad: Longitude, rad.
        velocity_enu: Velocity, m/s.
        sigma_major_m: Larger axis of the horizontal 1-sigma ellipse, m.
        sigma_minor_m: Smaller axis, m.
        sigma_angle_rad: Direction of the larger axis, rad from East.
        nis: Normalised innovation squared of the last update; its mean is ``rd_count``.
        rd_count: Range differences in the last update; 0 before the first.
        age_s: Age of the last measurement used, s; infinite before the first.
        health: What the track is worth.
        why: A sentence on what is wrong with it, or that nothing is.
        limit: What limits the accuracy.
    """

    position_enu: Vector
    lat_rad: float
    lon_rad: float
    velocity_enu: Vector
    sigma_major_m: float
    sigma_minor_m: float
    sigma_angle_rad: float
    nis: float
    rd_count: int
    age_s: float
    health: Status = "initialising"
    why: str = ""
    limit: str = ""


@dataclass(frozen=True)
class Snapshot:
    """The mission at an instant.

    Attributes:
        mission: Name of the mission.
        phase: Name of the phase.
        progress: How far the phase is, in words.
        elapsed_s: Mission time, s.
        d_max_m: Communication range, m.
        vehicles: All vehicles.
        estimate: The emitter's estimate; the prior before any measurement.
        rd_rate_hz: Range differences used per second, over the last seconds.
        rd_used: Range differences used.
        rd_aside: Range differences set aside as echoes.
        rd_dropped: Range differences and arrival times that could not be used.
    """

    mission: str
    phase: str
    progress: str
    elapsed_s: float
    d_max_m: float
    vehicles: tuple[VehicleSnapshot, ...]
    estimate: EstimateSnapshot
    rd_rate_hz: float
    rd_used: int
    rd_aside: int
    rd_dropped: int


def take_snapshot(controller: Controller, now: float) -> Snapshot:
    """Picture of a mission at the controller's time ``now``, s."""
    mission, observer = controller.mission, controller.observer
    plan = controller.plan
    slots = {slot.sysid: slot for slot in plan.slots} if plan is not None else {}
    reference = plan.reference if plan is not None else mission.swarm.reference
    vehicles = []
    for vehicle in controller.fleet.vehicles.values():
        slot, beat, quality = slots.get(vehicle.sysid), vehicle.heartbeat, vehicle.quality
        heard = quality.messages_in + quality.lost if quality is not None else 0
        vehicles.append(
            VehicleSnapshot(
                sysid=vehicle.sysid,
                is_reference=vehicle.sysid == reference,
                mode=beat.mode_name if beat is not None else "",
                armed=vehicle.is_armed,
                alt_amsl_m=vehicle.position.alt_amsl_m if vehicle.position is not None else None,
                slot_error_m=slot.error_m if slot is not None else None,
                range_to_reference_m=slot.range_to_reference_m if slot is not None else None,
                battery_fraction=vehicle.status.battery_fraction if vehicle.status else None,
                silence_s=vehicle.silence_s(now),
                loss=quality.lost / heard if quality is not None and heard else 0.0,
                rate_hz=quality.rate_hz if quality is not None else 0.0,
                rtt_s=quality.rtt_s if quality is not None else None,
            )
        )
    return Snapshot(
        mission=mission.name,
        phase=str(controller.phase),
        progress=controller.progress(now),
        elapsed_s=now - controller.started_s,
        d_max_m=mission.limits.d_max_m,
        vehicles=tuple(vehicles),
        estimate=_estimate(controller, now),
        rd_rate_hz=observer.rate_hz(),
        rd_used=observer.counts.used,
        rd_aside=observer.counts.aside,
        rd_dropped=observer.counts.dropped,
    )


def _estimate(controller: Controller, now: float) -> EstimateSnapshot:
    observer = controller.observer
    target, last = observer.target, observer.last
    major, minor, angle = ellipse(observer.covariance)
    lat, lon, _ = controller.frame.to_geodetic(*target.position_enu)
    return EstimateSnapshot(
        position_enu=target.position_enu,
        lat_rad=lat,
        lon_rad=lon,
        velocity_enu=target.velocity_enu,
        sigma_major_m=float(major),
        sigma_minor_m=float(minor),
        sigma_angle_rad=float(angle),
        nis=last.nis if last is not None else 0.0,
        rd_count=last.rd_count if last is not None else 0,
        age_s=now - observer.last_used_s if observer.last_used_s is not None else math.inf,
        health=observer.verdict.status,
        why=sentence(observer.verdict),
        limit=observer.limit(),
    )
