"""What a message of the feed may hold: limits of each number, and why a message is refused."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from swarmctl.feed.schema import ArrivalTimeMessage, RangeDifferenceMessage, toa_topic
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

Refusal = tuple[str, str]
"""Why a message is refused: a short stable name of the fault, and a sentence."""


def range_difference_refusal(
    message: RangeDifferenceMessage,
    receivers: Collection[int],
    epoch: Sequence[RangeDifferenceMessage],
) -> Refusal | None:
    """Why a range difference is refused; None if it is taken.

    Args:
        message: The range difference.
        receivers: System ids of the UAVs that carry a receiver, the reference included.
        epoch: Range differences taken already at the same epoch against the same reference.
    """
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
    if receiver not in receivers:
        return "unknown_receiver", _unknown("receiver", receiver, receivers)
    if reference not in receivers:
        return "unknown_reference", _unknown("reference", reference, receivers)
    if receiver == reference:
        return "receiver_is_reference", (
            f"receiver {receiver} sent a range difference against itself: the reference "
            "must be another receiver"
        )
    if any(other.receiver == receiver for other in epoch):
        return "duplicate_receiver", (
            f"receiver {receiver} comes twice at epoch {message.epoch_utc_s:.3f}: the first "
            "was taken"
        )
    if epoch and message.rho != epoch[0].rho:
        return "mixed_rho", (
            f"receiver {receiver} gives rho {message.rho:g} where receiver "
            f"{epoch[0].receiver} gives {epoch[0].rho:g} at the same epoch: one epoch has "
            "one rho"
        )
    return None


def arrival_time_refusal(
    message: ArrivalTimeMessage, receivers: Collection[int], swarm: str, topic: str
) -> Refusal | None:
    """Why an arrival time is refused; None if it is taken.

    Args:
        message: The arrival time.
        receivers: System ids of the UAVs that carry a receiver.
        swarm: Name of the swarm.
        topic: The topic it came on.
    """
    receiver = message.receiver
    expected = toa_topic(swarm, receiver)
    if topic != expected:
        return "wrong_topic", (
            f"an arrival time at receiver {receiver}: its topic would be {expected}"
        )
    if receiver not in receivers:
        return "unknown_receiver", _unknown("receiver", receiver, receivers)
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


def _unknown(role: str, sysid: int, receivers: Collection[int]) -> str:
    known = ", ".join(str(i) for i in sorted(receivers))
    return f"{role} {sysid} is not of this swarm: its receivers are {known}"
