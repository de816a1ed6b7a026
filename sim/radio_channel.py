"""A lossy radio channel for datagrams: loss, delay, jitter, duplication, on virtual time."""

from __future__ import annotations

import heapq
from typing import Generic, TypeVar

import msgspec
import numpy as np

from swarmctl.errors import SimulationError

Item = TypeVar("Item")


class Impairments(msgspec.Struct, frozen=True):
    """What a channel does to each datagram.

    Attributes:
        loss: Probability that a datagram is lost.
        duplication: Probability that a datagram that is not lost arrives twice; each copy has
            its own delay.
        delay_s: Least delay, s.
        jitter_s: Greatest further delay, uniformly distributed, s. A datagram may overtake one
            that was sent less than this before it.
    """

    loss: float = 0.0
    duplication: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0


class RadioChannel(Generic[Item]):
    """One direction of a radio channel.

    Args:
        impairments: What it does to datagrams.
        generator: Source of its random draws.

    Attributes:
        sent: Datagrams handed in.
        delivered: Datagrams handed out, copies included.

    Raises:
        SimulationError: A probability is not in 0..1, or a delay is negative.
    """

    def __init__(self, impairments: Impairments, generator: np.random.Generator) -> None:
        chances = (impairments.loss, impairments.duplication)
        delays = (impairments.delay_s, impairments.jitter_s)
        if not (all(0.0 <= p <= 1.0 for p in chances) and all(d >= 0.0 for d in delays)):
            raise SimulationError(
                f"The channel cannot have {impairments}: loss and duplication are probabilities, "
                "delay and jitter are at least 0 s."
            )
        self._impairments = impairments
        self._generator = generator
        # Sorted by time of arrival; the count keeps simultaneous ones in order.
        self._under_way: list[tuple[float, int, Item]] = []
        self._copies = 0
        self.sent = 0
        self.delivered = 0

    def send(self, item: Item, now_s: float) -> None:
        """Hand in a datagram at a time (s)."""
        self.sent += 1
        lost, twice = self._generator.random(2)
        if lost < self._impairments.loss:
            return
        for _ in range(2 if twice < self._impairments.duplication else 1):
            jitter_s = self._impairments.jitter_s * self._generator.random()
            at_s = now_s + self._impairments.delay_s + jitter_s
            heapq.heappush(self._under_way, (at_s, self._copies, item))
            self._copies += 1

    def receive(self, now_s: float) -> list[Item]:
        """Datagrams that arrived since the last call and by a time (s), in order of arrival."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= now_s:
            arrived.append(heapq.heappop(self._under_way)[2])
        self.delivered += len(arrived)
        return arrived
