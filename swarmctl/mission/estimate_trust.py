"""How far guidance trusts an estimate, by the health of its track."""

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


class EstimateTrust:
    """How far guidance relies on the estimate, by the track's health.

    Before the track begins, the estimate is the mission's prior, and that leads. After the track
    is lost the prior does not lead again: until there is a track, the last estimate bounds the
    swarm.

    Args:
        target: The prior.

    Attributes:
        level: How far guidance relies on the latest estimate.
        target: The estimate that guidance gets.
    """

    def __init__(self, target: Target) -> None:
        self.level = Trust.FULL
        self.target = target

    def review(self, target: Target, status: Status, *, restarted: bool) -> None:
        """Take the estimate of now.

        Args:
            target: The estimate.
            status: Its health.
            restarted: Whether the track was lost before.
        """
        if status == "diverged" or (status == "initialising" and restarted):
            self.level = Trust.NONE
            # Nobody knows where it drifts now, so nobody is led by it.
            self.target = replace(self.target, speed_sigma_mps=math.inf)
            return
        self.level = Trust.LITTLE if status == "degraded" else Trust.FULL
        self.target = target
