"""What a console or a page shows: one frozen picture of the mission at an instant."""

from __future__ import annotations

import math
from dataclasses import dataclass

from swarmctl.mission.controller import Controller
from swarmctl.mission.estimate_projections import EstimateSnapshot, estimate_snapshot


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
    mission, tracking = controller.mission, controller.tracking
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
        estimate=estimate_snapshot(
            tracking.believed,
            tracking.last,
            controller.frame,
            age_s=now - tracking.last_used_s if tracking.last_used_s is not None else math.inf,
            verdict=tracking.verdict,
            limit=tracking.limit(),
        ),
        rd_rate_hz=tracking.rate_hz(),
        rd_used=tracking.counts.used,
        rd_aside=tracking.counts.aside,
        rd_dropped=tracking.counts.dropped,
    )
