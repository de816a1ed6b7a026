"""What a flight mode is; each autopilot has its own table (``ardupilot_modes``, ``px4_modes``)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sim.autopilots.flight_tasks import Hold, Task
from sim.autopilots.parameters import Parameters
from sim.autopilots.takeoff_and_landing import Descend, sink


@dataclass(frozen=True)
class FlightMode:
    """One flight mode.

    Attributes:
        number: ``custom_mode`` of HEARTBEAT.
        name: The autopilot's name for it.
        can_arm: Whether arming is allowed in it.
        base_mode: ``base_mode`` of HEARTBEAT, disarmed.
        task: Gives the task that it starts with, from the parameters.
    """

    number: int
    name: str
    can_arm: bool
    base_mode: int
    task: Callable[[Parameters], Task]


def hold(_parameters: Parameters) -> Hold:
    """The task of a mode that keeps its place."""
    return Hold()


def sinking(rate_mps: float) -> Callable[[Parameters], Descend]:
    """The task of a mode that a pilot would fly: without one the vehicle sinks."""
    return lambda _parameters: sink(rate_mps)
