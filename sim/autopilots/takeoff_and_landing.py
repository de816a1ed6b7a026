"""How the simulated autopilots take off, descend, land and return home: tasks."""

from __future__ import annotations

import math

import msgspec

from sim.autopilots.flight_tasks import FOLLOW_GAIN_PER_S, REACHED_M, Hold, Situation, Task
from sim.dynamics import Command
from swarmctl.units import Vector

HOME_REACHED_M = 1.0
"""Home nearer than this is reached, m."""

_STILL: Vector = (0.0, 0.0, 0.0)


class TakeOff(msgspec.Struct, frozen=True, gc=False):
    """Spool up, then climb straight up.

    Attributes:
        target_enu: Position above the launch point to climb to, m.
        started_s: Simulation time of the command, s.
        spool_up_s: Time from the command to the first movement, s.
        climb_mps: Greatest climb rate, m/s.
    """

    target_enu: Vector
    started_s: float
    spool_up_s: float
    climb_mps: float

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        if situation.now_s - self.started_s < self.spool_up_s:
            return self, None
        x, y, up = situation.way_to(self.target_enu)
        if abs(up) < REACHED_M:
            return Hold(self.target_enu).fly(situation)
        if FOLLOW_GAIN_PER_S * up > self.climb_mps:
            return self, Command((x, y, 0.0), (0.0, 0.0, self.climb_mps), FOLLOW_GAIN_PER_S)
        return self, Command((x, y, up), _STILL, FOLLOW_GAIN_PER_S)


class Descend(msgspec.Struct, frozen=True, gc=False):
    """Go straight down to the ground.

    Attributes:
        landing: Whether this is a landing, which disarms on the ground; else it is a mode that
            sinks without a pilot.
        fast_mps: Rate of descent high up, m/s.
        slow_mps: Rate of descent near the ground, m/s.
        slow_below_m: Height above home at which the slow descent begins, m.
        anchor_enu: Place to descend at, m; None while braking.
    """

    landing: bool
    fast_mps: float
    slow_mps: float
    slow_below_m: float
    anchor_enu: Vector | None = None

    def at(self, anchor_enu: Vector | None) -> Descend:
        """The same descent at a place (m)."""
        return Descend(self.landing, self.fast_mps, self.slow_mps, self.slow_below_m, anchor_enu)

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        anchor = situation.anchor(self.anchor_enu)
        task = self if anchor is self.anchor_enu else self.at(anchor)
        height_m = situation.position_enu[2] - situation.home_enu[2]
        rate = self.fast_mps if height_m > self.slow_below_m else self.slow_mps
        way = situation.level_way_to(anchor)
        return task, Command(way, (0.0, 0.0, -rate), FOLLOW_GAIN_PER_S)


def sink(rate_mps: float) -> Descend:
    """The task of a pilot-flown mode whose throttle stick is at the bottom."""
    return Descend(False, rate_mps, rate_mps, 0.0)


class ReturnClimb(msgspec.Struct, frozen=True, gc=False):
    """First part of a return: climb to the return height at the present place.

    Attributes:
        height_m: Least height above home to fly home at, m.
        landing: How it lands at home.
        highest_m: Greatest height above home to fly home at, m; above it, it first descends.
        anchor_enu: Place to climb at, m; None while braking.
    """

    height_m: float
    landing: Descend
    highest_m: float = math.inf
    anchor_enu: Vector | None = None

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        height_m = situation.position_enu[2] - situation.home_enu[2]
        climb_m = min(max(self.height_m, height_m), self.highest_m) - height_m
        if abs(climb_m) < REACHED_M:
            return ReturnCruise(situation.position_enu[2], self.landing).fly(situation)
        anchor = situation.anchor(self.anchor_enu)
        x, y, _ = situation.level_way_to(anchor)
        same = anchor is self.anchor_enu
        task = self if same else ReturnClimb(self.height_m, self.landing, self.highest_m, anchor)
        return task, Command((x, y, climb_m), _STILL, FOLLOW_GAIN_PER_S)


class ReturnCruise(msgspec.Struct, frozen=True, gc=False):
    """Second part of a return: fly home at a constant height, then land.

    Attributes:
        up_m: Up coordinate to fly at, m.
        landing: How it lands at home.
    """

    up_m: float
    landing: Descend

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        x, y, _ = situation.home_enu
        way = situation.way_to((x, y, self.up_m))
        if math.hypot(way[0], way[1]) < HOME_REACHED_M and situation.stopped():
            return self.landing.at(situation.home_enu).fly(situation)
        return self, Command(way, _STILL, FOLLOW_GAIN_PER_S)
