"""The live feed of a track: positions, and range differences or arrival times, in; rows out.

Messages may come late, out of order, twice, or not at all. Time is measurement epochs only
(UTC s); how long to wait for a position is judged by the epochs of newer positions.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import as_not_negative
from swarmctl.estimation.estimate import Counts, Estimate
from swarmctl.estimation.feed.alignment import SwarmPositions
from swarmctl.estimation.feed.corrupt_numbers import are_plausible, is_arrival_plausible
from swarmctl.estimation.feed.locating import locate
from swarmctl.estimation.feed.pairing import Arrival, Burst, Measurement, Pairing, differences
from swarmctl.estimation.track.track import Track
from swarmctl.units import Vector


class MeasurementQueue:
    """Turns a swarm's positions and range differences or arrival times into a track's rows.

    Range differences of one epoch and reference are one measurement, with the noise they share.
    Those that arrive after the rest of their epoch was used are an update of their own: right
    but for that shared noise.

    Arrival times of one burst are one measurement, too, once it waits for no receiver
    (:class:`~swarmctl.estimation.feed.pairing.Pairing`): range differences against one of them,
    whose arrival time is the epoch. A burst must not come in both ways, or it counts twice.

    Attributes:
        dropped: How many measurements were not used, by reason. Range differences: ``invalid``
            (not finite, absurd, sigma <= 0, rho outside [0, 1), receiver = reference),
            ``duplicate``, ``too_old`` (more than ``history_s`` behind the track),
            ``no_position`` (a vehicle's position is not known near the epoch), ``singular`` (the
            update has no finite result). Arrival times: the same but for ``singular``, and
            ``late``, ``alone``, ``times_apart``, ``numbers_differ`` of
            :class:`~swarmctl.estimation.feed.pairing.Pairing`. Positions: ``invalid_position``
            (not finite or absurd).
        complaints: A sentence for each way in which receivers' bursts were first seen not to
            fit together, or measurements to be of another time than positions.

    Args:
        track: The track to feed.
        vehicles: System ids of the UAVs that may measure.
        sigma_p_m: 1-sigma of the vehicles' reported positions, per axis, m.
        max_wait_s: How much newer the newest position of any vehicle may get before a
            measurement no longer waits for its own vehicles' next positions, s.
        max_burst_wait_s: How much newer the arrivals at two receivers may get before a burst no
            longer waits for a third, s.
        history_s: How far back positions are kept and late measurements used, s.
        max_extrapolation_s: How far from its nearest sample a vehicle's position is used, s.

    Raises:
        EstimationError: A number is not finite or negative.
    """

    def __init__(
        self,
        track: Track,
        *,
        vehicles: Collection[int],
        sigma_p_m: float,
        max_wait_s: float = 0.3,
        max_burst_wait_s: float = 1.0,
        history_s: float = 5.0,
        max_extrapolation_s: float = 0.5,
    ) -> None:
        self._track = track
        self._vehicles = frozenset(vehicles)
        self._sigma_p = as_not_negative("sigma_p_m", sigma_p_m)
        self._history_s = as_not_negative("history_s", history_s)
        self._positions = SwarmPositions(
            history_s,
            as_not_negative("max_extrapolation_s", max_extrapolation_s),
            as_not_negative("max_wait_s", max_wait_s),
        )
        self._pending: dict[tuple[float, int], dict[int, Measurement]] = {}
        self._used_receivers: dict[tuple[float, int], set[int]] = {}
        self._pairing = Pairing(
            self._vehicles, as_not_negative("max_burst_wait_s", max_burst_wait_s)
        )
        self.dropped = self._pairing.dropped
        self.complaints = self._pairing.complaints
        self._is_time_complained = False

    @property
    def counts(self) -> Counts:
        """What became of the range differences and arrival times."""
        dropped = self.dropped.total() - self.dropped["invalid_position"]
        return self._track.counts._replace(dropped=dropped)

    def add_position(
        self, vehicle: int, epoch_s: float, position_enu: Vector, velocity_enu: Vector
    ) -> None:
        """Take a vehicle's reported position.

        Args:
            vehicle: Its system id.
            epoch_s: Epoch of the sample, s.
            position_enu: m.
            velocity_enu: m/s.

        Raises:
            EstimationError: The vehicle is not in the swarm.
        """
        self._require_known("vehicle", vehicle)
        if not (math.isfinite(epoch_s) and are_plausible(*position_enu, *velocity_enu)):
            self.dropped["invalid_position"] += 1
            return
        self._positions.add(vehicle, epoch_s, position_enu, velocity_enu)

    def add_range_differences(
        self,
        epoch_s: float,
        reference: int,
        receivers: Sequence[int],
        rd_m: Sequence[float],
        sigma_m: Sequence[float],
        rho: float,
    ) -> None:
        """Take range differences of one epoch; more of the same epoch may follow.

        Args:
            epoch_s: Epoch of reception, s.
            reference: System id of the reference's vehicle.
            receivers: System ids of the companions.
            rd_m: Range difference of each, m.
            sigma_m: 1-sigma of each, m.
            rho: Share of each variance that comes from the reference receiver, [0, 1).

        Raises:
            EstimationError: The three sequences differ in length, or the reference or a
                receiver is not in the swarm.
        """
        self._require_known("reference", reference)
        for receiver in receivers:
            self._require_known("receiver", receiver)
        if not len(receivers) == len(rd_m) == len(sigma_m):
            raise EstimationError(
                "receivers, rd_m and sigma_m must have one entry per range difference; they "
                f"have {len(receivers)}, {len(rd_m)} and {len(sigma_m)}."
            )
        if not (math.isfinite(epoch_s) and 0.0 <= rho < 1.0):
            self.dropped["invalid"] += len(receivers)
            return
        key = (epoch_s, reference)
        used = self._used_receivers.get(key, ())
        pending = self._pending.get(key, {})
        for receiver, rd, sigma in zip(receivers, rd_m, sigma_m, strict=True):
            if receiver == reference or not (sigma > 0.0 and are_plausible(rd, sigma)):
                self.dropped["invalid"] += 1
            elif receiver in pending or receiver in used:
                self.dropped["duplicate"] += 1
            else:
                pending[receiver] = Measurement(rd, sigma, rho)
        if pending:
            self._pending[key] = pending

    def add_arrival(
        self, receiver: int, burst: int, toa_s: int, toa_frac_s: float, sigma_s: float
    ) -> None:
        """Take the arrival time ``toa_s + toa_frac_s`` of a burst at a receiver.

        Args:
            receiver: System id of its vehicle.
            burst: The receivers' number of the burst.
            toa_s: Whole seconds.
            toa_frac_s: The rest, 0 <= toa_frac_s < 1, s.
            sigma_s: 1-sigma of its own error, s.

        Raises:
            EstimationError: The receiver is not in the swarm.
        """
        self._require_known("receiver", receiver)
        if is_arrival_plausible(toa_s, toa_frac_s, sigma_s):
            self._pairing.add(burst, Arrival(receiver, toa_s, toa_frac_s, sigma_s))
        else:
            self.dropped["invalid"] += 1

    def process(self, leader: int | None = None) -> list[Estimate]:
        """Use every pending measurement whose time has come, in the order of their epochs.

        A measurement older than the track updates the state expressed at its own epoch, which
        then returns to the track's; the process noise of the few seconds between is neglected.

        Args:
            leader: Whose arrival times the others' are differenced against where it heard the
                burst; else, or for None, the least system id's.

        Returns:
            For each measurement used, the estimate after it: where the emitter most probably
            is, with a covariance that spans the places not excluded yet.
        """
        updates = []
        for key in sorted(self._pending):
            epoch_s, reference = key
            if not self._positions.is_due(epoch_s, (reference, *self._pending[key])):
                continue
            measurements = self._pending.pop(key)
            update = self._use(*key, measurements)
            if update is not None:
                updates.append(update)
        for burst in self._pairing.waiting():
            update = self._try(burst, leader)
            if update is not None:
                updates.append(update)
        if updates:
            self._forget_before(updates[-1].epoch_s - self._history_s)
        return updates

    def _require_known(self, name: str, vehicle: int) -> None:
        if vehicle not in self._vehicles:
            known = ", ".join(str(sysid) for sysid in sorted(self._vehicles))
            raise EstimationError(f"{name} {vehicle} is unknown: the vehicles are {known}.")

    def _try(self, burst: Burst, leader: int | None) -> Estimate | None:
        """Use a burst whose time has come; give up one whose time is past, or far ahead."""
        arrivals = burst.arrivals
        epoch_s = _reference(arrivals, leader).epoch_s
        if self._positions.are_past(epoch_s):
            self._give_up(burst, epoch_s, "too_old")
            return None
        if self._positions.are_far_behind(epoch_s):
            self._give_up(burst, epoch_s, "no_position")
            return None
        if not (self._pairing.is_whole(burst) and self._positions.is_due(epoch_s, arrivals)):
            return None
        located = {
            receiver: arrival
            for receiver, arrival in arrivals.items()
            if self._positions.at(receiver, epoch_s) is not None
        }
        if len(located) < 2:
            self._pairing.give_up(burst, "no_position")
            return None
        self._pairing.use(burst)
        if len(located) < len(arrivals):
            self.dropped["no_position"] += len(arrivals) - len(located)
        reference = _reference(located, leader)
        del located[reference.receiver]
        measurements = differences(reference, located.values())
        return self._use(reference.epoch_s, reference.receiver, measurements)

    def _give_up(self, burst: Burst, epoch_s: float, reason: str) -> None:
        if len(burst.arrivals) > 1:  # a lone one is its receiver's trouble
            self._complain_of_time(epoch_s, "arrival times")
        self._pairing.give_up(burst, reason)

    def _complain_of_time(self, epoch_s: float, what: str) -> None:
        """Say, once, that measurements are of another time than the positions."""
        off_s = epoch_s - self._positions.newest_s
        if self._is_time_complained or not math.isfinite(off_s):
            return
        self._is_time_complained = True
        self.complaints.append(
            f"{what} are {abs(off_s):.1f} s {'ahead of' if off_s > 0.0 else 'behind'} the vehicles'"
            " positions and come to nothing: set the receivers' clocks to the vehicles' UTC, and"
            " publish what is measured at once"
        )

    def _use(
        self, epoch_s: float, reference: int, measurements: dict[int, Measurement]
    ) -> Estimate | None:
        if self._track.is_begun and epoch_s < self._track.epoch_s - self._history_s:
            self.dropped["too_old"] += len(measurements)
            self._complain_of_time(epoch_s, "range differences")
            return None
        if self._positions.are_far_behind(epoch_s):
            self._complain_of_time(epoch_s, "range differences")
        located = locate(self._positions, epoch_s, reference, measurements, self._sigma_p)
        receivers = () if located is None else located.measured.receivers
        if len(receivers) < len(measurements):
            self.dropped["no_position"] += len(measurements) - len(receivers)
        if located is None:
            return None
        try:
            has_estimate = self._track.update(located.rows)
        except EstimationError:
            self.dropped["singular"] += len(receivers)
            return None
        self._used_receivers.setdefault((epoch_s, reference), set()).update(receivers)
        return self._track.latest()._replace(measured=located.measured) if has_estimate else None

    def _forget_before(self, oldest_s: float) -> None:
        """Forget which measurements were used once repeats would be too old anyway."""
        for key in [key for key in self._used_receivers if key[0] < oldest_s]:
            del self._used_receivers[key]


def _reference(arrivals: Mapping[int, Arrival], leader: int | None) -> Arrival:
    """The arrival to difference against."""
    return arrivals[min(arrivals) if leader is None or leader not in arrivals else leader]
