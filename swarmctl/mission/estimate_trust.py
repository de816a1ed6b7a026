"""What an estimate of some health is good for."""

from __future__ import annotations

import math
from dataclasses import replace
from enum import Enum, auto

from swarmctl.estimation.integrity.health import Status
from swarmctl.mission.target import Target


class Trust(Enum):
    """How far guidance relies on the estimate.

    * ``FULL``: it leads, and the formation is designed for it.
    * ``LITTLE``: it leads; the design stays what it is.
    * ``NONE``: the swarm holds where it is until there is a track again.
    """

    FULL = auto()
    LITTLE = auto()
    NONE = auto()


class Reliance:
    """What guidance relies on, by the track's health.

    A track that has not begun yet is the mission's prior, and that leads. One that was lost and
    is sought again is not: until it is found, what was believed last bounds the swarm.

    Attributes:
        trust: In the estimate of now.
        target: The estimate that guidance gets.
    """

    def __init__(self, target: Target) -> None:
        self.trust = Trust.FULL
        self.target = target

    def review(self, target: Target, status: Status, *, restarted: bool) -> None:
        """Take the estimate of now.

        Args:
            target: The estimate.
            status: Its health.
            restarted: Whether the track was lost before.
        """
        if status == "diverged" or (status == "initialising" and restarted):
            self.trust = Trust.NONE
            # Nobody knows where it drifts now, so nobody is led by it.
            self.target = replace(self.target, speed_sigma_mps=math.inf)
            return
        self.trust = Trust.LITTLE if status == "degraded" else Trust.FULL
        self.target = target
