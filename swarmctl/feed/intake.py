"""From MQTT payloads to observations: decode, check, group. No I/O.

Whatever arrives, :meth:`FeedIntake.receive` does not raise: a message that cannot be used is
reported once per kind and then only counted.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection

import msgspec

from swarmctl.events import (
    EmitterTruth,
    InputRejected,
    Observation,
    RangeDifference,
    RangeDifferences,
)
from swarmctl.feed.schema import RangeDifferenceMessage, TruthMessage, tdoa_topic

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

_batch_decoder = msgspec.json.Decoder(RangeDifferenceMessage | list[RangeDifferenceMessage])
_entries_decoder = msgspec.json.Decoder(list[msgspec.Raw])
_message_decoder = msgspec.json.Decoder(RangeDifferenceMessage)
_truth_decoder = msgspec.json.Decoder(TruthMessage)

# msgspec meets nesting deeper than the interpreter's stack with the latter.
_UNDECODABLE = (msgspec.DecodeError, RecursionError)


class FeedIntake:
    """The receiving end of the topic ``swarm/<swarm>/tdoa``.

    Args:
        swarm: Name of the swarm.
        receivers: System ids of the UAVs that carry a receiver, the reference included.

    Attributes:
        topic: The topic it takes messages from.
        messages_in: Messages received, good or bad.
        range_differences_in: Range differences passed on.
        rejected: Messages or list entries refused, by kind: ``unexpected_topic``,
            ``not_json``, ``wrong_schema``, ``absurd_value``, ``unknown_receiver``,
            ``unknown_reference``, ``receiver_is_reference``, ``duplicate_receiver``,
            ``mixed_rho``.
    """

    def __init__(self, swarm: str, receivers: Collection[int]) -> None:
        self.topic = tdoa_topic(swarm)
        self.messages_in = 0
        self.range_differences_in = 0
        self.rejected: Counter[str] = Counter()
        self._receivers = frozenset(receivers)

    def receive(self, topic: str, payload: bytes, now: float) -> list[Observation]:
        """Take one MQTT message.

        Args:
            topic: Its topic.
            payload: Its bytes: a :class:`RangeDifferenceMessage` or a list of them.
            now: Monotonic time of arrival, s.

        Returns:
            One :class:`~swarmctl.events.RangeDifferences` per (epoch, reference) in the
            message, and an :class:`~swarmctl.events.InputRejected` for each kind of fault
            met for the first time. A bad entry of a list does not spoil the others.
        """
        self.messages_in += 1
        out: list[Observation] = []
        if topic != self.topic:
            fault = ("unexpected_topic", f"a message on topic {topic!r}: expected {self.topic!r}")
            self._reject(fault, now, out)
            return out
        groups: dict[tuple[float, int], list[RangeDifferenceMessage]] = {}
        for message in self._decode(payload, now, out):
            fault_found = self._fault(message, groups)
            if fault_found is not None:
                self._reject(fault_found, now, out)
                continue
            groups.setdefault((message.epoch_utc_s, message.reference), []).append(message)
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

    def _decode(
        self, payload: bytes, now: float, out: list[Observation]
    ) -> list[RangeDifferenceMessage]:
        try:
            decoded = _batch_decoder.decode(payload)
        except _UNDECODABLE as error:
            return self._decode_singly(payload, error, now, out)
        return decoded if isinstance(decoded, list) else [decoded]

    def _decode_singly(
        self, payload: bytes, error: Exception, now: float, out: list[Observation]
    ) -> list[RangeDifferenceMessage]:
        """The good entries of a list that has bad ones; nothing of anything else."""
        try:
            entries = _entries_decoder.decode(payload)
        except _UNDECODABLE:
            self._reject(_decoding_fault(payload, error), now, out)
            return []
        good = []
        for entry in entries:
            try:
                good.append(_message_decoder.decode(entry))
            except _UNDECODABLE as entry_error:
                self._reject(_decoding_fault(bytes(entry), entry_error), now, out)
        return good

    def _fault(
        self,
        message: RangeDifferenceMessage,
        groups: dict[tuple[float, int], list[RangeDifferenceMessage]],
    ) -> tuple[str, str] | None:
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

    def _reject(self, fault: tuple[str, str], now: float, out: list[Observation]) -> None:
        kind, detail = fault
        self.rejected[kind] += 1
        if self.rejected[kind] == 1:
            out.append(
                InputRejected(
                    received_s=now, source="feed", kind=kind, detail=f"{self.topic}: {detail}."
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


def _decoding_fault(payload: bytes, error: Exception) -> tuple[str, str]:
    if isinstance(error, msgspec.ValidationError):
        return "wrong_schema", f"not a range difference message of version 1: {error}"
    return "not_json", f"{len(payload)} bytes that are not JSON: {error}"
