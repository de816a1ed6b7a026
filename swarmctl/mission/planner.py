"""The planned motion of every vehicle, one control period at a time.

A virtual structure: the reference UAV's plan follows the guidance law, the companions' plans
follow their slots around it, and each plan is bent by stand-off and geofence, limited in speed
and acceleration, kept apart from the others, and judged as a whole before it becomes a command.
Every vehicle keeps its own altitude all mission long: crossing paths stay apart by height, or by
going round one another where heights are too near (``formation.separation``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swarmctl.errors import FormationError
from swarmctl.formation.flight_limits import (
    FlightLimits,
    keep_inside,
    keep_outside,
    limit,
    most_outward,
    violations,
)
from swarmctl.formation.guidance import LineOfSight, go_to
from swarmctl.formation.separation import SpeedBound, least_distances, separate
from swarmctl.mission.estimate_trust import Trust
from swarmctl.mission.filter_settings import expected_enu
from swarmctl.mission.formation_in_flight import FormationInFlight
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.phases import FLYING_FORMATION, OBSERVING, Phase
from swarmctl.mission.reference_guidance import PLAN_FENCE_MARGIN_M, ReferenceGuidance
from swarmctl.mission.target import Target
from swarmctl.units import Array, Vector2

SLOT_GAIN = 0.5
"""Speed with which a planned companion closes on its slot, 1/s."""
ARRIVED_M = 10.0
"""The stand-off circle counts as reached this far outside it, and a slot this near, m."""
REJOINED_MPS = 1.0
"""A companion on its way back flies with its slot once their velocities differ by less."""
HOMING_SHARE = 0.9
"""Share of the greatest speed flown on the way home, where nobody has a formation to keep."""
REFERENCE_SHARE = 0.4
"""Share of the greatest acceleration the reference uses: the outer followers need more than it."""
REFERENCE_YIELDS = 0.1
"""Weight with which the reference makes way for a companion; a companion's is 1."""
LOST_YIELDS = 0.01
"""The same weight for a lost companion: nearly nothing, for it may not hear us."""
BRAKING_SHARE = 0.3
"""Share of the greatest acceleration counted on to stop before a limit."""
CORRECTION_SHARE = 0.7
"""Share of the followers' spare speed that corrections of the LOS may take."""


@dataclass(frozen=True)
class PlannedMotion:
    """The planned motion in one control period; rows in the mission file's order of vehicles.

    Attributes:
        positions: (n, 3) planned positions, ENU m.
        velocities: (n, 3) planned velocities, m/s.
        slots: (n, 3) where each vehicle should be, m; its planned position once formed.
        los: The LOS the formation is drawn against.
        broken: Limits that this plan would have broken; then the last good plan is held.
    """

    positions: Array
    velocities: Array
    slots: Array
    los: LineOfSight
    broken: tuple[str, ...]


class Planner:
    """Plans the swarm's motion.

    Args:
        mission: The mission.

    Raises:
        FormationError: If the design does not fit the mission's limits.
    """

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._frame = mission.frame
        vehicles, limits = mission.swarm.vehicles, mission.limits
        self._altitudes = [v.altitude_amsl_m for v in vehicles]
        self._speeds = [min(limits.max_speed_mps, v.max_speed_mps or math.inf) for v in vehicles]
        self._accelerations = [
            min(limits.max_acceleration_mps2, v.max_acceleration_mps2 or math.inf) for v in vehicles
        ]
        self._shape = FormationInFlight(mission)
        self._require_fence()
        self._apart_m = least_distances(
            self._altitudes,
            mission.limits.min_separation_m,
            mission.formation.separation_margin_m,
        )
        self._positions = np.zeros((len(self._altitudes), 2))
        self._velocities: Array = np.zeros_like(self._positions)
        self._returning: set[int] = set()
        self._lead = ReferenceGuidance(mission, self._shape, self._speeds)
        # Half of the margin is left to what vehicle and wind make of the plan.
        self._reach_m = mission.limits.d_max_m - 0.5 * mission.formation.margin_m

    def _require_fence(self) -> None:
        """Check that the orbit fits the geofence: slots ahead of the reference make it wider."""
        east, north, _ = expected_enu(self._mission)
        reach = math.hypot(east, north) + self._shape.orbit_m + self._mission.limits.d_max_m
        fence = self._mission.limits.geofence_radius_m
        if reach > fence:
            raise FormationError(
                f"With the {self._mission.formation.design} formation the swarm orbits"
                f" {self._shape.orbit_m:.0f} m from the emitter and reaches {reach:.0f} m from the"
                f" origin; limits.geofence_radius_m is {fence:g}. Raise it or fly another"
                " formation.design."
            )

    def begin(self, positions: Array, target: Target) -> None:
        """Start from measured positions at rest and share out the slots.

        Args:
            positions: (n, 2) measured positions east, north, m.
            target: The estimate now.
        """
        self._positions = np.array(positions, dtype=float)
        self._velocities = np.zeros_like(self._positions)
        self._shape.begin(self._positions, np.array(target.position_enu[:2]))

    def step(
        self,
        phase: Phase,
        target: Target,
        worst_error_m: float,
        launch: Array,
        dt: float,
        trust: Trust = Trust.FULL,
    ) -> PlannedMotion:
        """Advance the plan by one control period.

        Args:
            phase: A phase in which the swarm flies under guidance.
            target: The estimate now.
            worst_error_m: Greatest measured distance of a follower from its slot, m.
            launch: (n, 2) launch points, m.
            dt: Length of the period, s.
            trust: How far guidance relies on the estimate.
        """
        if phase in FLYING_FORMATION:
            velocities = self._formation_velocities(phase, target, worst_error_m, dt, trust)
        else:
            velocities = self._homing_velocities(launch, target)
        velocities = separate(
            self._positions,
            self._velocities,
            velocities,
            self._apart_m,
            self._yielding(phase),
            self._within_reach(velocities) if phase in OBSERVING else [],
            np.array(self._speeds),
            np.array(self._accelerations),
            dt,
        )
        self._returning -= self._rejoined(velocities)
        positions = self._positions + 0.5 * (self._velocities + velocities) * dt
        full = self._with_height(positions)
        broken = self._violations(full, phase, target)
        if broken:
            velocities = np.zeros_like(velocities)
            full = self._with_height(self._positions)
        else:
            self._positions = positions
        self._velocities = velocities
        level = np.zeros((len(full), 3))
        level[:, :2] = velocities
        slots = self._with_height(self._slots()) if phase in FLYING_FORMATION else full
        return PlannedMotion(full, level, slots, self._shape.los, tuple(broken))

    @property
    def reference(self) -> int:
        """Row of the vehicle that is the reference UAV."""
        return self._shape.reference

    @property
    def companions(self) -> tuple[int, ...]:
        """Rows of the vehicles that fly in formation round the reference UAV."""
        return tuple(self._shape.members)

    @property
    def returning(self) -> frozenset[int]:
        """Rows of companions on their way to slots that may be out of reach where they are."""
        return frozenset(self._returning)

    def drop(self, companion: int) -> None:
        """Fly on without a companion: its plan comes to rest, the others close up.

        Args:
            companion: Its row among the vehicles.

        Raises:
            FormationError: No design fits as few as are left.
        """
        self._returning.discard(companion)
        self._shape.drop(companion)

    def add(self, companion: int, position: Array) -> None:
        """Take a companion in again.

        Args:
            companion: Its row among the vehicles.
            position: (2,) where it is, east and north, m; taken to be at rest.
        """
        self._positions[companion] = position
        self._velocities[companion] = 0.0
        self._returning.add(companion)
        self._shape.add(companion, position - self._positions[self._shape.reference])

    def succeed(self, target: Target) -> None:
        """Fly on without the reference UAV: its plan stands still, a companion takes its place.

        The others form up round that one as if they had been taken in again.

        Args:
            target: The estimate now.

        Raises:
            FormationError: No design fits as few as are left.
        """
        self._shape.succeed(self._positions, np.array(target.position_enu[:2]))
        self._returning = set(self._shape.members)

    def to_orbit_m(self, target: Target) -> float:
        """How far outside its orbit the reference's plan is, m."""
        offset = self._positions[self._shape.reference] - target.position_enu[:2]
        return math.hypot(offset[0], offset[1]) - self._shape.orbit_m

    def at_radius(self, target: Target) -> bool:
        """Whether the reference's plan has reached its orbit."""
        return self.to_orbit_m(target) <= ARRIVED_M

    def _slots(self) -> Array:
        slots = self._positions.copy()
        slots[self._shape.members] = self._positions[self._shape.reference] + self._shape.offsets()
        return slots

    def _formation_velocities(
        self, phase: Phase, target: Target, worst_error_m: float, dt: float, trust: Trust
    ) -> Array:
        limits = self._mission.limits
        # A lost vehicle's plan comes to rest gently: those behind it need not leave the formation.
        speeds = np.linalg.norm(self._velocities, axis=1, keepdims=True)
        braking = BRAKING_SHARE * np.array(self._accelerations)[:, None]
        slower = np.maximum(speeds - braking * dt, 0.0)
        velocities: Array = self._velocities * (slower / np.maximum(speeds, 1e-9))
        reference = self._positions[self._shape.reference]
        east, north = (reference - target.position_enu[:2]).tolist()
        # Followers are led by the velocity the reference will have, not by the one it wants.
        holds = trust is Trust.NONE
        wished = (
            (0.0, 0.0)
            if holds
            else self._lead.velocity(phase, target, reference, worst_error_m, dt)
        )
        wanted = self._bend(self._shape.reference, wished, target)
        last = self._velocities[self._shape.reference].tolist()
        change = limit(
            (wanted[0] - last[0], wanted[1] - last[1]),
            REFERENCE_SHARE * min(self._accelerations[i] for i in self._shape.flying) * dt,
        )
        velocity = (last[0] + change[0], last[1] + change[1])
        velocities[self._shape.reference] = velocity

        drift = target.trusted_velocity
        relative = (velocity[0] - drift[0], velocity[1] - drift[1])
        rate = (east * relative[1] - north * relative[0]) / max(math.hypot(east, north), 1.0) ** 2
        shape = self._shape
        if holds:
            shape.rest(dt)
        else:
            # The outermost slot goes round the emitter faster than the reference UAV.
            out = shape.d_m / max(math.hypot(east, north), 1.0)
            outermost = math.hypot(*velocity) * (1.0 + out)
            spare = limits.max_speed_mps - min(limits.cruise_speed_mps, outermost)
            shape.turn(
                math.atan2(-north, -east),
                rate,
                math.hypot(east, north),
                target.los_sigma_rad(*reference.tolist()),
                CORRECTION_SHARE * spare / shape.d_m,
                dt,
                redesign=trust is Trust.FULL,
            )
        gaps = reference + shape.offsets() - self._positions[shape.members]
        for i, gap, led in zip(
            shape.members, gaps.tolist(), (velocity + shape.velocities()).tolist(), strict=True
        ):
            acceleration = self._accelerations[i]
            close = go_to((gap[0], gap[1]), limits.cruise_speed_mps, 0.5 * acceleration, SLOT_GAIN)
            wanted = (led[0] + close[0], led[1] + close[1])
            if phase in OBSERVING:
                wanted = self._reach(i, wanted, velocity)
            velocities[i] = self._bend(i, wanted, target)
        return velocities

    def _reach(self, i: int, wanted: Vector2, led: Vector2) -> Vector2:
        """Companion i's velocity, pulled in before the reference UAV is out of reach."""
        east, north = (self._positions[i] - self._positions[self._shape.reference]).tolist()
        relative = keep_inside(
            (east, north),
            (wanted[0] - led[0], wanted[1] - led[1]),
            self._level_reach_m(i),
            BRAKING_SHARE * self._accelerations[i],
        )
        return (relative[0] + led[0], relative[1] + led[1])

    def _within_reach(self, velocities: Array) -> list[SpeedBound]:
        """Bounds that keep companions in reach of the reference while they make way for others."""
        led = velocities[self._shape.reference]
        bounds = []
        for i in self._shape.members:
            out = self._positions[i] - self._positions[self._shape.reference]
            distance = math.hypot(*out.tolist())
            if i in self._returning or distance == 0.0:
                continue
            out /= distance
            braking = BRAKING_SHARE * self._accelerations[i]
            most = most_outward(self._level_reach_m(i) - distance, braking)
            bounds.append(SpeedBound(i, (out[0], out[1]), float(out @ led) + most))
        return bounds

    def _level_reach_m(self, i: int) -> float:
        height = self._altitudes[i] - self._altitudes[self._shape.reference]
        return math.sqrt(max(self._reach_m**2 - height**2, 0.0))

    def _homing_velocities(self, launch: Array, target: Target) -> Array:
        velocities = np.empty_like(self._velocities)
        for i, gap in enumerate((launch - self._positions).tolist()):
            acceleration = self._accelerations[i]
            home = go_to(
                (gap[0], gap[1]), HOMING_SHARE * self._speeds[i], 0.5 * acceleration, SLOT_GAIN
            )
            velocities[i] = self._bend(i, home, target)
        return velocities

    def _yielding(self, phase: Phase) -> Array:
        """Weight with which each vehicle makes way for others, (n,); a lost one hardly does."""
        if phase not in FLYING_FORMATION:
            return np.ones(len(self._altitudes))
        yielding: Array = np.full(len(self._altitudes), LOST_YIELDS)
        yielding[self._shape.members] = 1.0
        yielding[self._shape.reference] = REFERENCE_YIELDS
        return yielding

    def _bend(self, i: int, wanted: Vector2, target: Target) -> Vector2:
        """The velocity that vehicle i wants, bent by stand-off and geofence and limited in speed.

        The braking it counts on is less than any plan's acceleration, so that a limit seen in
        time is kept.
        """
        limits = self._mission.limits
        here = self._positions[i].tolist()
        braking = BRAKING_SHARE * self._accelerations[i]
        drift = target.trusted_velocity
        # Half of the margin is left to the orbit's own overshoot.
        keep_out = limits.stand_off_m + 0.5 * self._mission.formation.stand_off_margin_m
        offset = (here[0] - target.position_enu[0], here[1] - target.position_enu[1])
        relative = (wanted[0] - drift[0], wanted[1] - drift[1])
        relative = keep_outside(offset, relative, keep_out, braking)
        velocity = (relative[0] + drift[0], relative[1] + drift[1])
        velocity = keep_inside(
            (here[0], here[1]), velocity, limits.geofence_radius_m - PLAN_FENCE_MARGIN_M, braking
        )
        return limit(velocity, self._speeds[i])

    def _rejoined(self, velocities: Array) -> set[int]:
        """Companions that were on their way back and have reached their slots."""
        if not self._returning:
            return set()
        slots = self._slots()
        shape = self._shape
        led = velocities[self._shape.reference] + shape.velocities()
        return {
            i
            for i, velocity in zip(shape.members, led, strict=True)
            if math.dist(self._positions[i], slots[i]) < ARRIVED_M
            and math.dist(velocities[i], velocity) < REJOINED_MPS
        }

    def _violations(self, full: Array, phase: Phase, target: Target) -> list[str]:
        """Limits that planned positions break; a companion on its way back may be out of reach."""
        present = sorted(self._shape.flying)
        joined = [i for i in present if i not in self._returning]
        found = []
        for rows, d_max_m in (
            (present, None),
            (joined, self._mission.limits.d_max_m if phase in OBSERVING else None),
        ):
            found += violations(
                full[rows],
                rows.index(self._shape.reference),
                np.array(target.position_enu),
                self._bounds(d_max_m),
            )
        return list(dict.fromkeys(found))

    def _with_height(self, horizontal: Array) -> Array:
        up = [
            self._frame.up_at(east, north, altitude)
            for (east, north), altitude in zip(horizontal.tolist(), self._altitudes, strict=True)
        ]
        return np.column_stack((horizontal, up))

    def _bounds(self, d_max_m: float | None) -> FlightLimits:
        limits = self._mission.limits
        return FlightLimits(
            separation_m=limits.min_separation_m,
            d_max_m=d_max_m,
            stand_off_m=limits.stand_off_m,
            fence_radius_m=limits.geofence_radius_m,
            ceiling_m=limits.ceiling_amsl_m - self._mission.origin.alt_amsl_m,
        )
