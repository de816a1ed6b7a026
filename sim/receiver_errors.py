"""Errors of a receiver's arrival times: noise, clock, multipath and echoes (NLOS).

An arrival time's error is the sum of

==========  ===========================================================================
white       new at every burst; the only part that the messages' sigmas state
clock       a bias and a drift, drawn once per receiver
colour      first-order Gauss-Markov, as multipath makes it
echo        at a share of the bursts the direct path is blocked (NLOS): always late
==========  ===========================================================================
"""

from __future__ import annotations

import math

from sim.config import ReceiverConfig
from sim.noise import Normals, generator
from swarmctl.units import SPEED_OF_LIGHT_MPS


class ReceiverErrors:
    """The errors of one receiver's arrival times.

    Args:
        config: Sizes of the errors.
        sysid: System id of the UAV that carries the receiver.
        seed: Seed of the simulation.

    Attributes:
        sigma_s: 1-sigma of the white part, s.
        bias_s: Error of its clock when the clocks start, s; late stamps are positive.
        drift: Seconds its clock gains in a second.
    """

    __slots__ = (
        "_colour_normals",
        "_colour_s",
        "_coloured_utc_s",
        "_config",
        "_echoes",
        "_white",
        "bias_s",
        "drift",
        "sigma_s",
    )

    def __init__(self, config: ReceiverConfig, sysid: int, seed: int) -> None:
        self._config = config
        share = config.rho if sysid == config.reference else 1.0 - config.rho
        self.sigma_s = config.sigma_m * math.sqrt(share) / SPEED_OF_LIGHT_MPS
        clock = Normals(generator(seed, "receiver clock", sysid))
        self.bias_s = config.clock_bias_sigma_s * clock.draw()
        self.drift = config.clock_drift_sigma * clock.draw()
        # Each part has its own generator, so that switching one on leaves the others as they were.
        self._white = Normals(generator(seed, "receiver", sysid))
        self._colour_normals = Normals(generator(seed, "receiver colour", sysid))
        self._echoes = generator(seed, "receiver echo", sysid)
        self._colour_s = 0.0
        self._coloured_utc_s = -math.inf

    def draw_s(self, epoch_utc_s: float, since_start_s: float) -> float:
        """Error of the arrival time of one burst, s; to be called at every burst.

        Args:
            epoch_utc_s: UTC of the burst, s.
            since_start_s: Time since the clocks started, s.
        """
        white_s = self._white.draw() * self.sigma_s
        clock_s = self.bias_s + self.drift * since_start_s
        return white_s + (clock_s + self._colour(epoch_utc_s) + self._echo())

    def _colour(self, epoch_utc_s: float) -> float:
        """The coloured error of this burst, s: stationary at the first one, exact for any gap."""
        config = self._config
        if config.colour_sigma_m == 0.0:
            return 0.0
        gap_s = abs(epoch_utc_s - self._coloured_utc_s)
        phi = math.exp(-gap_s / config.colour_tau_s)
        drive_s = config.colour_sigma_m / SPEED_OF_LIGHT_MPS * math.sqrt(1.0 - phi * phi)
        self._colour_s = phi * self._colour_s + drive_s * self._colour_normals.draw()
        self._coloured_utc_s = epoch_utc_s
        return self._colour_s

    def _echo(self) -> float:
        """How much later than by the direct path this burst arrives, s; 0 without an echo."""
        config = self._config
        if config.nlos_share == 0.0 or self._echoes.random() >= config.nlos_share:
            return 0.0
        return self._echoes.uniform(config.nlos_min_m, config.nlos_max_m) / SPEED_OF_LIGHT_MPS
