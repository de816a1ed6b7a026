"""A made-up flight: four UAVs fly out in formation and orbit a drifting emitter.

No simulator and no filter: positions lie on given curves and the estimate converges on the
truth as it is told to. It has the rates of a real flight, for the plots and the timings.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator

import numpy as np

from swarmctl import commands, decisions, events
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.events import Record
from swarmctl.frames import LocalFrame
from swarmctl.recorder.debrief import DebriefSettings
from swarmctl.results import MissionResult
from swarmctl.units import Vector

FRAME = LocalFrame(math.radians(47.42), math.radians(9.38), 40.0)
UTC_S = 1_790_000_000.0
REFERENCE = 1
FOLLOWERS = (2, 3, 4)
OBSERVING = frozenset({"approaching", "orbiting"})
STAND_OFF_M = 300.0
D_MAX_M = 250.0

SETTINGS = DebriefSettings(
    frame=FRAME,
    reference=REFERENCE,
    observing_phases=OBSERVING,
    prior_mean=(1060.0, 1330.0, 12.0),
    prior_covariance=np.diag([300.0, 300.0, 3.0, 1.0, 1.0, 0.01]) ** 2,
    process_noise=(4e-4, 4e-4, 0.0),
    sigma_p_m=0.5,
    errors=ReceiverErrors(),
    d_max_m=D_MAX_M,
    stand_off_m=STAND_OFF_M,
)

PHASES = (
    (0.0, "waiting"),
    (2.0, "checking"),
    (5.0, "launching"),
    (30.0, "forming"),
    (60.0, "approaching"),
    (190.0, "orbiting"),
    (270.0, "returning"),
    (400.0, "landing"),
)
END_S = 420.0


def geodetic(position: Vector) -> tuple[float, float, float]:
    return FRAME.to_geodetic(*position)


def emitter(t: float) -> Vector:
    return 950.0 - 0.8 * t, 1480.0 + 0.3 * t, 12.0


def reference(t: float) -> Vector:
    """Up, out along a line to 340 m from the emitter, round it, and home."""
    height = 12.0 * min(max((t - 8.0) / 18.0, 0.0), 1.0) * 6.0
    if t > 400.0:
        height *= max(0.0, (END_S - 2.0 - t) / 18.0)
    far = emitter(min(max(t, 190.0), 270.0))
    inward = math.atan2(far[1], far[0]) + math.pi
    angle = inward + 0.022 * (min(max(t, 190.0), 270.0) - 190.0)
    ring = far[0] + 340.0 * math.cos(angle), far[1] + 340.0 * math.sin(angle)
    out = min(max((t - 60.0) / 130.0, 0.0), 1.0)
    back = min(max((t - 270.0) / 125.0, 0.0), 1.0)
    share = out * (1.0 - back)
    return ring[0] * share, ring[1] * share, height


def vehicle(sysid: int, t: float) -> Vector:
    east, north, up = reference(t)
    k = sysid - REFERENCE
    if k == 0:
        return east, north, up
    e = emitter(t)
    los = math.atan2(e[1] - north, e[0] - east)
    theta = los + (0.0, math.pi / 2, -math.pi / 2, math.pi)[k]
    spread = min(max((t - 32.0) / 26.0, 0.0), 1.0) * min(max((395.0 - t) / 100.0, 0.0), 1.0)
    wobble = 2.5 * math.sin(0.3 * t + k)
    radius = 20.0 * k * (1.0 - spread) + (235.0 + wobble) * spread
    return (
        east + radius * math.cos(theta),
        north + radius * math.sin(theta),
        up + 12.0 * k * (up > 0),
    )


def velocity(sysid: int, t: float) -> Vector:
    a, b = vehicle(sysid, t - 0.01), vehicle(sysid, t + 0.01)
    return (b[0] - a[0]) / 0.02, (b[1] - a[1]) / 0.02, (b[2] - a[2]) / 0.02


def position_record(sysid: int, t: float, delay_s: float = 0.05) -> events.VehiclePosition:
    lat, lon, alt = geodetic(vehicle(sysid, t))
    return events.VehiclePosition(
        received_s=t + delay_s, sysid=sysid, boot_s=t + 40.0, epoch_utc_s=UTC_S + t,
        lat_rad=lat, lon_rad=lon, alt_amsl_m=alt, velocity_enu=velocity(sysid, t),
    )  # fmt: skip


def truth_record(t: float) -> events.EmitterTruth:
    lat, lon, alt = geodetic(emitter(t))
    return events.EmitterTruth(
        received_s=t + 0.02, epoch_utc_s=UTC_S + t, lat_rad=lat, lon_rad=lon, alt_amsl_m=alt,
        velocity_enu=(-0.8, 0.3, 0.0),
    )  # fmt: skip


def range_differences(t: float) -> events.RangeDifferences:
    e = emitter(t)
    near = math.dist(e, vehicle(REFERENCE, t))
    return events.RangeDifferences(
        received_s=t + 0.05,
        epoch_utc_s=UTC_S + t,
        reference=REFERENCE,
        items=tuple(
            events.RangeDifference(i, math.dist(e, vehicle(i, t)) - near, 3.0) for i in FOLLOWERS
        ),
        rho=0.5,
        clock_sigma_s=1e-9,
        seq=round(10.0 * t),
    )


def estimate_record(t: float, random: np.random.Generator) -> decisions.EstimateMade:
    """Truth plus an error drawn from a covariance that shrinks, long across nothing."""
    e = emitter(t)
    major = 2.2 + 290.0 * math.exp(-(t - 32.0) / 28.0)
    minor = 0.25 * major + 0.4
    r = vehicle(REFERENCE, t)
    los = math.atan2(e[1] - r[1], e[0] - r[0])
    axes = np.array([[math.cos(los), -math.sin(los)], [math.sin(los), math.cos(los)]])
    P = np.diag([1.0, 1.0, 4.0, 0.02, 0.02, 1e-4])
    P[:2, :2] = axes @ np.diag([major**2, minor**2]) @ axes.T
    # One slow draw for the whole flight: a filter's errors are correlated.
    wave = np.array([math.sin(0.05 * t + 1.0), math.cos(0.031 * t)]) + 0.15 * random.normal(size=2)
    dx, dy = axes @ (np.array([major, minor]) * wave)
    return decisions.EstimateMade(
        at_s=t + 0.2,
        epoch_utc_s=UTC_S + t,
        position_enu=(e[0] + float(dx), e[1] + float(dy), e[2] + 1.0),
        velocity_enu=(-0.8, 0.3, 0.0),
        covariance=tuple(P.ravel().tolist()),
        nis=3.0,
        rd_count=3,
        measured_utc_s=UTC_S + t,
        reference=REFERENCE,
        receivers=tuple(FOLLOWERS),
        sigma_m=(3.0,) * len(FOLLOWERS),
        rho=(0.5,) * len(FOLLOWERS),
    )


def plan_record(t: float) -> decisions.Plan:
    slots = []
    r = vehicle(REFERENCE, t)
    for sysid in (REFERENCE, *FOLLOWERS):
        p = vehicle(sysid, t)
        gap = 90.0 * math.exp(-(t - 30.0) / 6.0) + 1.2 + abs(math.sin(0.3 * t + sysid))
        follower = sysid != REFERENCE
        slots.append(
            decisions.Slot(
                sysid=sysid, position_enu=p, velocity_enu=velocity(sysid, t),
                error_m=gap if follower else 0.5,
                range_to_reference_m=math.dist(p, r) if follower else None,
                joined=True,
            )
        )  # fmt: skip
    return decisions.Plan(
        at_s=t + 0.1, reference=REFERENCE, los_rad=0.9, formed=t >= 58.0, slots=tuple(slots)
    )


@functools.cache
def records() -> tuple[Record, ...]:
    """The flight, in the order in which a core would see it."""
    return tuple(_records())


def _records() -> Iterator[Record]:
    random = np.random.default_rng(5)
    phases = list(PHASES)
    for tick in range(round(10.0 * END_S)):
        t = 0.1 * tick
        while phases and phases[0][0] <= t:
            yield decisions.PhaseChanged(at_s=t, phase=phases.pop(0)[1], trigger="-", reason="-")
        for sysid in (REFERENCE, *FOLLOWERS):
            yield position_record(sysid, t)
        if tick % 5 == 0:
            yield truth_record(t)
        if 30.0 <= t < 390.0:
            yield range_differences(t)
            yield plan_record(t)
            for sysid in (REFERENCE, *FOLLOWERS):
                lat, lon, alt = geodetic(vehicle(sysid, t))
                yield commands.GoTo(
                    sysid=sysid, lat_rad=lat, lon_rad=lon, alt_amsl_m=alt,
                    velocity_enu=velocity(sysid, t),
                )  # fmt: skip
            if t >= 30.3:
                yield estimate_record(round(10.0 * (t - 0.2)) / 10.0, random)
    yield decisions.MissionEnded(
        at_s=END_S, result=MissionResult.LOCATED, detail="Located within 3 m."
    )
