"""Why a mission ends early."""

from __future__ import annotations

from dataclasses import dataclass

from swarmctl.results import MissionResult


@dataclass(frozen=True)
class Failure:
    """Why a mission ends early.

    Attributes:
        result: The result the mission ends with.
        detail: A sentence for the operator, without full stop.
        sysid: System id of the vehicle, if one vehicle is at fault.
    """

    result: MissionResult
    detail: str
    sysid: int | None = None
