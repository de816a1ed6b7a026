"""What the recording, guidance, and the console and the page are given of an estimate.

Each is a projection of :class:`swarmctl.estimation.estimate.Estimate`. What is published over
MQTT is made in :mod:`swarmctl.ops.estimate_publication` from what is recorded: a mission does not
know the feed's messages.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swarmctl import decisions
from swarmctl.estimation.bounds.consistency import ellipse
from swarmctl.estimation.estimate import Estimate
from swarmctl.estimation.integrity.health import Status, Verdict, sentence
from swarmctl.frames import LocalFrame
from swarmctl.mission.target import Target
from swarmctl.units import Vector

_HORIZONTAL = (0, 1, 3, 4)
"""Rows of the horizontal position and velocity in the state."""


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


def recorded(estimate: Estimate, now: float) -> decisions.EstimateMade:
    """The estimate as it is recorded and sent to all who watch.

    Args:
        estimate: After an update, with what it was made from.
        now: Controller's time, s.
    """
    position, velocity = _vectors(estimate)
    measured = estimate.measured
    return decisions.EstimateMade(
        at_s=now,
        epoch_utc_s=estimate.epoch_s,
        position_enu=position,
        velocity_enu=velocity,
        covariance=tuple(estimate.P.ravel().tolist()),
        probability=estimate.probability,
        nis=estimate.nis,
        rd_count=estimate.rd_count,
        measured_utc_s=estimate.epoch_s if measured is None else measured.epoch_s,
        reference=None if measured is None else measured.reference,
        receivers=() if measured is None else measured.receivers,
        sigma_m=() if measured is None else measured.sigma_m,
        rho=() if measured is None else measured.rho,
    )


def target_of(estimate: Estimate) -> Target:
    """The estimate as guidance relies on it."""
    position, velocity = _vectors(estimate)
    P = estimate.P
    return Target(
        position,
        velocity,
        float(ellipse(P[:3, :3]).major),
        float(ellipse(P[3:, 3:]).major),
        (float(P[0, 0]), float(P[0, 1]), float(P[1, 1])),
        P[np.ix_(_HORIZONTAL, _HORIZONTAL)],
    )


def estimate_snapshot(
    believed: Estimate,
    last: decisions.EstimateMade | None,
    frame: LocalFrame,
    *,
    age_s: float,
    verdict: Verdict,
    limit: str,
) -> EstimateSnapshot:
    """The estimate as the console and the page show it.

    Args:
        believed: Predicted to the instant of the snapshot.
        last: After the last update; None before the first.
        frame: The mission's local frame.
        age_s: Age of the last measurement used, s; infinite before the first.
        verdict: Health of the track.
        limit: What limits the accuracy.
    """
    position, velocity = _vectors(believed)
    major, minor, angle = ellipse(believed.P)
    lat, lon, _ = frame.to_geodetic(*position)
    return EstimateSnapshot(
        position_enu=position,
        lat_rad=lat,
        lon_rad=lon,
        velocity_enu=velocity,
        sigma_major_m=float(major),
        sigma_minor_m=float(minor),
        sigma_angle_rad=float(angle),
        nis=last.nis if last is not None else 0.0,
        rd_count=last.rd_count if last is not None else 0,
        age_s=age_s,
        health=verdict.status,
        why=sentence(verdict),
        limit=limit,
    )


def _vectors(estimate: Estimate) -> tuple[Vector, Vector]:
    east, north, up, v_east, v_north, v_up = estimate.x.tolist()
    return (east, north, up), (v_east, v_north, v_up)
