"""What ends a flight early: every in-flight check, each with its result's name and sentence."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from swarmctl.mission.fleet import Fleet, VehicleState
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.phases import FLYING_FORMATION, Phase
from swarmctl.results import MissionResult

LOST_AFTER_S = 5.0
"""A vehicle without a position for this long counts as lost in flight."""
HEARTBEAT_LOST_AFTER_S = 10.0
"""So does one without a heartbeat for this long. It comes once a second only: over a radio that
loses every fifth packet, 5 s without one befall every vehicle about once in an hour."""
BROKEN_PLAN_S = 5.0
"""A plan that would break a limit for this long ends the mission."""


@dataclass(frozen=True)
class Failure:
    """Why a mission ends early: the result's name and a sentence without full stop.

    ``sysid`` is the vehicle's, if one vehicle is at fault.
    """

    result: MissionResult
    detail: str
    sysid: int | None = None


class Watch:
    """Watches a flight.

    Args:
        mission: The mission.
        hiccup_s: Silence that this computer may be to blame for, s.
    """

    def __init__(self, mission: Mission, hiccup_s: float) -> None:
        self._mission = mission
        self._hiccup_s = hiccup_s
        self._listening_since: float | None = None
        self._good_plan_s: float | None = None

    def is_lost(self, vehicle: VehicleState, now: float) -> bool:
        """Whether a vehicle has fallen silent."""
        beat, report = vehicle.heartbeat, vehicle.position
        if beat is None:
            return True
        if report is not None and now - report.received_s > LOST_AFTER_S + self._hiccup_s:
            return True
        return now - beat.received_s > HEARTBEAT_LOST_AFTER_S + self._hiccup_s

    def in_flight(
        self, fleet: Fleet, excused: Collection[int], all_up: bool, now: float
    ) -> Failure | None:
        """What is wrong with a vehicle that flies, if anything.

        Args:
            fleet: The vehicles.
            excused: Those a pilot has taken over, and those given up already.
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
            if self.is_lost(vehicle, now):
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

    def observing(
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
