"""Receivers around an emitter, for tests."""

from __future__ import annotations

import math

from sim.config import ReceiverConfig
from sim.receivers import Receivers
from swarmctl.units import SPEED_OF_LIGHT_MPS

RISK = 1e-4
"""Probability that a correct implementation misses one of the derived bounds."""
EMITTER = (1000.0, 2000.0, 0.0)
PLACES = {
    1: (0.0, 0.0, 100.0),
    2: (50.0, 10.0, 90.0),
    3: (-40.0, 30.0, 110.0),
    4: (5.0, -60.0, 100.0),
}
UTC = 1_790_000_000.0
WHITE_ONLY = ReceiverConfig(reference=2)
POOR = ReceiverConfig(
    reference=2,
    clock_bias_sigma_s=10e-9,
    clock_drift_sigma=0.2e-9,
    nlos_share=0.3,
    colour_sigma_m=1.0,
)
"""With every error there is."""


def arrival_errors_m(receivers: Receivers, epoch_utc_s: float) -> dict[int, float]:
    """Arrival times less times of flight, m, by receiver, right to some 10 nm.

    The burst arrives at receiver 2, the reference, at the epoch.
    """
    to_2_m = math.dist(EMITTER, PLACES[2])
    return {
        m.receiver: SPEED_OF_LIGHT_MPS * (float(m.toa_s) - epoch_utc_s + m.toa_frac_s)
        - (math.dist(EMITTER, PLACES[m.receiver]) - to_2_m)
        for m in receivers.arrivals(EMITTER, PLACES, epoch_utc_s)
    }
