"""The radio receivers: when a burst of the emitter arrives where, and what that tells.

Every receiver stamps the burst with an error of its own. Differencing the companions' arrival
times against the reference's gives range differences whose errors share the reference's:
``Cov(r_i, r_j) = sigma² ((1 - rho) delta_ij + rho)``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim.config import ReceiverConfig
from sim.noise import Normals, generator
from swarmctl.feed.schema import (
    SPEED_OF_LIGHT_MPS,
    ArrivalTimeMessage,
    RangeDifferenceMessage,
)
from swarmctl.frames import Vector

_LEAST_SIGMA_S = 1e-3 / SPEED_OF_LIGHT_MPS
"""A receiver without error (rho of 0 makes the reference one) states this: no less is taken."""


class Receivers:
    """All receivers of the swarm.

    Args:
        config: Rates and errors.
        sysids: System ids of the UAVs that carry them, the reference included.
        seed: Seed of the simulation.
    """

    __slots__ = ("_companion_s", "_config", "_errors", "_reference_s", "_seq")

    def __init__(self, config: ReceiverConfig, sysids: tuple[int, ...], seed: int) -> None:
        self._config = config
        self._errors = {sysid: Normals(generator(seed, "receiver", sysid)) for sysid in sysids}
        self._reference_s = config.sigma_m * math.sqrt(config.rho) / SPEED_OF_LIGHT_MPS
        self._companion_s = config.sigma_m * math.sqrt(1.0 - config.rho) / SPEED_OF_LIGHT_MPS
        self._seq = 0

    def measure(
        self, emitter_enu: Vector, hearing_enu: Mapping[int, Vector], epoch_utc_s: float
    ) -> list[RangeDifferenceMessage]:
        """Range differences of one burst; empty unless the reference and a companion hear it.

        Args:
            emitter_enu: True position of the emitter, m.
            hearing_enu: True positions of the receivers that hear, m, by system id.
            epoch_utc_s: When the burst arrives, UTC s.
        """
        flight_s = self._flight_times(emitter_enu, hearing_enu)
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
                clock_sigma_s=0.0,
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
        flight_s = self._flight_times(emitter_enu, hearing_enu)
        if len(hearing_enu) < 2:
            return []
        reference = self._config.reference
        origin = reference if reference in hearing_enu else next(iter(hearing_enu))
        to_origin_s = math.dist(emitter_enu, hearing_enu[origin]) / SPEED_OF_LIGHT_MPS
        self._seq += 1
        messages = []
        for sysid in hearing_enu:
            # Of the float's fraction only what lies above 0.24 us is there to be kept.
            since_s = epoch_utc_s % 1.0 + (flight_s[sysid] - to_origin_s)
            toa_s, toa_frac_s = divmod(since_s, 1.0)
            messages.append(
                ArrivalTimeMessage(
                    receiver=sysid,
                    toa_s=math.floor(epoch_utc_s) + int(toa_s),
                    toa_frac_s=toa_frac_s,
                    burst=self._seq,
                    sigma_s=max(self._sigma_s(sysid), _LEAST_SIGMA_S),
                    clock_sigma_s=0.0,
                    seq=self._seq,
                )
            )
        return messages

    def _flight_times(
        self, emitter_enu: Vector, hearing_enu: Mapping[int, Vector]
    ) -> dict[int, float]:
        """From the emission to the arrival as stamped, s: resolves micrometres, unlike UTC."""
        # Every receiver draws at every epoch, so that its errors do not depend on who hears.
        errors = {sysid: normals.draw() for sysid, normals in self._errors.items()}
        return {
            sysid: math.dist(emitter_enu, position) / SPEED_OF_LIGHT_MPS
            + errors[sysid] * self._sigma_s(sysid)
            for sysid, position in hearing_enu.items()
        }

    def _sigma_s(self, sysid: int) -> float:
        return self._reference_s if sysid == self._config.reference else self._companion_s
