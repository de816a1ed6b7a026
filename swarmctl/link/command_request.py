"""A command in the words of an autopilot: what to send, and what shows that it is done."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from swarmctl.events import CommandKind, Heartbeat, LandedState
from swarmctl.link.codec.messages import CommandLong, DataStream

State = Heartbeat | LandedState


class Request(msgspec.Struct, frozen=True):
    """A command of the vocabulary, as the vehicle is to be asked.

    Attributes:
        kind: The kind of the command.
        steps: What to send, each acknowledged before the next leaves.
        shown_by: Whether a state, heard after the last step left, shows the command done;
            None where none does.
        needs_state: Whether the ACK is not enough and the state must follow.
        optional: What to send after the steps; the vehicle may refuse any of it.
        instead: For each step, what to send in its place where the vehicle refuses it, or answers
            nothing, None for nothing; whether that helps shows only in what the vehicle then
            says. Empty where a refusal ends the request.
    """

    kind: CommandKind
    steps: tuple[CommandLong, ...]
    shown_by: Callable[[State], bool] | None = None
    needs_state: bool = False
    optional: tuple[CommandLong, ...] = ()
    instead: tuple[CommandLong | DataStream | None, ...] = ()


class Attempt(msgspec.Struct, frozen=True):
    """A packet to send: the command and how many times it was sent before."""

    command: CommandLong | DataStream
    confirmation: int
