"""Every exception swarmctl raises on purpose, in one tree.

::

    SwarmError                     exit code 3 unless a subclass says otherwise
    ├── MissionFileError           exit code 2: the mission file is wrong; lists every fault
    ├── UsageError                 exit code 2: an argument is wrong
    ├── EstimationError            an array of the wrong shape, a non-positive sigma, ...
    ├── FormationError             exit code 2: no formation satisfies the constraints
    ├── LinkError                  a port in use, a device that is not there, ...
    ├── FeedError                  a broker that refuses or cannot be reached
    └── SimulationError            a simulation cannot be set up or served

A message is one or more whole sentences: what is wrong, where, and what would be right.
The command line prints it without a traceback and exits with ``exit_code``.
"""

from __future__ import annotations

from dataclasses import dataclass


class SwarmError(Exception):
    """Base of all errors a user can cause or meet."""

    exit_code = 3


class UsageError(SwarmError):
    """An argument of a command or a function is not usable."""

    exit_code = 2


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong in a mission file.

    Attributes:
        field: Dotted path of the field, for example ``limits.d_max_m``.
        value: The value found there, as text.
        allowed: What would be right.
    """

    field: str
    value: str
    allowed: str

    def __str__(self) -> str:
        return f"{self.field} is {self.value}: {self.allowed}"


class MissionFileError(SwarmError):
    """A mission file has one or more faults; all are listed in ``faults``."""

    exit_code = 2

    def __init__(self, path: str, faults: tuple[Fault, ...]) -> None:
        self.path = path
        self.faults = faults
        lines = "\n".join(f"  {fault}" for fault in faults)
        count = "1 fault" if len(faults) == 1 else f"{len(faults)} faults"
        super().__init__(f"{path}: {count}\n{lines}")


class EstimationError(SwarmError):
    """An estimator was given something it cannot use; the message names the argument."""


class FormationError(SwarmError):
    """No formation satisfies the constraints; the message names the numbers."""

    exit_code = 2


class LinkError(SwarmError):
    """A MAVLink endpoint cannot be opened or used."""


class FeedError(SwarmError):
    """The measurement feed's broker cannot be reached or refuses."""


class SimulationError(SwarmError):
    """A simulation cannot be set up or served."""
