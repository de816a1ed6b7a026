"""A command in the words of an autopilot: what to send, and what shows that it is done."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from swarmctl.events import CommandKind, Heartbeat, LandedState
from swarmctl.link.codec.messages import CommandLong, DataStream

State = Heartbeat | LandedState


class Request(msgspec.Struct, frozen=True):
    """A command as its autopilot wants to be asked.

    Attributes:
        kind: The kind of the command.
        steps: What to send; each step is acknowledged before the next leaves.
        shown_by: Whether a state heard after the last step left shows the command done; None if
            no state shows it.
        needs_state: Whether the state must show the command done, because the ACK is not enough.
        optional: What to send after the steps; the vehicle may refuse it.
        instead: For each step, what to send if the vehicle refuses it or does not answer; None
            for nothing. Only the vehicle's later messages show whether that helped. Empty if a
            refusal ends the request.
    """

    kind: CommandKind
    steps: tuple[CommandLong, ...]
    shown_by: Callable[[State], bool] | None = None
    needs_state: bool = False
    optional: tuple[CommandLong, ...] = ()
    instead: tuple[CommandLong | DataStream | None, ...] = ()


class Attempt(msgspec.Struct, frozen=True):
    """A command to send, and how many times it was sent before."""

    command: CommandLong | DataStream
    confirmation: int
