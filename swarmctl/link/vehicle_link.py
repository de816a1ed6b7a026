"""The vehicles of a swarm as a station sees them: observations in, commands out, one timer.

:class:`swarmctl.link.mavlink_link.MavlinkLink` speaks MAVLink itself;
:class:`swarmctl.link.mavsdk_link.MavsdkLink` lets MAVSDK do so. What they share is in
:mod:`swarmctl.link.link_base`.
"""

from __future__ import annotations

from collections import Counter
from typing import Protocol

from swarmctl.commands import Command
from swarmctl.events import Observation


class VehicleLink(Protocol):
    """The vehicles of a swarm as observations and commands.

    The caller calls :meth:`handle_timer` when :meth:`next_timer` is due, and drains
    :meth:`events` after every call. All times are monotonic seconds and must not run backwards.

    Attributes:
        messages_in: Messages received from the vehicles.
        setpoints_out: Setpoints sent.
        setpoints_dropped: Setpoints not sent: the vehicle is unknown, is of an unknown kind or
            is not the vehicle it was, or a field is not finite or is no place on Earth.
        rejected: How often each kind of fault was met. An InputRejected names the first of each
            kind.
    """

    messages_in: int
    setpoints_out: int
    setpoints_dropped: int
    rejected: Counter[str]

    def send(self, command: Command, now: float) -> None:
        """Send a command, or queue it behind those that its vehicle has not acknowledged yet.

        Every command ends in one CommandOutcome, with three exceptions. A command that repeats
        one which still waits or is under way shares its outcome. ReadParameter and
        WriteParameter end in a ParameterValue. GoTo leaves at once; if it cannot, it is dropped
        and counted in ``setpoints_dropped``.
        """

    def handle_timer(self, now: float) -> None:
        """Do what is due: heartbeats, reports of link quality, retries."""

    def next_timer(self) -> float:
        """When :meth:`handle_timer` is due; infinity if nothing is."""

    def events(self) -> list[Observation]:
        """Drain the observations, oldest first."""
