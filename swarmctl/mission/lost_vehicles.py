"""What happens when a vehicle is lost: the others close up, and one heard again rejoins them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from swarmctl.mission.failure import Failure
from swarmctl.mission.fleet import Fleet, VehicleState
from swarmctl.mission.loss_detection import LossDetection
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.phases import FLYING_FORMATION, Phase
from swarmctl.mission.planner import Planner
from swarmctl.mission.target import Target
from swarmctl.results import MissionResult


class LostVehicles:
    """The vehicles that are lost, and what the formation does without them.

    Args:
        mission: The mission.
        fleet: Its vehicles.
        planner: The planner; it is told who flies.
        losses: Tells which vehicles are lost.

    Attributes:
        failures: Why each lost vehicle is lost, by system id.
    """

    def __init__(
        self, mission: Mission, fleet: Fleet, planner: Planner, losses: LossDetection
    ) -> None:
        self._mission = mission
        self._fleet = fleet
        self._planner = planner
        self._losses = losses
        self.failures: dict[int, Failure] = {}

    @property
    def reference(self) -> int:
        """System id of the reference UAV."""
        return self._mission.swarm.sysids[self._planner.reference]

    def do_without(
        self, failure: Failure, phase: Phase, target: Target, *, rereferences: bool
    ) -> str | None:
        """Let the others close up, if a vehicle is lost and enough companions are left.

        Args:
            failure: The failure that was found.
            phase: The phase.
            target: The estimate now.
            rereferences: Whether the feed still gives range differences if the lost vehicle is the
                reference UAV.

        Returns:
            What to tell the operator; None if the mission cannot do without.
        """
        left = len(self._planner.companions) - 1
        if (
            failure.result is not MissionResult.VEHICLE_LOST
            or failure.sysid is None
            or phase not in FLYING_FORMATION
            or left < self._mission.formation.min_companions
        ):
            return None
        leads = failure.sysid == self.reference
        if leads and not rereferences:
            return None
        self.failures[failure.sysid] = failure
        companions = f"{left} companion{'s' if left > 1 else ''}"
        if leads:
            self._planner.succeed(target)
            return (
                f"{failure.detail}; vehicle {self.reference} is the reference UAV now, with"
                f" {companions}"
            )
        self._planner.drop(self._mission.swarm.sysids.index(failure.sysid))
        return f"{failure.detail}; flying on with {companions}"

    def take_in_again(
        self, utc: float | None, now: float, is_ours: Callable[[VehicleState], bool]
    ) -> list[str]:
        """Take in lost vehicles that are heard and fly on our setpoints again.

        Args:
            utc: UTC now, s; None while it is unknown.
            now: Controller's time, s.
            is_ours: Whether a vehicle flies on our setpoints.

        Returns:
            What to tell the operator.
        """
        sentences = []
        for sysid in list(self.failures):
            vehicle = self._fleet.vehicles[sysid]
            here = vehicle.position_at(utc) if utc is not None else None
            if here is None or self._losses.is_lost(vehicle, now) or not is_ours(vehicle):
                continue
            del self.failures[sysid]
            self._planner.add(self._mission.swarm.sysids.index(sysid), np.array(here[:2]))
            sentences.append(f"vehicle {sysid} is back in the formation")
        return sentences
