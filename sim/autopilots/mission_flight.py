"""How an uploaded mission is flown: one leg after the other, each a task.

Take-offs, waypoints, loitering, returns and landings are flown; all other items are skipped.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import msgspec

from sim.autopilots.flight_tasks import REACHED_M, FlyTo, Hold, Situation, Task
from sim.autopilots.mission_items import Item
from sim.autopilots.takeoff_and_landing import Descend, ReturnClimb, TakeOff
from sim.dynamics import Command
from sim.mavlink import dialect
from swarmctl.units import Vector

Kind = Literal["take_off", "fly", "stay", "level", "return", "land"]

_KINDS: dict[int, Kind] = {
    dialect.MAV_CMD_NAV_TAKEOFF: "take_off",
    dialect.MAV_CMD_NAV_WAYPOINT: "fly",
    dialect.MAV_CMD_NAV_LOITER_UNLIM: "stay",
    dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH: "return",
    dialect.MAV_CMD_NAV_LAND: "land",
}
_ABOVE_HOME = {
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
}


class Leg(NamedTuple):
    """A part of a mission.

    Attributes:
        seq: Number of its item.
        kind: What to do; ``level`` flies to a place at the present height.
        place_enu: Where to fly, m; unused by a return and a landing.
        hold_s: How long to stay there, s.
    """

    seq: int
    kind: Kind
    place_enu: Vector
    hold_s: float


class Pace(NamedTuple):
    """How a vehicle flies its missions.

    Attributes:
        climb_mps: Climb rate of a take-off, m/s.
        spool_up_s: Time until it lifts from the ground, s.
        radius_m: A place nearer than this is reached, m.
        landing: How it lands.
        homing: How it returns.
    """

    climb_mps: float
    spool_up_s: float
    radius_m: float
    landing: Descend
    homing: ReturnClimb


class FlyLegs(msgspec.Struct, frozen=True, gc=False):
    """Fly a mission; after its last leg, hold.

    Attributes:
        legs: The legs.
        pace: How they are flown.
        at: Index of the leg that is flown.
        doing: The task of that leg; None before it begins.
        reached_s: Simulation time at which the place was reached, s; None before.
    """

    legs: tuple[Leg, ...]
    pace: Pace
    at: int = 0
    doing: Task | None = None
    reached_s: float | None = None

    @property
    def leg(self) -> Leg | None:
        """The leg that is flown; None after the last."""
        return self.legs[self.at] if self.at < len(self.legs) else None

    @property
    def lifts(self) -> bool:
        """Whether the present leg takes a vehicle off the ground."""
        return self.leg is not None and self.leg.kind == "take_off"

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        doing = self._begin(situation) if self.doing is None else self.doing
        leg, reached_s = self.leg, self.reached_s
        if leg is not None and reached_s is None and self._is_reached(leg, doing, situation):
            reached_s = situation.now_s
        if leg is not None and reached_s is not None and situation.now_s - reached_s >= leg.hold_s:
            return FlyLegs(self.legs, self.pace, self.at + 1).fly(situation)
        doing, command = doing.fly(situation)
        return FlyLegs(self.legs, self.pace, self.at, doing, reached_s), command

    def _begin(self, situation: Situation) -> Task:
        leg, pace = self.leg, self.pace
        x, y, z = situation.position_enu
        if leg is None:
            return Hold()
        match leg.kind:
            case "take_off":
                on_ground = z - situation.home_enu[2] < REACHED_M
                spool_up_s = pace.spool_up_s if on_ground else 0.0
                up = leg.place_enu[2]
                return TakeOff((x, y, up), situation.now_s, spool_up_s, pace.climb_mps)
            case "fly" | "stay":
                return FlyTo(leg.place_enu, None, situation.now_s, math.inf)
            case "level":
                return FlyTo((*leg.place_enu[:2], z), None, situation.now_s, math.inf)
            case "return":
                return pace.homing
            case _:
                return pace.landing

    def _is_reached(self, leg: Leg, doing: Task, situation: Situation) -> bool:
        match leg.kind:
            case "take_off":
                return isinstance(doing, Hold)
            case "fly":
                return math.hypot(*situation.way_to(leg.place_enu)) < self.pace.radius_m
            case "level":
                return math.hypot(*situation.level_way_to(leg.place_enu)) < self.pace.radius_m
            case _:
                return False


def legs_of(
    items: Sequence[Item], first: int, to_enu: Callable[[int, int, float, bool], Vector]
) -> tuple[Leg, ...]:
    """The legs of a mission from an item on.

    Args:
        items: The mission.
        first: Index of that item.
        to_enu: Place, m, of latitude and longitude in 1e-7 degrees and an altitude, m, above home
            or (False) above mean sea level.
    """
    legs = []
    for seq, item in enumerate(items[first:], first):
        kind = _KINDS.get(item.command)
        if kind is None:
            continue
        place = to_enu(item.x, item.y, item.z, item.frame in _ABOVE_HOME)
        if kind == "land" and (item.x, item.y) != (0, 0):
            legs.append(Leg(seq, "level", place, 0.0))
        hold_s = item.param1 if kind == "fly" and math.isfinite(item.param1) else 0.0
        legs.append(Leg(seq, kind, place, hold_s))
    return tuple(legs)
