"""What a rule about a vehicle's parameter may say, and the kinds of rules the tables are made of.

A rule looks at the value of one parameter and answers :class:`Ok`, :class:`SetTo` or
:class:`OperatorDecides`. Its :class:`RuleClass` says what follows from an answer other than Ok.
Parameters go by their newest names and units; the link knows the older ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum, auto


@dataclass(frozen=True)
class Demands:
    """What a mission asks of a vehicle.

    Attributes:
        gcs_sysid: This controller's own system id.
        speed_mps: Greatest ground speed commanded, m/s.
        acceleration_mps2: Greatest acceleration commanded, m/s².
        height_m: Height it flies at above its home, m.
        reach_m: Greatest horizontal distance from its home, m.
        is_fenced: Whether the mission uploads a fence to it.
    """

    gcs_sysid: int
    speed_mps: float
    acceleration_mps2: float
    height_m: float
    reach_m: float
    is_fenced: bool


@dataclass(frozen=True)
class Ok:
    """The parameter is right as it is."""


@dataclass(frozen=True)
class SetTo:
    """The parameter is not right, and one value would be.

    Attributes:
        value: The right value.
        why: What the vehicle does with the right value, as a clause.
    """

    value: float
    why: str


@dataclass(frozen=True)
class OperatorDecides:
    """The parameter is not right, and only the operator can tell what would be.

    Attributes:
        why: What is wrong, as a clause that follows the value.
    """

    why: str


Verdict = Ok | SetTo | OperatorDecides


class RuleClass(Enum):
    """What follows from a parameter that is not right."""

    REQUIRED = auto()
    """swarmctl sets it if the operator consents; otherwise nothing is started."""
    OPERATOR_ONLY = auto()
    """Nothing is started: the parameter bounds the flight, and only the operator may widen it."""
    RECOMMENDED = auto()
    """swarmctl sets it if the operator consents; otherwise it warns and flies."""
    REPORT_ONLY = auto()
    """swarmctl warns and flies: what is right is not for it to decide."""


Values = Mapping[str, float]
"""Every value that the vehicle has told, by parameter."""
Check = Callable[[float, Values, Demands], Verdict]
"""Judges a value, given all that the vehicle has told and what the mission asks of it."""


@dataclass(frozen=True)
class Rule:
    """What one parameter should be.

    Attributes:
        parameter: Its name.
        check: Judges its value.
        rule_class: What follows if it is not right.
        needs: Other parameters that ``check`` looks at.
        optional: Whether some firmware lacks it or what it needs, and is right without.
    """

    parameter: str
    check: Check
    rule_class: RuleClass = RuleClass.REQUIRED
    needs: tuple[str, ...] = ()
    optional: bool = False


# --- Kinds of rules that know the right value ------------------------------------------


def always(right: float, why: str) -> Check:
    """One value only is right."""
    return lambda value, others, demands: Ok() if value == right else SetTo(right, why)


def one_of(allowed: set[float], right: float, why: str) -> Check:
    """Some values are right; ``right`` is set in place of any other."""
    return lambda value, others, demands: Ok() if value in allowed else SetTo(right, why)


def within(least: float, greatest: float, right: float, why: str) -> Check:
    """A range is right; ``right`` is set in place of a value outside it."""
    return lambda value, others, demands: Ok() if least <= value <= greatest else SetTo(right, why)


def not_positive(why: str) -> Check:
    """Zero and below are right."""
    return lambda value, others, demands: Ok() if value <= 0.0 else SetTo(0.0, why)


def our_sysid(why: str) -> Check:
    """This controller's system id is right."""

    def check(value: float, _others: Values, demands: Demands) -> Verdict:
        right = float(demands.gcs_sysid)
        return Ok() if value == right else SetTo(right, why)

    return check


def at_least(needed: Callable[[Demands], float], why: str) -> Check:
    """What the mission needs, or more, is right."""

    def check(value: float, _others: Values, demands: Demands) -> Verdict:
        least = needed(demands)
        # The value may have been rounded to a 32-bit float in another unit.
        is_enough = value >= least * (1.0 - 1e-6)
        return Ok() if is_enough else SetTo(float(math.ceil(least)), why)

    return check


def without_bits(bits: int, why: str) -> Check:
    """A bit mask without some bits is right."""

    def check(value: float, _others: Values, _demands: Demands) -> Verdict:
        right = float(as_bits(value) & ~bits)
        return Ok() if value == right else SetTo(right, why)

    return check


def with_bits(bits: int, why: str, *, unless: tuple[str, float]) -> Check:
    """A bit mask with some bits is right, or any while another parameter has a certain value."""
    name, excused = unless

    def check(value: float, others: Values, _demands: Demands) -> Verdict:
        right = float(as_bits(value) | bits)
        return Ok() if value == right or others.get(name) == excused else SetTo(right, why)

    return check


# --- Kinds of rules where the operator decides -----------------------------------------


def positive_or(other: str, why: str) -> Check:
    """A value above zero is right, or any while another parameter is above zero."""

    def check(value: float, others: Values, _demands: Demands) -> Verdict:
        is_set = value > 0.0 or others.get(other, 0.0) > 0.0
        return Ok() if is_set else OperatorDecides(why)

    return check


def as_bits(value: float) -> int:
    """A parameter that is a bit mask, as a whole number; 0 if it cannot be one."""
    return int(value) if math.isfinite(value) and value >= 0.0 else 0
