"""From MQTT payloads to observations: decode, check, group. No I/O.

:meth:`FeedIntake.receive` never raises: the first unusable message of each kind is reported, and
later ones are only counted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from typing import Any, Generic, TypeVar

import msgspec

from swarmctl.events import (
    ArrivalTime,
    InputRejected,
    Observation,
    RangeDifference,
    RangeDifferences,
)
from swarmctl.feed.message_limits import (
    Refusal,
    arrival_time_refusal,
    range_difference_refusal,
)
from swarmctl.feed.schema import (
    ArrivalTimeMessage,
    RangeDifferenceMessage,
    tdoa_topic,
    toa_topic,
)

_entries_decoder = msgspec.json.Decoder(list[msgspec.Raw])

# msgspec raises the latter where nesting is deeper than the interpreter's stack.
_UNDECODABLE = (msgspec.DecodeError, RecursionError)

_Message = TypeVar("_Message", RangeDifferenceMessage, ArrivalTimeMessage)


class _Decoder(Generic[_Message]):
    """Reads one message or a list of them."""

    def __init__(self, kind: type[_Message], name: str) -> None:
        self._name = name
        batch: Any = kind | list[kind]  # type: ignore[valid-type]
        self._batch: msgspec.json.Decoder[_Message | list[_Message]] = msgspec.json.Decoder(batch)
        self._single: msgspec.json.Decoder[_Message] = msgspec.json.Decoder(kind)

    def decode(self, payload: bytes) -> tuple[list[_Message], list[Refusal]]:
        """The good messages, and why the others are refused."""
        try:
            decoded = self._batch.decode(payload)
        except _UNDECODABLE as error:
            return self._decode_singly(payload, error)
        return (decoded if isinstance(decoded, list) else [decoded]), []

    def _decode_singly(
        self, payload: bytes, error: Exception
    ) -> tuple[list[_Message], list[Refusal]]:
        """The good entries of a list that has bad ones; none if the payload is no list."""
        good: list[_Message] = []
        refusals = []
        try:
            entries = _entries_decoder.decode(payload)
        except _UNDECODABLE:
            return [], [self._refusal(payload, error)]
        for entry in entries:
            try:
                good.append(self._single.decode(entry))
            except _UNDECODABLE as entry_error:
                refusals.append(self._refusal(bytes(entry), entry_error))
        return good, refusals

    def _refusal(self, payload: bytes, error: Exception) -> Refusal:
        if isinstance(error, msgspec.ValidationError):
            return "wrong_schema", f"not {self._name} message of version 1: {error}"
        return "not_json", f"{len(payload)} bytes that are not JSON: {error}"


_range_differences = _Decoder(RangeDifferenceMessage, "a range difference")
_arrival_times = _Decoder(ArrivalTimeMessage, "an arrival time")


class FeedIntake:
    """The receiving end of the topics ``swarm/<swarm>/tdoa`` and ``swarm/<swarm>/toa/<sysid>``.

    Args:
        swarm: Name of the swarm.
        receivers: System ids of the UAVs that carry a receiver, the reference included.

    Attributes:
        topics: What it takes messages from, for a subscription.
        messages_in: Messages received, good or bad.
        range_differences_in: Range differences passed on.
        arrival_times_in: Arrival times passed on.
        rejected: Messages or list entries refused, by kind: ``unexpected_topic``,
            ``not_json``, ``wrong_schema``, ``absurd_value``, ``unknown_receiver``,
            ``unknown_reference``, ``receiver_is_reference``, ``duplicate_receiver``,
            ``mixed_rho``, ``wrong_topic`` (another receiver's).
    """

    def __init__(self, swarm: str, receivers: Collection[int]) -> None:
        self.topics = (tdoa_topic(swarm), toa_topic(swarm, "+"))
        self.messages_in = 0
        self.range_differences_in = 0
        self.arrival_times_in = 0
        self.rejected: Counter[str] = Counter()
        self._swarm = swarm
        self._tdoa_topic = tdoa_topic(swarm)
        self._toa_prefix = toa_topic(swarm, "+").removesuffix("+")
        self._receivers = frozenset(receivers)

    def receive(self, topic: str, payload: bytes, now: float) -> list[Observation]:
        """Take one MQTT message.

        Args:
            topic: Its topic.
            payload: Its bytes: a :class:`RangeDifferenceMessage` or a list of them, or an
                :class:`ArrivalTimeMessage` or a list of them, as the topic says.
            now: Monotonic time of arrival, s.

        Returns:
            One :class:`~swarmctl.events.RangeDifferences` per (epoch, reference) in the
            message or one :class:`~swarmctl.events.ArrivalTime` per arrival time, and an
            :class:`~swarmctl.events.InputRejected` for each kind of fault met for the first
            time. A bad entry of a list does not spoil the others.
        """
        self.messages_in += 1
        if topic == self._tdoa_topic:
            return self._receive_range_differences(payload, now)
        if topic.startswith(self._toa_prefix):
            return self._receive_arrival_times(topic, payload, now)
        out: list[Observation] = []
        refusal = (
            "unexpected_topic",
            f"a message on topic {topic!r}: this topic or {self._toa_prefix}ID is expected",
        )
        self._reject(self._tdoa_topic, refusal, now, out)
        return out

    def _receive_range_differences(self, payload: bytes, now: float) -> list[Observation]:
        out: list[Observation] = []
        messages, refusals = _range_differences.decode(payload)
        groups: dict[tuple[float, int], list[RangeDifferenceMessage]] = {}
        for message in messages:
            key = (message.epoch_utc_s, message.reference)
            refusal = range_difference_refusal(message, self._receivers, groups.get(key, ()))
            if refusal is not None:
                refusals.append(refusal)
                continue
            groups.setdefault(key, []).append(message)
        for refusal in refusals:
            self._reject(self._tdoa_topic, refusal, now, out)
        for (epoch_utc_s, reference), members in groups.items():
            self.range_differences_in += len(members)
            out.append(
                RangeDifferences(
                    received_s=now,
                    epoch_utc_s=epoch_utc_s,
                    reference=reference,
                    items=tuple([RangeDifference(m.receiver, m.rd_m, m.sigma_m) for m in members]),
                    rho=members[0].rho,
                    clock_sigma_s=max([m.clock_sigma_s for m in members]),
                    seq=members[0].seq,
                )
            )
        return out

    def _receive_arrival_times(self, topic: str, payload: bytes, now: float) -> list[Observation]:
        out: list[Observation] = []
        messages, refusals = _arrival_times.decode(payload)
        for message in messages:
            refusal = arrival_time_refusal(message, self._receivers, self._swarm, topic)
            if refusal is not None:
                refusals.append(refusal)
                continue
            self.arrival_times_in += 1
            out.append(
                ArrivalTime(
                    received_s=now,
                    receiver=message.receiver,
                    toa_s=message.toa_s,
                    toa_frac_s=message.toa_frac_s,
                    burst=message.burst,
                    sigma_s=message.sigma_s,
                    clock_sigma_s=message.clock_sigma_s,
                    seq=message.seq,
                )
            )
        for refusal in refusals:
            self._reject(topic, refusal, now, out)
        return out

    def _reject(self, topic: str, refusal: Refusal, now: float, out: list[Observation]) -> None:
        kind, detail = refusal
        self.rejected[kind] += 1
        if self.rejected[kind] == 1:
            out.append(
                InputRejected(
                    received_s=now, source="feed", kind=kind, detail=f"{topic}: {detail}."
                )
            )
