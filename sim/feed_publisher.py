"""What a simulation publishes over MQTT: the receivers' measurements and the truth."""

from __future__ import annotations

import math
from collections.abc import Mapping

import msgspec

from sim.config import SimConfig
from sim.emitter import Emitter
from sim.noise import generator
from sim.receivers import Receivers
from swarmctl.feed.schema import (
    ReceiverTruthMessage,
    TruthMessage,
    receivers_truth_topic,
    tdoa_topic,
    toa_topic,
    truth_topic,
)
from swarmctl.frames import LocalFrame
from swarmctl.units import Vector

Publication = tuple[str, bytes]
"""Topic and payload of one MQTT message."""


class FeedPublisher:
    """The emitter, the receivers that hear it, and their messages.

    Args:
        config: The simulation.
        frame: Frame of every position.
        step_s: Time between calls of ``emitter.advance()``, s.

    Attributes:
        emitter: The emitter.
        receivers: The receivers.
    """

    __slots__ = (
        "_encode",
        "_frame",
        "_imperfect",
        "_publish",
        "_swarm",
        "emitter",
        "receivers",
    )

    def __init__(self, config: SimConfig, frame: LocalFrame, step_s: float) -> None:
        self.emitter = Emitter(config.emitter, frame, step_s, generator(config.seed, "emitter"))
        sysids = tuple(vehicle.sysid for vehicle in config.vehicles)
        self.receivers = Receivers(config.receivers, sysids, config.seed, config.utc_start_s)
        self._imperfect = (
            config.receivers.clock_bias_sigma_s > 0.0
            or config.receivers.clock_drift_sigma > 0.0
            or config.navigation.correlated_sigma_m > 0.0
        )
        self._publish = config.receivers.publish
        self._frame = frame
        self._swarm = config.swarm
        self._encode = msgspec.json.Encoder().encode

    def burst(self, hearing_enu: Mapping[int, Vector], epoch_utc_s: float) -> list[Publication]:
        """What the receivers publish of a burst that the emitter sends at its present place.

        Args:
            hearing_enu: Positions of the receivers that hear it, m, by system id.
            epoch_utc_s: UTC of its arrival, s.
        """
        emitter, swarm = self.emitter.state.position_enu, self._swarm
        if self._publish == "arrival_times":
            arrivals = self.receivers.arrivals(emitter, hearing_enu, epoch_utc_s)
            return [(toa_topic(swarm, m.receiver), self._encode(m)) for m in arrivals]
        messages = self.receivers.measure(emitter, hearing_enu, epoch_utc_s)
        return [(tdoa_topic(swarm), self._encode(messages))] if messages else []

    def truth(self, epoch_utc_s: float) -> Publication:
        """The true state of the emitter, at a UTC (s)."""
        state = self.emitter.state
        lat, lon, alt = self._frame.to_geodetic(*state.position_enu)
        message = TruthMessage(
            epoch_utc_s=epoch_utc_s,
            lat_deg=math.degrees(lat),
            lon_deg=math.degrees(lon),
            alt_amsl_m=alt,
            velocity_enu=state.velocity_enu,
        )
        return truth_topic(self._swarm), self._encode(message)

    def receivers_truth(
        self, navigation_enu: Mapping[int, Vector], epoch_utc_s: float
    ) -> list[Publication]:
        """The true clock and position errors of the receivers; empty if there are none.

        Args:
            navigation_enu: Reported minus true position of each receiver's UAV, m, by system id.
            epoch_utc_s: UTC of the errors, s.
        """
        if not self._imperfect:
            return []
        messages = [
            ReceiverTruthMessage(
                epoch_utc_s=epoch_utc_s,
                receiver=sysid,
                clock_m=self.receivers.clock_m(sysid, epoch_utc_s),
                drift_mps=self.receivers.drift_mps(sysid),
                navigation_enu=error,
            )
            for sysid, error in navigation_enu.items()
        ]
        return [(receivers_truth_topic(self._swarm), self._encode(messages))]
