"""How the reference UAV leads the formation: to the emitter, round it, or aside for a while."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from swarmctl.formation.dogleg import DogLegs, Situation, Terms, turned
from swarmctl.formation.guidance import approach_and_orbit, orbit_speed, pace, wrap_angle
from swarmctl.formation.requirements import Noise
from swarmctl.mission.formation_in_flight import HOLD_RAD, FormationInFlight
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.phases import Phase
from swarmctl.mission.target import Target
from swarmctl.units import Array, Vector2

LEASH_M = (4.0, 12.0)
"""The reference slows from full speed to a stop as the worst slot error grows between."""
ASIDE_RAD = (math.radians(20.0), math.radians(60.0))
"""It slows likewise as the angle between the formation's LOS and the estimate grows."""
FEED_HZ = 10.0
"""Rate of range differences that the choice of dog-legs assumes, Hz."""
PLAN_FENCE_MARGIN_M = 10.0
"""Plans keep this far inside the mission's geofence."""
PACE_SHARE = 0.95
"""Share of the vehicles' greatest speeds that the formation flies; the rest is for corrections."""
RANGE_GUARD = 3.0
"""The reference does not approach nearer than this many sigmas of the estimate."""


class ReferenceGuidance:
    """The velocity that the reference UAV wants.

    Args:
        mission: The mission.
        shape: The formation that it leads.
        speeds_mps: Greatest speed of each of the mission's vehicles.
    """

    def __init__(
        self, mission: Mission, shape: FormationInFlight, speeds_mps: Sequence[float]
    ) -> None:
        self._mission = mission
        self._shape = shape
        self._speeds = speeds_mps
        self._dog_legs = DogLegs(
            Terms(
                noise=Noise(
                    mission.formation.sigma_rd_m, mission.filter.sigma_p_m, mission.formation.rho
                ),
                rate_hz=FEED_HZ,
                acceleration_psd=mission.filter.process_noise_mps_per_sqrt_s**2,
                cruise_mps=mission.limits.cruise_speed_mps,
                wanted_m=mission.goal.sigma_m,
                observe_s=mission.goal.orbit_s,
                fence_m=mission.limits.geofence_radius_m
                - mission.limits.d_max_m
                - PLAN_FENCE_MARGIN_M,
            )
        )

    def velocity(
        self, phase: Phase, target: Target, reference: Array, worst_error_m: float, dt: float
    ) -> Vector2:
        """Where the reference UAV wants to go now, before any limit of place or acceleration.

        Args:
            phase: A phase in which the formation is flown.
            target: The estimate now.
            reference: (2,) its planned position, m.
            worst_error_m: Greatest measured distance of a companion from its slot, m.
            dt: Control period, s.

        Returns:
            Velocity east and north, m/s.
        """
        if phase is Phase.FORMING:
            return (0.0, 0.0)
        limits = self._mission.limits
        offset = (
            float(reference[0]) - target.position_enu[0],
            float(reference[1]) - target.position_enu[1],
        )
        distance = math.hypot(*offset)
        # Never nearer than the estimate is sharp, but no retreat from a circle that is only
        # this wide because little has been measured yet.
        radius = max(self._shape.orbit_m, min(RANGE_GUARD * target.sigma_m, distance))
        drift = target.trusted_velocity
        # The orbit moves with the emitter, so the outermost follower has that much less left.
        spare = limits.max_speed_mps - math.hypot(*drift)
        orbit_mps = min(
            limits.cruise_speed_mps, PACE_SHARE * orbit_speed(spare, radius, self._shape.d_m)
        )
        east, north = approach_and_orbit(offset, drift, radius, limits.cruise_speed_mps, orbit_mps)
        if phase is Phase.APPROACHING and target.track_covariance is not None:
            situation = Situation(
                reference,
                np.array([*target.position_enu[:2], *target.velocity_enu[:2]]),
                target.track_covariance,
                self._shape.offsets(),
                radius,
                orbit_mps,
            )
            course = self._dog_legs.follow(situation, dt)
            east, north = turned((east, north), drift, course)
        slots = np.vstack([np.zeros(2), self._shape.offsets()])
        relative = (east - drift[0], north - drift[1])
        speeds = PACE_SHARE * np.array([self._speeds[i] for i in self._shape.flying])
        share = pace(offset, relative, drift, slots, speeds)
        east, north = drift[0] + share * relative[0], drift[1] + share * relative[1]
        leash = _share_left(worst_error_m, LEASH_M)
        if target.los_sigma_rad(*reference.tolist()) < HOLD_RAD:
            bearing = math.atan2(-offset[1], -offset[0])
            aside = abs(wrap_angle(bearing - self._shape.los.angle_rad))
            leash = min(leash, _share_left(aside, ASIDE_RAD))
        return (leash * east, leash * north)


def _share_left(value: float, bounds: tuple[float, float]) -> float:
    """1 up to the lower bound, 0 from the upper one on, and linear between."""
    slack, stop = bounds
    return max(0.0, min(1.0, (stop - value) / (stop - slack)))
