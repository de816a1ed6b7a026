"""What ends a flight early: silence, low battery, a silent feed, a broken plan, the time limit."""

from __future__ import annotations

from collections.abc import Collection

from swarmctl.mission.failure import Failure
from swarmctl.mission.fleet import Fleet
from swarmctl.mission.loss_detection import LossDetection
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.phases import FLYING_FORMATION, Phase
from swarmctl.results import MissionResult

BROKEN_PLAN_S = 5.0
"""A mission ends if every plan for this long would break a limit."""


class InFlightChecks:
    """Checks the vehicles and the observation in every control period of a flight.

    Args:
        mission: The mission.
        losses: Tells whether a vehicle has been silent for so long that it is lost.
        hiccup_s: Silence of the feed that this computer may be to blame for, s.
    """

    def __init__(self, mission: Mission, losses: LossDetection, hiccup_s: float) -> None:
        self._mission = mission
        self._losses = losses
        self._hiccup_s = hiccup_s
        self._listening_since: float | None = None
        self._good_plan_s: float | None = None

    def vehicle_failure(
        self, fleet: Fleet, excused: Collection[int], all_up: bool, now: float
    ) -> Failure | None:
        """The first thing that is wrong with a vehicle in flight, if anything.

        Args:
            fleet: The vehicles.
            excused: System ids of vehicles a pilot has taken over, and of those given up already.
            all_up: Whether all of them should be in the air by now.
            now: Controller's time, s.
        """
        for vehicle in fleet.vehicles.values():
            if vehicle.sysid in excused:
                continue
            if not vehicle.is_armed:
                if all_up:
                    return Failure(
                        MissionResult.VEHICLE_LOST,
                        f"vehicle {vehicle.sysid} disarmed in flight",
                        vehicle.sysid,
                    )
                continue
            if self._losses.is_lost(vehicle, now):
                return Failure(
                    MissionResult.VEHICLE_LOST,
                    f"vehicle {vehicle.sysid} has been silent for {vehicle.silence_s(now):.0f} s",
                    vehicle.sysid,
                )
            battery = vehicle.status.battery_fraction if vehicle.status is not None else None
            reserve = self._mission.limits.battery_reserve
            if battery is not None and battery < reserve:
                return Failure(
                    MissionResult.LOW_BATTERY,
                    f"the battery of vehicle {vehicle.sysid} is at {battery:.0%}, below the"
                    f" reserve of {reserve:.0%}",
                )
        return None

    def observation_failure(
        self,
        phase: Phase,
        plan_broken: bool,
        measured_s: float | None,
        started_s: float,
        now: float,
    ) -> Failure | None:
        """What is wrong with the observation, if anything.

        Args:
            phase: The phase.
            plan_broken: Whether this period's plan had to be held.
            measured_s: When a range difference was last used, controller's time; None if never.
            started_s: Start of the mission, controller's time.
            now: Controller's time, s.
        """
        if phase not in FLYING_FORMATION:
            return None
        if self._listening_since is None:
            self._listening_since = now
        heard = max(self._listening_since, measured_s or self._listening_since)
        feed = self._mission.feed
        if now - heard > feed.timeout_s + self._hiccup_s:
            return Failure(
                MissionResult.FEED_SILENT,
                f"no usable range difference came from {feed.broker} for {feed.timeout_s:g} s:"
                " check the receivers and the broker",
            )
        if not plan_broken or self._good_plan_s is None:
            self._good_plan_s = now
        elif now - self._good_plan_s > BROKEN_PLAN_S:
            return Failure(
                MissionResult.PLAN_REJECTED, "no plan within the mission's limits can be found"
            )
        if now - started_s > self._mission.goal.time_limit_s:
            return Failure(
                MissionResult.NOT_LOCATED,
                f"the emitter is not located to {self._mission.goal.sigma_m:g} m (1 sigma) within"
                f" goal.time_limit_s = {self._mission.goal.time_limit_s:g} s",
            )
        return None
