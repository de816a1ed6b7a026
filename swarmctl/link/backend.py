"""What a station needs of the vehicles' link, whoever speaks MAVLink underneath."""

from __future__ import annotations

from collections import Counter
from typing import Protocol

from swarmctl.events import Command, Observation


class Backend(Protocol):
    """The vehicles as observations and commands: MavlinkLink or MavsdkLink.

    Attributes:
        messages_in: Messages taken from the vehicles.
        setpoints_out: Setpoints sent.
        setpoints_dropped: Setpoints that could not be sent.
        rejected: How often each kind of fault was met.
    """

    messages_in: int
    setpoints_out: int
    setpoints_dropped: int
    rejected: Counter[str]

    def send(self, command: Command, now: float) -> None:
        """Send a command; what becomes of it is an observation, but for a setpoint."""

    def handle_timer(self, now: float) -> None:
        """Do what is due."""

    def next_timer(self) -> float:
        """When :meth:`handle_timer` is due, monotonic s."""

    def events(self) -> list[Observation]:
        """Drain the observations, oldest first."""
