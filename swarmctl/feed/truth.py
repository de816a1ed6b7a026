"""The simulator's truth, for the recorder alone: nothing that flies reads it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec

from swarmctl.events import EmitterTruth, ReceiverTruth
from swarmctl.feed.message_limits import MAX_CLOCK_SIGMA_S, MAX_EPOCH_UTC_S, MAX_LENGTH_M
from swarmctl.feed.schema import (
    ReceiverTruthMessage,
    TruthMessage,
    receivers_truth_topic,
    truth_topic,
)
from swarmctl.units import SPEED_OF_LIGHT_MPS

_emitter_decoder = msgspec.json.Decoder(TruthMessage)
_receivers_decoder = msgspec.json.Decoder(list[ReceiverTruthMessage])

# msgspec raises the latter where nesting is deeper than the interpreter's stack.
_UNDECODABLE = (msgspec.DecodeError, RecursionError)


class TruthIntake:
    """The receiving end of the topics under ``swarm/<swarm>/truth``.

    Args:
        swarm: Name of the swarm.

    Attributes:
        topics: What it takes messages from, for a subscription.
    """

    def __init__(self, swarm: str) -> None:
        self._receivers_topic = receivers_truth_topic(swarm)
        self.topics = (truth_topic(swarm), self._receivers_topic)

    def receive(
        self, topic: str, payload: bytes, now: float
    ) -> Sequence[EmitterTruth | ReceiverTruth]:
        """Take one MQTT message; nothing comes of one that is not the truth.

        Args:
            topic: One of ``topics``.
            payload: A :class:`~swarmctl.feed.schema.TruthMessage`, or a list of
                :class:`~swarmctl.feed.schema.ReceiverTruthMessage`, as the topic says.
            now: Monotonic time of arrival, s.
        """
        if topic == self._receivers_topic:
            return decode_receivers_truth(payload, now)
        truth = decode_truth(payload, now)
        return [] if truth is None else [truth]


def decode_truth(payload: bytes, now: float) -> EmitterTruth | None:
    """The true state of the emitter.

    Args:
        payload: A :class:`~swarmctl.feed.schema.TruthMessage`.
        now: Monotonic time of arrival, s.

    Returns:
        The truth; None if the payload is anything else, or a place nowhere near the earth.
    """
    try:
        message = _emitter_decoder.decode(payload)
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
    """The true errors of the receivers.

    Args:
        payload: A list of :class:`~swarmctl.feed.schema.ReceiverTruthMessage`.
        now: Monotonic time of arrival, s.

    Returns:
        The truth of each receiver, except absurd ones; nothing if the payload is anything else.
    """
    try:
        messages = _receivers_decoder.decode(payload)
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
