"""The radio receivers: when a burst of the emitter arrives where, and what that tells.

Every receiver stamps the burst with an error of its own. Differencing the companions' arrival
times against the reference's gives range differences whose errors share the reference's:
``Cov(r_i, r_j) = sigma² ((1 - rho) delta_ij + rho)`` of the white part.

An arrival time's error is the sum of

==========  ===========================================================================
white       new at every burst; the only part that the messages' sigmas state
clock       a bias and a drift, drawn once per receiver
colour      first-order Gauss-Markov, as multipath makes it
echo        at a share of the bursts the direct path is blocked: always late
==========  ===========================================================================
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim.config import ReceiverConfig
from sim.noise import Normals, generator
from swarmctl.feed.schema import ArrivalTimeMessage, RangeDifferenceMessage
from swarmctl.units import SPEED_OF_LIGHT_MPS, Vector

_LEAST_SIGMA_S = 1e-3 / SPEED_OF_LIGHT_MPS
"""A receiver without error (rho of 0 makes the reference one) states this: no less is taken."""


class _Receiver:
    """One receiver: how far off its arrival times are.

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
        # A generator for each part: one that is switched on leaves the others as they were.
        self._white = Normals(generator(seed, "receiver", sysid))
        self._colour_normals = Normals(generator(seed, "receiver colour", sysid))
        self._echoes = generator(seed, "receiver echo", sysid)
        self._colour_s = 0.0
        self._coloured_utc_s = -math.inf

    def draw_s(self, epoch_utc_s: float, since_start_s: float) -> float:
        """Error of the arrival time of one burst, s; to be called at every burst.

        Args:
            epoch_utc_s: The burst, UTC s.
            since_start_s: Since the clocks started, s.
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
        """How much later than by the direct path this burst comes, s."""
        config = self._config
        if config.nlos_share == 0.0 or self._echoes.random() >= config.nlos_share:
            return 0.0
        return self._echoes.uniform(config.nlos_min_m, config.nlos_max_m) / SPEED_OF_LIGHT_MPS


class Receivers:
    """All receivers of the swarm.

    Args:
        config: Rates and errors.
        sysids: System ids of the UAVs that carry them, the reference included.
        seed: Seed of the simulation.
        start_utc_s: As for :meth:`start_clocks`.
    """

    __slots__ = ("_config", "_receivers", "_seq", "_start_utc_s")

    def __init__(
        self, config: ReceiverConfig, sysids: tuple[int, ...], seed: int, start_utc_s: float = 0.0
    ) -> None:
        self._config = config
        self._receivers = {sysid: _Receiver(config, sysid, seed) for sysid in sysids}
        self._start_utc_s = start_utc_s
        self._seq = 0

    def start_clocks(self, utc_s: float) -> None:
        """Let the clocks be off by their biases alone at a UTC (s), and drift from there."""
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
            # Of the float's fraction only what lies above 0.24 us is there to be kept.
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
        """From the emission to the arrival as stamped, s: resolves micrometres, unlike UTC."""
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
