"""Why a mission ends early."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Failure:
    """Why a mission ends early.

    Attributes:
        result: Name of the result, as the mission's end and the exit code know it.
        detail: A sentence for the operator, without full stop.
        sysid: System id of the vehicle, if one vehicle is at fault.
    """

    result: str
    detail: str
    sysid: int | None = None
