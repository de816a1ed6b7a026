"""The estimate as it is published over MQTT: which fields, in which units, how often."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from swarmctl.decisions import EstimateMade
from swarmctl.estimation.bounds.consistency import ellipse
from swarmctl.feed.schema import EstimateMessage, estimate_topic
from swarmctl.frames import LocalFrame
from swarmctl.units import CHI2_95_2DOF

ESTIMATE_PERIOD_S = 0.5
"""Least time between two publications, station's s."""


class EstimatePublication:
    """Publishes a swarm's estimate, at most once every ``ESTIMATE_PERIOD_S``.

    Args:
        swarm: Name of the swarm, for the topic.
        frame: The mission's local frame.
        now: Monotonic time, s.
    """

    def __init__(self, swarm: str, frame: LocalFrame, now: float) -> None:
        self._topic = estimate_topic(swarm)
        self._frame = frame
        self._due_s = now
        self._publications: list[tuple[str, bytes]] = []

    def offer(self, estimate: EstimateMade, utc_s: float | None, now: float) -> None:
        """Publish an estimate, unless the last one was published too recently.

        Args:
            estimate: The estimate.
            utc_s: UTC now, s; None while it is unknown.
            now: Monotonic time, s.
        """
        if now < self._due_s:
            return
        self._due_s = now + ESTIMATE_PERIOD_S
        message = estimate_message(estimate, self._frame, utc_s)
        self._publications.append((self._topic, msgspec.json.encode(message)))

    def drain(self) -> list[tuple[str, bytes]]:
        """Drain the MQTT messages to publish, as (topic, payload)."""
        drained, self._publications = self._publications, []
        return drained


def estimate_message(
    estimate: EstimateMade, frame: LocalFrame, utc_s: float | None
) -> EstimateMessage:
    """The message that publishes an estimate.

    Args:
        estimate: The estimate.
        frame: The mission's local frame.
        utc_s: UTC now, s; None while it is unknown, then the age is 0.
    """
    lat, lon, alt = frame.to_geodetic(*estimate.position_enu)
    cov = np.array(estimate.covariance).reshape(6, 6)
    major, minor, angle = ellipse(cov)
    scale = math.sqrt(CHI2_95_2DOF)
    return EstimateMessage(
        epoch_utc_s=estimate.epoch_utc_s,
        lat_deg=math.degrees(lat),
        lon_deg=math.degrees(lon),
        alt_amsl_m=alt,
        position_enu=estimate.position_enu,
        velocity_enu=estimate.velocity_enu,
        covariance_enu=tuple(cov[:3, :3].ravel().tolist()),
        ellipse_95=(scale * float(major), scale * float(minor), float(angle)),
        age_s=max(0.0, utc_s - estimate.epoch_utc_s) if utc_s is not None else 0.0,
    )
