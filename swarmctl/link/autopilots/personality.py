"""The interface of a flight stack; the modules ``ardupilot`` and ``px4`` have it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from swarmctl.commands import Command
from swarmctl.events import Mode
from swarmctl.link.autopilots import ardupilot, px4
from swarmctl.link.codec.messages import Spelling
from swarmctl.link.command_request import Request


class Personality(Protocol):
    """A flight stack, as the link needs to know it.

    Attributes:
        NAME: Its name, for a person.
        GUIDED_BY_STREAM: Whether its guided mode needs a stream of setpoints, as Heartbeat says.
        BYTEWISE_PARAMETERS: Whether a whole-numbered parameter travels as the bytes of an
            integer in the float field, instead of as a float of its value.
    """

    NAME: str
    GUIDED_BY_STREAM: bool
    BYTEWISE_PARAMETERS: bool

    def mode_of(self, custom_mode: int, /) -> tuple[Mode, str]:
        """Mode and name of a HEARTBEAT's ``custom_mode``."""

    def request_for(self, command: Command, home_alt_amsl_m: float | None, /) -> Request | str:
        """The request for a command; or, if the vehicle cannot be asked for it, why not.

        Args:
            command: The command.
            home_alt_amsl_m: Altitude of the vehicle's home, m; None while it is not known.
        """

    def spellings(self, parameter: str, /) -> tuple[Spelling, ...]:
        """Every name that a parameter has had, the newest first."""

    def after_controller_stops(
        self, mode: Mode, armed: bool, parameters: Mapping[str, float], /
    ) -> str:
        """What the vehicle does by itself when no more setpoints come, as a predicate.

        Args:
            mode: Its mode at that moment.
            armed: Whether it is armed.
            parameters: What is known of its parameters, by their newest names.

        Returns:
            For example ``"lands where it is and disarms"``.
        """


PERSONALITIES: dict[str, Personality] = {"ardupilot": ardupilot, "px4": px4}
"""The flight stacks, by the name that Heartbeat gives the autopilot."""
