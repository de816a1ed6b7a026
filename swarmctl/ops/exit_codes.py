"""The exit codes of the command line, and what each means."""

from __future__ import annotations

from swarmctl.results import MissionResult

LOCATED = 0
NOT_LOCATED = 1
BAD_INPUT = 2
FAILED = 3
CANCELLED = 130

MEANING = {
    LOCATED: "the emitter is located and the swarm is home",
    NOT_LOCATED: "the swarm is home, but the emitter is not located within the time limit",
    BAD_INPUT: "an argument or the mission file is wrong; nothing was started",
    FAILED: "something failed (a port, the broker, a vehicle); what was airborne is home",
    CANCELLED: "interrupted by the operator",
}
"""Every exit code of the command line."""


def exit_code(result: MissionResult | None) -> int:
    """Exit code of a mission's result; of None, for a mission that did not end, as well."""
    match result:
        case MissionResult.LOCATED:
            return LOCATED
        case MissionResult.NOT_LOCATED:
            return NOT_LOCATED
        case MissionResult.CANCELLED:
            return CANCELLED
        case _:
            return FAILED
