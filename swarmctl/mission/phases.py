"""The phases of a mission as a transition table, and the diagram drawn from it.

Two rules: a phase changes only through :func:`next_phase`, and what a phase does is decided by
the phase alone. A failure or the operator's wish to return ends the mission: on the ground at
once, in the air after the swarm has come home.
"""

from __future__ import annotations

from enum import StrEnum


class Phase(StrEnum):
    """What the swarm is doing."""

    WAITING = "waiting"
    CHECKING = "checking"
    LAUNCHING = "launching"
    FORMING = "forming"
    APPROACHING = "approaching"
    ORBITING = "orbiting"
    RETURNING = "returning"
    LANDING = "landing"
    ENDED = "ended"


class Trigger(StrEnum):
    """What moves a mission from one phase to the next."""

    HEARD = "every vehicle heard"
    CHECKED = "every check passed"
    AIRBORNE = "every vehicle at its altitude"
    FORMED = "every follower in its slot"
    AT_RADIUS = "stand-off circle reached"
    OBSERVED = "observation complete"
    FAILED = "something failed"
    CALLED_HOME = "operator asked for the return"
    HOME = "every vehicle above its launch point"
    LANDED = "every vehicle disarmed"


TRANSITIONS: dict[tuple[Phase, Trigger], Phase] = {
    (Phase.WAITING, Trigger.HEARD): Phase.CHECKING,
    (Phase.WAITING, Trigger.FAILED): Phase.ENDED,
    (Phase.WAITING, Trigger.CALLED_HOME): Phase.ENDED,
    (Phase.CHECKING, Trigger.CHECKED): Phase.LAUNCHING,
    (Phase.CHECKING, Trigger.FAILED): Phase.ENDED,
    (Phase.CHECKING, Trigger.CALLED_HOME): Phase.ENDED,
    (Phase.LAUNCHING, Trigger.AIRBORNE): Phase.FORMING,
    (Phase.LAUNCHING, Trigger.FAILED): Phase.RETURNING,
    (Phase.LAUNCHING, Trigger.CALLED_HOME): Phase.RETURNING,
    (Phase.FORMING, Trigger.FORMED): Phase.APPROACHING,
    (Phase.FORMING, Trigger.FAILED): Phase.RETURNING,
    (Phase.FORMING, Trigger.CALLED_HOME): Phase.RETURNING,
    (Phase.APPROACHING, Trigger.AT_RADIUS): Phase.ORBITING,
    (Phase.APPROACHING, Trigger.FAILED): Phase.RETURNING,
    (Phase.APPROACHING, Trigger.CALLED_HOME): Phase.RETURNING,
    (Phase.ORBITING, Trigger.OBSERVED): Phase.RETURNING,
    (Phase.ORBITING, Trigger.FAILED): Phase.RETURNING,
    (Phase.ORBITING, Trigger.CALLED_HOME): Phase.RETURNING,
    (Phase.RETURNING, Trigger.HOME): Phase.LANDING,
    (Phase.LANDING, Trigger.LANDED): Phase.ENDED,
}
"""Every move there is."""

OBSERVING = frozenset({Phase.APPROACHING, Phase.ORBITING})
"""Phases in which the formation is flown and the estimate counts."""

FLYING_FORMATION = frozenset({Phase.FORMING, Phase.APPROACHING, Phase.ORBITING})
"""Phases in which the followers are steered to slots."""


def next_phase(phase: Phase, trigger: Trigger) -> Phase:
    """The phase a trigger leads to.

    Raises:
        ValueError: If the table has no such move.
    """
    try:
        return TRANSITIONS[phase, trigger]
    except KeyError:
        raise ValueError(f"no move from {phase} on {trigger}") from None


def can(phase: Phase, trigger: Trigger) -> bool:
    """Whether the table has a move for the trigger in this phase."""
    return (phase, trigger) in TRANSITIONS


def diagram() -> str:
    """The table as a Mermaid state diagram, for the documentation."""
    lines = ["stateDiagram-v2", f"    [*] --> {Phase.WAITING}"]
    lines += [f"    {a} --> {b}: {trigger}" for (a, trigger), b in TRANSITIONS.items()]
    return "\n".join([*lines, f"    {Phase.ENDED} --> [*]"])
