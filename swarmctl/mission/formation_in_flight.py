"""The formation in flight: the design, who takes which slot, and the LOS it is drawn against."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from swarmctl.formation.design_choice import DesignChoice
from swarmctl.formation.designs import DESIGNS
from swarmctl.formation.guidance import LineOfSight, follow_line_of_sight, go_to, wrap_angle
from swarmctl.formation.information import slots_in_los_frame
from swarmctl.formation.objectives import rms
from swarmctl.formation.requirements import Noise, Requirements
from swarmctl.formation.separation import slot_separation
from swarmctl.formation.slots import assign, level_design
from swarmctl.mission.filter_settings import expected_enu
from swarmctl.mission.mission_file import Mission
from swarmctl.units import Array

HOLD_RAD = math.radians(30.0)
"""While the LOS's own 1-sigma is above this, the formation turns with the geometry only."""
RELABEL_RAD = math.radians(100.0)
"""A LOS that jumps by more than this finds the swarm facing backwards: the companions exchange
their slots instead of crossing over to the other side."""
FLYABLE = 1.1
"""A slot is at least this many times its height above or below the reference away from it."""
MORPH_SHARE = 0.7
"""Share of the followers' spare speed that slots take, at the most, from one design to the next."""
MORPH_GAIN = 0.03
"""Their speed per metre that is left to go, 1/s: a small change is made gently."""
MORPH_ACCELERATION_SHARE = 0.3
"""Share of the vehicles' acceleration that slots use on the way."""
FIRST_RANGE = 1.2
"""Designs are made for ranges from this many times the slots' distance on."""


class FormationInFlight:
    """The slots of the companions around the reference UAV.

    Args:
        mission: The mission.

    Attributes:
        reference: Row of the reference UAV among the mission's vehicles.
        members: Rows of the companions that fly in the formation.
        d_m: Greatest distance of a slot from the reference UAV, m.
        los: The LOS the formation is drawn against.

    Raises:
        FormationError: The design does not fit the mission's limits.
    """

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._altitudes = [vehicle.altitude_amsl_m for vehicle in mission.swarm.vehicles]
        self.d_m = mission.limits.d_max_m - mission.formation.margin_m
        sysids = mission.swarm.sysids
        self.reference = sysids.index(mission.swarm.reference)
        self.members = [i for i in range(len(sysids)) if i != self.reference]
        self.los = LineOfSight(0.0, 0.0)
        self._separation_m = slot_separation(
            [v.altitude_amsl_m for v in mission.swarm.vehicles],
            mission.limits.min_separation_m,
            mission.formation.separation_margin_m,
        )
        self._choices: dict[int, DesignChoice] = {}
        self._range_m = math.inf
        # The design for an unsure line of sight takes long to make: not in flight.
        self._choice.choose(self._range_m, math.pi)
        self._design = self._choice.choose(self._range_m, 0.0)
        # In the LOS frame, along and across: where the slots are, where they move to, how fast.
        self._goals = self._slots = slots_in_los_frame(self._design)
        self._morphing = np.zeros_like(self._slots)

    @property
    def flying(self) -> list[int]:
        """Rows of the reference UAV and its companions."""
        return [self.reference, *self.members]

    @property
    def _choice(self) -> DesignChoice:
        """The designs for the present number of companions."""
        count = len(self.members)
        if count not in self._choices:
            mission = self._mission
            limits, formation = mission.limits, mission.formation
            radius = limits.stand_off_m + formation.stand_off_margin_m
            first = max(radius, FIRST_RANGE * self.d_m)
            expected = expected_enu(mission)
            self._choices[count] = DesignChoice(
                lambda range_m: self._make(formation.design, count, range_m),
                # Only the optimal formation bets on the line of sight.
                lambda range_m: self._make(
                    "worst_case" if formation.design == "optimal" else formation.design,
                    count,
                    range_m,
                ),
                first_m=first,
                farthest_m=max(first, math.hypot(expected[0], expected[1])),
                nearest_m=radius,
                stand_off_m=limits.stand_off_m + 0.5 * formation.stand_off_margin_m,
            )
        return self._choices[count]

    def _make(self, name: str, count: int, range_m: float) -> Array:
        formation = self._mission.formation
        requirements = Requirements(
            companions=count,
            max_slot_distance_m=self.d_m,
            separation_m=self._separation_m,
            range_m=range_m,
            noise=Noise(formation.sigma_rd_m, self._mission.filter.sigma_p_m, formation.rho),
        )
        return DESIGNS[name](requirements, rms(requirements))

    @property
    def orbit_m(self) -> float:
        """Nearest the reference UAV may come to the emitter, m."""
        return self._choice.orbit_m

    def begin(self, positions: Array, emitter: Array) -> None:
        """Share out the slots anew.

        Args:
            positions: (n, 2) positions of all vehicles, m.
            emitter: (2,) estimated position, m.

        Raises:
            FormationError: No design fits as few as are left.
        """
        reference = positions[self.reference]
        east, north = (emitter - reference).tolist()
        self.los = LineOfSight(math.atan2(north, east), 0.0)
        self._range_m = math.hypot(east, north)
        self._design = self._choice.choose(self._range_m, 0.0)
        self._share_out(_turned(positions[self.members] - reference, -self.los.angle_rad))
        self._slots = self._goals
        self._morphing = np.zeros_like(self._slots)

    def turn(
        self,
        bearing_rad: float,
        rate_rads: float,
        range_m: float,
        los_sigma_rad: float,
        max_correction_rads: float,
        dt: float,
        *,
        redesign: bool = True,
    ) -> None:
        """Follow the line of sight, and choose the design for what is known now.

        Args:
            bearing_rad: Direction of the estimate from the reference UAV, rad from East.
            rate_rads: Its geometric rate, rad/s.
            range_m: Range to the estimate, m.
            los_sigma_rad: 1-sigma of the bearing, rad.
            max_correction_rads: Limit of the correction, rad/s.
            dt: Control period, s.
            redesign: Whether the estimate may be believed enough to change the design.
        """
        self._range_m = range_m
        if abs(wrap_angle(bearing_rad - self.los.angle_rad)) > RELABEL_RAD:
            self.los = LineOfSight(wrap_angle(self.los.angle_rad + math.pi), self.los.rate_rads)
            self._slots, self._morphing = -self._slots, -self._morphing
            self._share_out(self._slots)
        design = self._choice.choose(range_m, los_sigma_rad)
        if redesign and design is not self._design:
            self._design = design
            # From slot to slot, not from where wind and noise have put the vehicles.
            self._share_out(self._slots)
        if los_sigma_rad > HOLD_RAD:
            max_correction_rads = 0.0
        self.los = follow_line_of_sight(self.los, bearing_rad, rate_rads, max_correction_rads, dt)
        self._morph(dt)

    def rest(self, dt: float) -> None:
        """Let the formation stand as it is drawn, for one control period."""
        self.los = LineOfSight(self.los.angle_rad, 0.0)
        self._morph(dt)

    def _morph(self, dt: float) -> None:
        """Move the slots towards those of the chosen design, as gently as vehicles can follow."""
        limits = self._mission.limits
        speed = MORPH_SHARE * (limits.max_speed_mps - limits.cruise_speed_mps)
        acceleration = MORPH_ACCELERATION_SHARE * limits.max_acceleration_mps2
        wanted = [
            go_to((east, north), speed, 0.5 * acceleration, MORPH_GAIN)
            for east, north in (self._goals - self._slots).tolist()
        ]
        change = np.array(wanted) - self._morphing
        size = np.linalg.norm(change, axis=1, keepdims=True)
        change = change * np.minimum(1.0, acceleration * dt / np.maximum(size, 1e-9))
        self._morphing = self._morphing + change
        self._slots = self._slots + self._morphing * dt

    def offsets(self) -> Array:
        """Horizontal offsets of the members' slots from the reference UAV, (N, 2), m."""
        return _turned(self._slots, self.los.angle_rad)

    def velocities(self) -> Array:
        """Velocities of the slots relative to the reference UAV, (N, 2), m/s."""
        offsets = self.offsets()
        turning = self.los.rate_rads * np.column_stack((-offsets[:, 1], offsets[:, 0]))
        return turning + _turned(self._morphing, self.los.angle_rad)

    def drop(self, companion: int) -> None:
        """Fly on without a companion; the others close up.

        Raises:
            FormationError: No design fits as few as are left.
        """
        row = self.members.index(companion)
        self.members.pop(row)
        self._choose_anew(np.delete(self._slots, row, axis=0))

    def add(self, companion: int, offset: Array) -> None:
        """Take a companion in again; its slot starts where it is, but no farther than slots are.

        Args:
            companion: Its row among the mission's vehicles.
            offset: (2,) from the reference UAV, m.
        """
        offset = offset * min(1.0, self.d_m / max(float(np.hypot(*offset)), 1e-9))
        self.members.append(companion)
        self._choose_anew(np.vstack([self._slots, _turned(offset, -self.los.angle_rad)]))

    def succeed(self, positions: Array, emitter: Array) -> None:
        """Fly on without the reference UAV: the best-placed companion takes its place.

        That is the one that leaves the others least out of its reach, and of equals the one
        for which they have the least squared way to go.

        Args:
            positions: (n, 2) positions of all vehicles, m.
            emitter: (2,) estimated position, m.

        Raises:
            FormationError: No design fits as few as are left.
        """
        candidates = list(self.members)

        def cost(successor: int) -> tuple[float, float]:
            self._lead(successor, candidates)
            self.begin(positions, emitter)
            gaps = positions[self.members] - positions[successor]
            farthest = float(np.linalg.norm(gaps, axis=1).max(initial=0.0))
            ways = gaps - self.offsets()
            return max(0.0, farthest - self.d_m), float((ways**2).sum())

        self._lead(min(candidates, key=cost), candidates)
        self.begin(positions, emitter)

    def _lead(self, successor: int, candidates: Sequence[int]) -> None:
        self.reference = successor
        self.members = [i for i in candidates if i != successor]

    def _choose_anew(self, slots: Array) -> None:
        self._design = self._choice.choose(self._range_m, 0.0)
        self._slots = slots
        self._morphing = np.zeros_like(slots)
        self._share_out(slots)

    def _share_out(self, slots: Array) -> None:
        """Give each member the slot of the design that is least squared path away."""
        taken = assign(slots, slots_in_los_frame(self._design))
        level = self._altitudes[self.reference]
        heights = np.array([self._altitudes[member] - level for member in self.members])
        design = self._design[taken]
        design[:, 1] = np.maximum(design[:, 1], FLYABLE * np.abs(heights))
        self._goals = slots_in_los_frame(level_design(design, heights))


def _turned(vectors: Array, angle_rad: float) -> Array:
    """Vectors (..., 2) turned counter-clockwise."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    turned: Array = vectors @ np.array([[c, s], [-s, c]])
    return turned
