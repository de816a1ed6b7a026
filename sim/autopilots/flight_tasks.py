"""What an autopilot does in the air: tasks that turn its situation into a command.

A task is a frozen value. :meth:`Task.fly` returns the command for this step and the task for the
next one: so a climb becomes a cruise, and a cruise a landing. All positions are ENU (m) in the
autopilot's own solution, not the truth. The constants are ArduCopter's where a task has no value
of its own.
"""

from __future__ import annotations

import math
from typing import Protocol

import msgspec

from sim.dynamics import VELOCITY_GAIN_PER_S, Command
from swarmctl.units import Vector

FOLLOW_GAIN_PER_S = 1.0
"""Approach gain of a setpoint with velocity feed-forward, and of holding a place, 1/s."""
SETTLE_GAIN_PER_S = 0.69
"""Approach gain of a setpoint without velocity, 1/s: one at 4 m/s is followed 7.2 m behind."""
ACCELERATION_TIME_S = 1.0 / VELOCITY_GAIN_PER_S
"""An acceleration times this is the velocity error that makes the airframe accelerate so, s."""
STOPPED_MPS = 0.3
"""Below this speed braking ends and the present place is held, m/s."""
REACHED_M = 0.5
"""A place nearer than this is reached, m."""

AXES_GAIN_PER_S = 0.95
"""PX4's MPC_XY_P, 1/s."""
VERTICAL_DRIFT_MPS = 0.154
"""PX4 climbs at this rate if told a vertical velocity of zero (10 m in 65 s), m/s."""
LIFT_MPS = 0.1
"""A setpoint that climbs faster than this lifts a vehicle off the ground, m/s."""

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
        """Whether braking has ended."""
        return math.hypot(*self.velocity_enu) < STOPPED_MPS

    def way_to(self, position_enu: Vector) -> Vector:
        """Vector from here to a position, m."""
        (x, y, z), (px, py, pz) = self.position_enu, position_enu
        return (px - x, py - y, pz - z)

    def level_way_to(self, anchor_enu: Vector | None) -> Vector:
        """Horizontal vector to a position, m; zero without one, which brakes."""
        if anchor_enu is None:
            return _STILL
        x, y, _ = self.way_to(anchor_enu)
        return (x, y, 0.0)

    def anchor(self, anchor_enu: Vector | None) -> Vector | None:
        """The place to hold: the one given or, once stopped, the present one."""
        if anchor_enu is None and self.stopped():
            return self.position_enu
        return anchor_enu


class Task(Protocol):
    """A task in the air."""

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """The task for the next step and the command for this one (None: rotors idle)."""


class Hold(msgspec.Struct, frozen=True, gc=False):
    """Brake, then hold the place reached.

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
    """Follow a position setpoint, which moves with its velocity until that times out.

    Attributes:
        position_enu: Position at ``set_s``, m; it never times out.
        velocity_enu: Velocity of the setpoint, m/s; None if it has none.
        set_s: Simulation time at which the setpoint came, s.
        timeout_s: The velocity counts for this long, s.
    """

    position_enu: Vector
    velocity_enu: Vector | None
    set_s: float
    timeout_s: float

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        if self.velocity_enu is None:
            way = situation.way_to(self.position_enu)
            return self, Command(way, _STILL, SETTLE_GAIN_PER_S)
        age = situation.now_s - self.set_s
        live = age <= self.timeout_s
        moved = age if live else self.timeout_s
        (x, y, z), (vx, vy, vz) = self.position_enu, self.velocity_enu
        way = situation.way_to((x + vx * moved, y + vy * moved, z + vz * moved))
        return self, Command(way, self.velocity_enu if live else _STILL, FOLLOW_GAIN_PER_S)


class FlyVelocity(msgspec.Struct, frozen=True, gc=False):
    """Follow a velocity setpoint; brake and hold when it times out.

    Attributes:
        velocity_enu: Velocity, m/s.
        set_s: Simulation time at which the setpoint came, s.
        timeout_s: The setpoint counts for this long, s.
    """

    velocity_enu: Vector
    set_s: float
    timeout_s: float

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        if situation.now_s - self.set_s > self.timeout_s:
            return Hold().fly(situation)
        return self, Command(_STILL, self.velocity_enu, FOLLOW_GAIN_PER_S)


class FlyAcceleration(msgspec.Struct, frozen=True, gc=False):
    """Follow an acceleration setpoint; brake and hold when it times out.

    Attributes:
        acceleration_enu: Acceleration, m/s².
        set_s: Simulation time at which the setpoint came, s.
        timeout_s: The setpoint counts for this long, s.
    """

    acceleration_enu: Vector
    set_s: float
    timeout_s: float

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        if situation.now_s - self.set_s > self.timeout_s:
            return Hold().fly(situation)
        (vx, vy, vz), (ax, ay, az) = situation.velocity_enu, self.acceleration_enu
        h = ACCELERATION_TIME_S
        return self, Command(_STILL, (vx + ax * h, vy + ay * h, vz + az * h), FOLLOW_GAIN_PER_S)


class FlyAxes(msgspec.Struct, frozen=True, gc=False):
    """Follow a setpoint axis by axis, as PX4 does, while the mode lasts.

    Attributes:
        position_enu: Position, m; None on an axis without one.
        velocity_enu: Velocity, m/s, fed forward on an axis with a position; zero on an axis
            with neither.
    """

    position_enu: tuple[float | None, float | None, float | None]
    velocity_enu: Vector

    def fly(self, situation: Situation) -> tuple[Task, Command | None]:
        """See :class:`Task`."""
        (px, py, pz), (x, y, z) = self.position_enu, situation.position_enu
        vx, vy, vz = self.velocity_enu
        way = (
            0.0 if px is None else px - x,
            0.0 if py is None else py - y,
            0.0 if pz is None else pz - z,
        )
        climb = vz + VERTICAL_DRIFT_MPS if pz is None else vz
        return self, Command(way, (vx, vy, climb), AXES_GAIN_PER_S)

    def lifts(self, position_enu: Vector) -> bool:
        """Whether it makes a vehicle that stands at a position (m) leave the ground."""
        up = self.position_enu[2]
        return self.velocity_enu[2] > LIFT_MPS if up is None else up - position_enu[2] > REACHED_M
