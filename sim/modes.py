"""What a flight mode is; each personality has a table of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sim.guidance import Task
from sim.parameters import Parameters


@dataclass(frozen=True)
class FlightMode:
    """One flight mode.

    Attributes:
        number: ``custom_mode`` of HEARTBEAT.
        name: The autopilot's name for it.
        can_arm: Whether arming is allowed in it.
        base_mode: ``base_mode`` of HEARTBEAT, disarmed.
        task: What the vehicle does on entering it in the air, by its parameters.
    """

    number: int
    name: str
    can_arm: bool
    base_mode: int
    task: Callable[[Parameters], Task]
