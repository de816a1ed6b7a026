"""What the autopilot is doing in the air: tasks that turn a situation into a command.

A task is a frozen value; :meth:`Task.fly` returns the command for this step and the task for
the next one, which is how a climb becomes a cruise and a cruise a landing. Everything in ENU
and SI, in the autopilot's own solution: what it believes, not what is true.

Times and speeds are ArduCopter's defaults.
"""

from __future__ import annotations

import math
from typing import Protocol

import msgspec

from sim.dynamics import Command
from swarmctl.frames import Vector

FOLLOW_GAIN_PER_S = 1.0
"""Of a setpoint with velocity feed-forward, and of holding a place."""
SETTLE_GAIN_PER_S = 0.69
"""Of a setpoint without velocity: one moving at 4 m/s is followed 7.2 m behind."""
SETPOINT_TIMEOUT_S = 3.0
"""GUID_TIMEOUT: the velocity of a setpoint counts for so long."""
SPOOL_UP_S = 3.0
"""From the take-off command to the first movement."""
RETURN_HEIGHT_M = 15.0
"""RTL_ALT: height above home to fly home at, or higher if it already is."""
LAND_FAST_MPS = 1.5
LAND_SLOW_MPS = 0.5
LAND_SLOW_BELOW_M = 10.0
"""Height above home below which a landing slows down."""
SINK_MPS = 2.5
"""Descent of a pilot-flown mode whose throttle stick rests at the bottom."""
STOPPED_MPS = 0.3
"""Braking ends below this speed and the place reached is held."""
REACHED_M = 0.5
HOME_REACHED_M = 1.0

_STILL: Vector = (0.0, 0.0, 0.0)


class Situation(msgspec.Struct, frozen=True, gc=False):
    """Where the autopilot believes it is.

    Attributes:
        now_s: Simulation time, s.
        position_enu: Position, m.
        velocity_enu: Velocity, m/s.
        home_enu: Home, m.
    """

    now_s: float
    position_enu: Vector
    velocity_enu: Vector
    home_enu: Vector

    def stopped(self) -> bool:
        """Whether it stands still in the air, for the purpose of braking."""
        return math.hypot(*self.velocity_enu) < STOPPED_MPS

    def way_to(self, position_enu: Vector) -> Vector:
        """From here to a position, m."""
        (x, y, z), (px, py, pz) = self.position_enu, position_enu
        return (px - x, py - y, pz - z)

    def level_way_to(self, anchor_enu: Vector | None) -> Vector:
        """Horizontal way to a position, m; none without one, which leaves braking."""
        if anchor_enu is None:
            return _STILL
        x, y, _ = self.way_to(anchor_enu)
        return (x, y, 0.0)

    def anchor(self, anchor_enu: Vector | None) -> Vector | None:
        """The place to hold: the one given or, once stopped, this one."""
        if anchor_enu is None and self.stopped():
            return self.position_enu
        return anchor_enu


class Task(Protocol):
    """Something to do in the air."""

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """The task for the next step and the command for this one (None: rotors idle)."""


class Hold(msgspec.Struct, frozen=True, gc=False):
    """Stay: brake, then hold the place reached.

    Attributes:
        anchor_enu: Place to hold, m; None while braking.
    """

    anchor_enu: Vector | None = None

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        anchor = situation.anchor(self.anchor_enu)
        way = _STILL if anchor is None else situation.way_to(anchor)
        task = self if anchor is self.anchor_enu else Hold(anchor)
        return task, Command(way, _STILL, FOLLOW_GAIN_PER_S)


class FlyTo(msgspec.Struct, frozen=True, gc=False):
    """Follow a position setpoint, which moves on with its velocity until that times out.

    Attributes:
        position_enu: Position at ``set_s``, m; held for ever.
        velocity_enu: Its velocity, m/s; None where the setpoint had none.
        set_s: Simulation time the setpoint came, s.
    """

    position_enu: Vector
    velocity_enu: Vector | None
    set_s: float

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        if self.velocity_enu is None:
            way = situation.way_to(self.position_enu)
            return self, Command(way, _STILL, SETTLE_GAIN_PER_S)
        age = situation.now_s - self.set_s
        live = age <= SETPOINT_TIMEOUT_S
        moved = age if live else SETPOINT_TIMEOUT_S
        (x, y, z), (vx, vy, vz) = self.position_enu, self.velocity_enu
        way = situation.way_to((x + vx * moved, y + vy * moved, z + vz * moved))
        return self, Command(way, self.velocity_enu if live else _STILL, FOLLOW_GAIN_PER_S)


class FlyVelocity(msgspec.Struct, frozen=True, gc=False):
    """Follow a velocity setpoint; brake and hold when it times out.

    Attributes:
        velocity_enu: Velocity, m/s.
        set_s: Simulation time the setpoint came, s.
    """

    velocity_enu: Vector
    set_s: float

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        if situation.now_s - self.set_s > SETPOINT_TIMEOUT_S:
            return Hold().fly(situation)
        return self, Command(_STILL, self.velocity_enu, FOLLOW_GAIN_PER_S)


class TakeOff(msgspec.Struct, frozen=True, gc=False):
    """Spool up, then climb straight up.

    Attributes:
        target_enu: Position above the launch point to climb to, m.
        started_s: Simulation time of the command, s.
    """

    target_enu: Vector
    started_s: float

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        if situation.now_s - self.started_s < SPOOL_UP_S:
            return self, None
        way = situation.way_to(self.target_enu)
        if abs(way[2]) < REACHED_M:
            return Hold(self.target_enu).fly(situation)
        return self, Command(way, _STILL, FOLLOW_GAIN_PER_S)


class Descend(msgspec.Struct, frozen=True, gc=False):
    """Go straight down to the ground.

    Attributes:
        landing: Whether this is a landing, which slows down near the ground and disarms there,
            or a mode that sinks because nobody holds the stick.
        anchor_enu: Place to descend at, m; None while braking.
    """

    landing: bool
    anchor_enu: Vector | None = None

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        anchor = situation.anchor(self.anchor_enu)
        task = self if anchor is self.anchor_enu else Descend(self.landing, anchor)
        height_m = situation.position_enu[2] - situation.home_enu[2]
        if not self.landing:
            rate = SINK_MPS
        elif height_m > LAND_SLOW_BELOW_M:
            rate = LAND_FAST_MPS
        else:
            rate = LAND_SLOW_MPS
        way = situation.level_way_to(anchor)
        return task, Command(way, (0.0, 0.0, -rate), FOLLOW_GAIN_PER_S)


class ReturnClimb(msgspec.Struct, frozen=True, gc=False):
    """First leg of a return: climb to the return height where it is.

    Attributes:
        anchor_enu: Place to climb at, m; None while braking.
    """

    anchor_enu: Vector | None = None

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        climb_m = situation.home_enu[2] + RETURN_HEIGHT_M - situation.position_enu[2]
        if climb_m < REACHED_M:
            return ReturnCruise(situation.position_enu[2]).fly(situation)
        anchor = situation.anchor(self.anchor_enu)
        x, y, _ = situation.level_way_to(anchor)
        task = self if anchor is self.anchor_enu else ReturnClimb(anchor)
        return task, Command((x, y, climb_m), _STILL, FOLLOW_GAIN_PER_S)


class ReturnCruise(msgspec.Struct, frozen=True, gc=False):
    """Second leg of a return: fly home level; then land.

    Attributes:
        up_m: Up coordinate to fly at, m.
    """

    up_m: float

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        x, y, _ = situation.home_enu
        way = situation.way_to((x, y, self.up_m))
        if math.hypot(way[0], way[1]) < HOME_REACHED_M and situation.stopped():
            return Descend(True, situation.home_enu).fly(situation)
        return self, Command(way, _STILL, FOLLOW_GAIN_PER_S)
