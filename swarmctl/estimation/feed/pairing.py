"""Arrival times in, range differences out: which arrivals are of one burst, and when it is whole.

Every receiver stamps a burst on its own, so the reference need not be known before the burst
is used. Differenced against one arrival of the burst, the others are range differences

    r_i = c (t_i - t_ref),  Var(r_i) = c² (s_i² + s_ref²),  Cov(r_i, r_j) = c² s_ref²

which is the covariance of :func:`~swarmctl.estimation.model.range_difference.rd_covariance` with
``rho_i = s_ref² / (s_i² + s_ref²)``. Range differences against another reference are an
invertible linear map of these, so the choice moves no information.

Arrival times stay in two parts, whole seconds and a fraction, until they are differenced: the
fraction resolves 1e-16 s (30 nm), their sum in float64 only 0.24 us (71 m).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import NamedTuple

from swarmctl.units import SPEED_OF_LIGHT_MPS

MAX_SPREAD_S = 50e3 / SPEED_OF_LIGHT_MPS
"""No two UAVs of a swarm are 50 km apart, so no burst's arrivals are further apart in time."""
_REMEMBERED = 512
"""Bursts remembered once they are done with: ten seconds of the densest feed."""


class Measurement(NamedTuple):
    """A range difference, its 1-sigma (both m) and the reference's share of its variance."""

    rd_m: float
    sigma_m: float
    rho: float


class Arrival(NamedTuple):
    """When a receiver heard a burst, ``toa_s + toa_frac_s`` (s), and the 1-sigma of its error."""

    receiver: int
    toa_s: int
    toa_frac_s: float
    sigma_s: float

    @property
    def epoch_s(self) -> float:
        """The arrival time as an epoch, s: good for where a vehicle was, not for ranging."""
        return self.toa_s + self.toa_frac_s

    def later_s(self, other: Arrival) -> float:
        """How much later than another it came, s, to 1e-16 s."""
        return (self.toa_s - other.toa_s) + (self.toa_frac_s - other.toa_frac_s)

    def may_share_burst(self, other: Arrival) -> bool:
        """Whether any geometry lets one burst arrive at these two times."""
        return abs(self.later_s(other)) <= MAX_SPREAD_S


def differences(reference: Arrival, others: Iterable[Arrival]) -> dict[int, Measurement]:
    """Range differences of one burst against one of its arrivals.

    Args:
        reference: The arrival to difference against.
        others: Arrivals of the same burst at other receivers.

    Returns:
        By receiver. The companion's own part of each variance is its ``sigma_s``, as it should
        be whatever the reference is.
    """
    found = {}
    for arrival in others:
        sigma_s = math.hypot(arrival.sigma_s, reference.sigma_s)
        found[arrival.receiver] = Measurement(
            SPEED_OF_LIGHT_MPS * arrival.later_s(reference),
            SPEED_OF_LIGHT_MPS * sigma_s,
            (reference.sigma_s / sigma_s) ** 2,
        )
    return found


@dataclass(eq=False, slots=True)
class Burst:
    """The arrivals that share a number and, as far as any geometry allows, a time.

    Attributes:
        number: The receivers' number of it.
        first: The arrival that came in first.
        arrivals: All, by receiver.
    """

    number: int
    first: Arrival
    arrivals: dict[int, Arrival]

    @property
    def epoch_s(self) -> float:
        """When it arrived, s, to :data:`MAX_SPREAD_S`."""
        return self.first.epoch_s


class Pairing:
    """Sorts arrivals into bursts and knows for whom a burst still waits.

    A burst waits for a receiver until that has delivered this burst or a later one (arrivals
    of one receiver come in order), or two receivers have delivered bursts ``max_wait_s``
    newer. From then on it is not waited for until it delivers in time again: losing a receiver
    delays the bursts once, not each of them. Two, so that one receiver whose clock is ahead
    cannot hurry the others.

    Attributes:
        dropped: Arrivals that came to nothing, by reason: ``duplicate``; ``late`` (its burst was
            used already: against the same reference it would share that one's error with the
            range differences already used, as if it were new); ``alone`` (nobody else heard
            the burst); ``times_apart`` (alone, and others give the same number at a time that no
            geometry allows); ``numbers_differ`` (alone, and others give the same time another
            number).
        complaints: A sentence for the first of each of the last two.

    Args:
        receivers: System ids of those who may hear.
        max_wait_s: See above, s.
    """

    def __init__(self, receivers: Collection[int], max_wait_s: float) -> None:
        self._receivers = frozenset(receivers)
        self._max_wait_s = max_wait_s
        self._waiting: dict[int, list[Burst]] = {}
        self._done: dict[int, Burst] = {}
        self._latest_s: dict[int, float] = {}
        self._absent: set[int] = set()
        self.dropped: Counter[str] = Counter()
        self.complaints: list[str] = []

    def add(self, number: int, arrival: Arrival) -> None:
        """Take an arrival of a known receiver."""
        epoch_s = arrival.epoch_s
        self._latest_s[arrival.receiver] = epoch_s
        if epoch_s >= self._reached_s() - self._max_wait_s:
            self._absent.discard(arrival.receiver)
        done = self._done.get(number)
        if done is not None and arrival.may_share_burst(done.first):
            self.dropped["duplicate" if arrival.receiver in done.arrivals else "late"] += 1
            return
        namesakes = self._waiting.setdefault(number, [])
        for burst in namesakes:
            if arrival.may_share_burst(burst.first):
                if arrival.receiver in burst.arrivals:
                    self.dropped["duplicate"] += 1
                else:
                    burst.arrivals[arrival.receiver] = arrival
                return
        namesakes.append(Burst(number, arrival, {arrival.receiver: arrival}))

    def waiting(self) -> list[Burst]:
        """The bursts that are not done with, in the order of their epochs."""
        bursts = [burst for namesakes in self._waiting.values() for burst in namesakes]
        return sorted(bursts, key=lambda burst: burst.epoch_s)

    def is_whole(self, burst: Burst) -> bool:
        """Whether a burst has the two arrivals it takes and waits for nobody."""
        if len(burst.arrivals) < 2:
            return False
        if burst.epoch_s < self._reached_s() - self._max_wait_s:
            return True
        return self._missing(burst) <= self._absent

    def use(self, burst: Burst) -> None:
        """The burst is being used: what arrives of it from now on is late."""
        self._absent |= self._missing(burst)
        self._close(burst)

    def give_up(self, burst: Burst, reason: str) -> None:
        """The burst cannot be used: count its arrivals, under the reason or for being alone."""
        if len(burst.arrivals) > 1:
            self.dropped[reason] += len(burst.arrivals)
        else:
            self.dropped[self._why_alone(burst)] += 1
        self._close(burst)

    def _missing(self, burst: Burst) -> set[int]:
        """Those who have delivered neither this burst nor a later one."""
        epoch_s, latest_s = burst.epoch_s, self._latest_s
        return {
            receiver
            for receiver in self._receivers - burst.arrivals.keys()
            if latest_s.get(receiver, -math.inf) <= epoch_s
        }

    def _reached_s(self) -> float:
        """The epoch that at least two receivers have delivered, s."""
        return sorted((-math.inf, -math.inf, *self._latest_s.values()))[-2]

    def _close(self, burst: Burst) -> None:
        namesakes = self._waiting[burst.number]
        namesakes.remove(burst)
        if not namesakes:
            del self._waiting[burst.number]
        self._done.pop(burst.number, None)
        self._done[burst.number] = burst
        if len(self._done) > _REMEMBERED:
            del self._done[next(iter(self._done))]

    def _why_alone(self, burst: Burst) -> str:
        number, lone = burst.number, burst.first
        others = [b for b in (*self.waiting(), *self._done.values()) if b is not burst]
        others = [b for b in others if lone.receiver not in b.arrivals]
        for other in others:
            if other.number == number:
                return self._complain(
                    "times_apart",
                    f"receiver {lone.receiver} heard burst {number} "
                    f"{lone.later_s(other.first):+.6f} s from receiver {other.first.receiver}, "
                    "further than any geometry allows: synchronise their clocks, and number "
                    "bursts alike",
                )
        for other in others:
            if lone.may_share_burst(other.first):
                return self._complain(
                    "numbers_differ",
                    f"receiver {lone.receiver} gives the number {number} to the burst that "
                    f"receiver {other.first.receiver} gives the number {other.number}: all "
                    "receivers must number bursts alike",
                )
        return "alone"

    def _complain(self, kind: str, sentence: str) -> str:
        if not self.dropped[kind]:
            self.complaints.append(sentence)
        return kind
