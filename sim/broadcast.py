"""What of a simulation travels over MQTT: the receivers' measurements and the emitter's truth."""

from __future__ import annotations

import math
from collections.abc import Mapping

import msgspec

from sim.config import SimConfig
from sim.emitter import Emitter
from sim.noise import generator
from sim.receivers import Receivers
from swarmctl.feed.schema import TruthMessage, tdoa_topic, toa_topic, truth_topic
from swarmctl.frames import LocalFrame, Vector

Publication = tuple[str, bytes]
"""Topic and payload."""


class Broadcast:
    """The emitter, the receivers that hear it, and the messages both come to.

    Args:
        config: The simulation.
        frame: Frame of every position.
        step_s: Time between calls of ``emitter.advance()``, s.

    Attributes:
        emitter: The emitter.
    """

    __slots__ = ("_encode", "_frame", "_publish", "_receivers", "_swarm", "emitter")

    def __init__(self, config: SimConfig, frame: LocalFrame, step_s: float) -> None:
        self.emitter = Emitter(config.emitter, frame, step_s, generator(config.seed, "emitter"))
        sysids = tuple(vehicle.sysid for vehicle in config.vehicles)
        self._receivers = Receivers(config.receivers, sysids, config.seed)
        self._publish = config.receivers.publish
        self._frame = frame
        self._swarm = config.swarm
        self._encode = msgspec.json.Encoder().encode

    def burst(self, hearing_enu: Mapping[int, Vector], epoch_utc_s: float) -> list[Publication]:
        """What the receivers publish of a burst that the emitter sends where it is now.

        Args:
            hearing_enu: Positions of the receivers that hear it, m, by system id.
            epoch_utc_s: When it arrives, UTC s.
        """
        emitter, swarm = self.emitter.state.position_enu, self._swarm
        if self._publish == "arrival_times":
            arrivals = self._receivers.arrivals(emitter, hearing_enu, epoch_utc_s)
            return [(toa_topic(swarm, m.receiver), self._encode(m)) for m in arrivals]
        messages = self._receivers.measure(emitter, hearing_enu, epoch_utc_s)
        return [(tdoa_topic(swarm), self._encode(messages))] if messages else []

    def truth(self, epoch_utc_s: float) -> Publication:
        """Where the emitter is now, which is a UTC (s)."""
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
