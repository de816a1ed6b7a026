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
from swarmctl.feed.schema import SPEED_OF_LIGHT_MPS, RangeDifferenceMessage
from swarmctl.frames import Vector


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
        # Every receiver draws at every epoch, so that its errors do not depend on who hears.
        errors = {sysid: normals.draw() for sysid, normals in self._errors.items()}
        reference = self._config.reference
        if reference not in hearing_enu or len(hearing_enu) < 2:
            return []
        # Counted from the emission, an arrival time resolves micrometres; in UTC, 70 m.
        arrival_s = {
            sysid: math.dist(emitter_enu, position) / SPEED_OF_LIGHT_MPS
            + errors[sysid] * (self._reference_s if sysid == reference else self._companion_s)
            for sysid, position in hearing_enu.items()
        }
        self._seq += 1
        return [
            RangeDifferenceMessage(
                epoch_utc_s=epoch_utc_s,
                reference=reference,
                receiver=sysid,
                rd_m=SPEED_OF_LIGHT_MPS * (arrival_s[sysid] - arrival_s[reference]),
                sigma_m=self._config.sigma_m,
                rho=self._config.rho,
                clock_sigma_s=0.0,
                seq=self._seq,
            )
            for sysid in hearing_enu
            if sysid != reference
        ]
