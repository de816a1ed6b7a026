"""The radio receivers: when they hear a burst of the emitter, and what they report of it.

Every receiver stamps the burst with an error of its own (:mod:`sim.receiver_errors`). A range
difference is a companion's arrival time minus the reference's, so that all of them share the
reference's error:
``Cov(r_i, r_j) = sigma² ((1 - rho) delta_ij + rho)`` for the white part.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim.config import ReceiverConfig
from sim.receiver_errors import ReceiverErrors
from swarmctl.feed.schema import ArrivalTimeMessage, RangeDifferenceMessage
from swarmctl.units import SPEED_OF_LIGHT_MPS, Vector

_LEAST_SIGMA_S = 1e-3 / SPEED_OF_LIGHT_MPS
"""Least sigma that an arrival time states, s: the reference has none where rho is 0."""


class Receivers:
    """All receivers of the swarm.

    Args:
        config: Rates and errors.
        sysids: System ids of the UAVs that carry them, the reference included.
        seed: Seed of the simulation.
        start_utc_s: UTC at which the clocks are off by their biases alone, s.
    """

    __slots__ = ("_config", "_receivers", "_seq", "_start_utc_s")

    def __init__(
        self, config: ReceiverConfig, sysids: tuple[int, ...], seed: int, start_utc_s: float = 0.0
    ) -> None:
        self._config = config
        self._receivers = {sysid: ReceiverErrors(config, sysid, seed) for sysid in sysids}
        self._start_utc_s = start_utc_s
        self._seq = 0

    def start_clocks(self, utc_s: float) -> None:
        """Make the clocks be off by their biases alone at a UTC (s), and drift from there."""
        self._start_utc_s = utc_s

    def clock_m(self, sysid: int, utc_s: float) -> float:
        """Error of a receiver's clock at a UTC (s) times the speed of light, m."""
        receiver = self._receivers[sysid]
        since_s = utc_s - self._start_utc_s
        return SPEED_OF_LIGHT_MPS * (receiver.bias_s + receiver.drift * since_s)

    def drift_mps(self, sysid: int) -> float:
        """Rate of :meth:`clock_m`, m/s."""
        return SPEED_OF_LIGHT_MPS * self._receivers[sysid].drift

    def measure(
        self, emitter_enu: Vector, hearing_enu: Mapping[int, Vector], epoch_utc_s: float
    ) -> list[RangeDifferenceMessage]:
        """Range differences of one burst; empty unless the reference and a companion hear it.

        Args:
            emitter_enu: True position of the emitter, m.
            hearing_enu: True positions of the receivers that hear, m, by system id.
            epoch_utc_s: When the burst arrives, UTC s.
        """
        flight_s = self._flight_times(emitter_enu, hearing_enu, epoch_utc_s)
        reference = self._config.reference
        if reference not in hearing_enu or len(hearing_enu) < 2:
            return []
        self._seq += 1
        return [
            RangeDifferenceMessage(
                epoch_utc_s=epoch_utc_s,
                reference=reference,
                receiver=sysid,
                rd_m=SPEED_OF_LIGHT_MPS * (flight_s[sysid] - flight_s[reference]),
                sigma_m=self._config.sigma_m,
                rho=self._config.rho,
                clock_sigma_s=self._clock_sigma_s(epoch_utc_s),
                seq=self._seq,
            )
            for sysid in hearing_enu
            if sysid != reference
        ]

    def arrivals(
        self, emitter_enu: Vector, hearing_enu: Mapping[int, Vector], epoch_utc_s: float
    ) -> list[ArrivalTimeMessage]:
        """Arrival times of one burst; empty unless two receivers hear it.

        Args:
            emitter_enu: True position of the emitter, m.
            hearing_enu: True positions of the receivers that hear, m, by system id.
            epoch_utc_s: When the burst arrives, UTC s: at the reference, or at the first of those
                who hear it if the reference does not.
        """
        flight_s = self._flight_times(emitter_enu, hearing_enu, epoch_utc_s)
        if len(hearing_enu) < 2:
            return []
        reference = self._config.reference
        origin = reference if reference in hearing_enu else next(iter(hearing_enu))
        to_origin_s = math.dist(emitter_enu, hearing_enu[origin]) / SPEED_OF_LIGHT_MPS
        self._seq += 1
        messages = []
        for sysid in hearing_enu:
            # The UTC as a float resolves 0.24 us: its fraction is taken before anything is added.
            since_s = epoch_utc_s % 1.0 + (flight_s[sysid] - to_origin_s)
            toa_s, toa_frac_s = divmod(since_s, 1.0)
            messages.append(
                ArrivalTimeMessage(
                    receiver=sysid,
                    toa_s=math.floor(epoch_utc_s) + int(toa_s),
                    toa_frac_s=toa_frac_s,
                    burst=self._seq,
                    sigma_s=max(self._receivers[sysid].sigma_s, _LEAST_SIGMA_S),
                    clock_sigma_s=self._clock_sigma_s(epoch_utc_s),
                    seq=self._seq,
                )
            )
        return messages

    def _flight_times(
        self, emitter_enu: Vector, hearing_enu: Mapping[int, Vector], epoch_utc_s: float
    ) -> dict[int, float]:
        """Time from the emission to the stamped arrival, s; it resolves micrometres, unlike UTC."""
        # Every receiver draws at every epoch, so that its errors do not depend on who hears.
        since_s = epoch_utc_s - self._start_utc_s
        errors = {
            sysid: receiver.draw_s(epoch_utc_s, since_s)
            for sysid, receiver in self._receivers.items()
        }
        return {
            sysid: math.dist(emitter_enu, position) / SPEED_OF_LIGHT_MPS + errors[sysid]
            for sysid, position in hearing_enu.items()
        }

    def _clock_sigma_s(self, epoch_utc_s: float) -> float:
        """1-sigma of a clock at a UTC (s), s."""
        since_s = epoch_utc_s - self._start_utc_s
        return math.hypot(self._config.clock_bias_sigma_s, self._config.clock_drift_sigma * since_s)
