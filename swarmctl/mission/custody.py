"""Who flies each vehicle: swarmctl, a pilot who has taken over, or a failsafe of its own."""

from __future__ import annotations

from swarmctl.events import Mode
from swarmctl.mission.failure import Failure
from swarmctl.mission.fleet import Fleet, VehicleState
from swarmctl.results import MissionResult

RESUME_S = 5.0
"""A vehicle that left guided mode on a failsafe may come back to it by itself within this time."""


class Custody:
    """Tells a vehicle that only missed our setpoints from one that we may not command any more.

    Args:
        fleet: The vehicles.

    Attributes:
        released: System ids of the vehicles that are not commanded any more.
    """

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        self._failsafe_since: dict[int, float] = {}
        self.released: set[int] = set()

    def is_ours(self, vehicle: VehicleState, *, raised: bool) -> bool:
        """Whether a vehicle flies on our setpoints, or will as soon as they reach it again.

        Args:
            vehicle: The vehicle.
            raised: Whether setpoints have begun to raise it from the ground.
        """
        if vehicle.sysid in self.released or not vehicle.is_armed:
            return False
        guided = vehicle.is_guided or vehicle.sysid in self._failsafe_since
        return guided and (vehicle.is_airborne or raised)

    def review(self, now: float) -> tuple[list[str], list[Failure]]:
        """Look at every vehicle's mode: what to tell the operator, and who was released."""
        said: list[str] = []
        failures: list[Failure] = []
        for sysid, vehicle in self._fleet.vehicles.items():
            beat = vehicle.heartbeat
            if beat is None or not beat.armed or beat.mode is Mode.GUIDED or sysid in self.released:
                self._failsafe_since.pop(sysid, None)
                continue
            if beat.failsafe and beat.guided_by_stream:
                since = self._failsafe_since.setdefault(sysid, now)
                if now - since <= RESUME_S:
                    said.append(
                        f"vehicle {sysid} is on its failsafe ({beat.mode_name}): it missed our"
                        " setpoints and takes them up again when they reach it"
                    )
                    continue
            self._failsafe_since.pop(sysid, None)
            self.released.add(sysid)
            result = MissionResult.VEHICLE_FAILSAFE if beat.failsafe else MissionResult.TAKEN_OVER
            cause = " on a failsafe of its own" if beat.failsafe else ""
            failures.append(
                Failure(
                    result,
                    f"vehicle {sysid} left guided mode for {beat.mode_name}{cause}: it is no"
                    " longer commanded",
                )
            )
        return said, failures
