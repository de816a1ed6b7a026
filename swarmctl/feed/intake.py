"""From MQTT payloads to observations: decode, check, group. No I/O.

Whatever arrives, :meth:`FeedIntake.receive` does not raise: a message that cannot be used is
reported once per kind and then only counted.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection
from typing import Any, Generic, TypeVar

import msgspec

from swarmctl.events import (
    ArrivalTime,
    EmitterTruth,
    InputRejected,
    Observation,
    RangeDifference,
    RangeDifferences,
    ReceiverTruth,
)
from swarmctl.feed.schema import (
    ArrivalTimeMessage,
    RangeDifferenceMessage,
    ReceiverTruthMessage,
    TruthMessage,
    tdoa_topic,
    toa_topic,
)
from swarmctl.units import SPEED_OF_LIGHT_MPS

MAX_LENGTH_M = 1e6
"""No range difference and no sigma is larger: a radio horizon is a few hundred kilometres."""
MIN_SIGMA_M = 1e-3
"""No receiver is better than 3 ps; a smaller variance would make a filter's gain singular."""
MAX_CLOCK_SIGMA_S = 1e-2
"""Clocks this far apart (3000 km) measure nothing."""
MAX_EPOCH_UTC_S = 1e10
"""The year 2286: milliseconds or nanoseconds given for seconds are larger."""
MAX_SEQ = 2**63 - 1
"""A larger number could not be recorded."""

_MIN_SIGMA_S = MIN_SIGMA_M / SPEED_OF_LIGHT_MPS
_MAX_SIGMA_S = MAX_LENGTH_M / SPEED_OF_LIGHT_MPS

_entries_decoder = msgspec.json.Decoder(list[msgspec.Raw])
_truth_decoder = msgspec.json.Decoder(TruthMessage)
_receivers_truth_decoder = msgspec.json.Decoder(list[ReceiverTruthMessage])

# msgspec meets nesting deeper than the interpreter's stack with the latter.
_UNDECODABLE = (msgspec.DecodeError, RecursionError)

_Fault = tuple[str, str]
"""Kind and sentence."""
_Message = TypeVar("_Message", RangeDifferenceMessage, ArrivalTimeMessage)


class _Decoder(Generic[_Message]):
    """Reads one message or a list of them."""

    def __init__(self, kind: type[_Message], name: str) -> None:
        self._name = name
        batch: Any = kind | list[kind]  # type: ignore[valid-type]
        self._batch: msgspec.json.Decoder[_Message | list[_Message]] = msgspec.json.Decoder(batch)
        self._single: msgspec.json.Decoder[_Message] = msgspec.json.Decoder(kind)

    def decode(self, payload: bytes) -> tuple[list[_Message], list[_Fault]]:
        """The good messages, and what is wrong with the others."""
        try:
            decoded = self._batch.decode(payload)
        except _UNDECODABLE as error:
            return self._decode_singly(payload, error)
        return (decoded if isinstance(decoded, list) else [decoded]), []

    def _decode_singly(
        self, payload: bytes, error: Exception
    ) -> tuple[list[_Message], list[_Fault]]:
        """The good entries of a list that has bad ones; nothing of anything else."""
        good: list[_Message] = []
        faults = []
        try:
            entries = _entries_decoder.decode(payload)
        except _UNDECODABLE:
            return [], [self._fault(payload, error)]
        for entry in entries:
            try:
                good.append(self._single.decode(entry))
            except _UNDECODABLE as entry_error:
                faults.append(self._fault(bytes(entry), entry_error))
        return good, faults

    def _fault(self, payload: bytes, error: Exception) -> _Fault:
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
        fault = (
            "unexpected_topic",
            f"a message on topic {topic!r}: this topic or {self._toa_prefix}ID is expected",
        )
        self._reject(self._tdoa_topic, fault, now, out)
        return out

    def _receive_range_differences(self, payload: bytes, now: float) -> list[Observation]:
        out: list[Observation] = []
        messages, faults = _range_differences.decode(payload)
        groups: dict[tuple[float, int], list[RangeDifferenceMessage]] = {}
        for message in messages:
            fault = self._fault(message, groups)
            if fault is not None:
                faults.append(fault)
                continue
            groups.setdefault((message.epoch_utc_s, message.reference), []).append(message)
        for fault in faults:
            self._reject(self._tdoa_topic, fault, now, out)
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
        messages, faults = _arrival_times.decode(payload)
        for message in messages:
            fault = self._arrival_fault(topic, message)
            if fault is not None:
                faults.append(fault)
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
        for fault in faults:
            self._reject(topic, fault, now, out)
        return out

    def _arrival_fault(self, topic: str, message: ArrivalTimeMessage) -> _Fault | None:
        receiver = message.receiver
        expected = toa_topic(self._swarm, receiver)
        if topic != expected:
            return "wrong_topic", (
                f"an arrival time at receiver {receiver}: its topic would be {expected}"
            )
        if receiver not in self._receivers:
            return "unknown_receiver", self._unknown("receiver", receiver)
        if not (
            message.toa_s <= MAX_EPOCH_UTC_S
            and _MIN_SIGMA_S <= message.sigma_s <= _MAX_SIGMA_S
            and message.clock_sigma_s <= MAX_CLOCK_SIGMA_S
            and message.burst <= MAX_SEQ
            and message.seq <= MAX_SEQ
        ):
            return "absurd_value", (
                f"receiver {receiver} sent toa_s {message.toa_s:g}, sigma_s {message.sigma_s:g}, "
                f"clock_sigma_s {message.clock_sigma_s:g}: UTC seconds up to "
                f"{MAX_EPOCH_UTC_S:g}, sigma_s from {_MIN_SIGMA_S:.1g} to {_MAX_SIGMA_S:.1g}, "
                f"clocks within {MAX_CLOCK_SIGMA_S:g} s and a 64-bit burst and seq are taken"
            )
        return None

    def _fault(
        self,
        message: RangeDifferenceMessage,
        groups: dict[tuple[float, int], list[RangeDifferenceMessage]],
    ) -> _Fault | None:
        receiver, reference = message.receiver, message.reference
        if not (
            abs(message.rd_m) <= MAX_LENGTH_M
            and MIN_SIGMA_M <= message.sigma_m <= MAX_LENGTH_M
            and message.clock_sigma_s <= MAX_CLOCK_SIGMA_S
            and 0.0 <= message.epoch_utc_s <= MAX_EPOCH_UTC_S
            and message.seq <= MAX_SEQ
        ):
            return "absurd_value", (
                f"receiver {receiver} sent rd_m {message.rd_m:g}, sigma_m {message.sigma_m:g}, "
                f"clock_sigma_s {message.clock_sigma_s:g}, epoch_utc_s {message.epoch_utc_s:g}: "
                f"metres up to {MAX_LENGTH_M:g}, sigma_m from {MIN_SIGMA_M:g}, clocks within "
                f"{MAX_CLOCK_SIGMA_S:g} s, UTC seconds up to {MAX_EPOCH_UTC_S:g} and a 64-bit "
                "seq are taken"
            )
        if receiver not in self._receivers:
            return "unknown_receiver", self._unknown("receiver", receiver)
        if reference not in self._receivers:
            return "unknown_reference", self._unknown("reference", reference)
        if receiver == reference:
            return "receiver_is_reference", (
                f"receiver {receiver} sent a range difference against itself: the reference "
                "must be another receiver"
            )
        group = groups.get((message.epoch_utc_s, reference), [])
        if any(other.receiver == receiver for other in group):
            return "duplicate_receiver", (
                f"receiver {receiver} comes twice at epoch {message.epoch_utc_s:.3f}: the first "
                "was taken"
            )
        if group and message.rho != group[0].rho:
            return "mixed_rho", (
                f"receiver {receiver} gives rho {message.rho:g} where receiver "
                f"{group[0].receiver} gives {group[0].rho:g} at the same epoch: one epoch has "
                "one rho"
            )
        return None

    def _unknown(self, role: str, sysid: int) -> str:
        known = ", ".join(str(i) for i in sorted(self._receivers))
        return f"{role} {sysid} is not of this swarm: its receivers are {known}"

    def _reject(self, topic: str, fault: _Fault, now: float, out: list[Observation]) -> None:
        kind, detail = fault
        self.rejected[kind] += 1
        if self.rejected[kind] == 1:
            out.append(
                InputRejected(
                    received_s=now, source="feed", kind=kind, detail=f"{topic}: {detail}."
                )
            )


def decode_truth(payload: bytes, now: float) -> EmitterTruth | None:
    """The simulator's truth, for the recorder's own subscription.

    Args:
        payload: A :class:`~swarmctl.feed.schema.TruthMessage`.
        now: Monotonic time of arrival, s.

    Returns:
        The truth; None if the payload is anything else, or nowhere near the earth.
    """
    try:
        message = _truth_decoder.decode(payload)
    except _UNDECODABLE:
        return None
    if not (
        0.0 <= message.epoch_utc_s <= MAX_EPOCH_UTC_S
        and abs(message.lat_deg) <= 90.0
        and abs(message.lon_deg) <= 360.0
        and abs(message.alt_amsl_m) <= MAX_LENGTH_M
        and max(map(abs, message.velocity_enu)) <= MAX_LENGTH_M
    ):
        return None
    return EmitterTruth(
        received_s=now,
        epoch_utc_s=message.epoch_utc_s,
        lat_rad=math.radians(message.lat_deg),
        lon_rad=math.radians(message.lon_deg),
        alt_amsl_m=message.alt_amsl_m,
        velocity_enu=message.velocity_enu,
    )


def decode_receivers_truth(payload: bytes, now: float) -> list[ReceiverTruth]:
    """The simulator's truth about the receivers, for the recorder's own subscription.

    Args:
        payload: A list of :class:`~swarmctl.feed.schema.ReceiverTruthMessage`.
        now: Monotonic time of arrival, s.

    Returns:
        The truth of each; none if the payload is anything else, and without what is absurd.
    """
    try:
        messages = _receivers_truth_decoder.decode(payload)
    except _UNDECODABLE:
        return []
    return [
        ReceiverTruth(
            received_s=now,
            epoch_utc_s=message.epoch_utc_s,
            receiver=message.receiver,
            clock_m=message.clock_m,
            drift_mps=message.drift_mps,
            navigation_enu=message.navigation_enu,
        )
        for message in messages
        if 0.0 <= message.epoch_utc_s <= MAX_EPOCH_UTC_S
        and abs(message.clock_m) <= SPEED_OF_LIGHT_MPS * MAX_CLOCK_SIGMA_S
        and max(map(abs, (message.drift_mps, *message.navigation_enu))) <= MAX_LENGTH_M
    ]
