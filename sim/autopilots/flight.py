"""How all simulated autopilots fly: modes, arming, landing and the fence, step by step.

Each personality fills in what it does of its own accord; what it is told by MAVLink is
:mod:`sim.autopilots.autopilot`'s.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import ClassVar

from sim import setpoints
from sim.dynamics import Command, State
from sim.fence import Fence
from sim.guidance import FlyAcceleration, FlyVelocity, Task
from sim.manners import Manners
from sim.mavlink import ACCEPTED, Codec, Message, dialect
from sim.modes import FlightMode
from sim.onboard import Onboard
from sim.plans import FENCE, Plans, TransferManners, fence_shapes

RESTRAINED = (FlyVelocity, FlyAcceleration)
"""What is held back at the fence; positions beyond it are not taken at all."""


class Flight(ABC):
    """The flying half of an autopilot.

    Args:
        onboard: What it knows about itself.
    """

    manners: ClassVar[Manners]
    transfer: ClassVar[TransferManners]

    def __init__(self, onboard: Onboard) -> None:
        self._me = onboard
        self._codec = Codec(onboard.config.sysid, onboard.config.signing_key)
        self._plans = Plans(self.transfer, self._codec.send)
        self._fence = Fence()
        self._fence_of: object = None

    # --- What a personality fills in ---------------------------------------------------

    @abstractmethod
    def _watch(self) -> None:
        """Look after the failsafes, once a step."""

    @abstractmethod
    def _arming_refusal(self) -> str | None:
        """Why it does not arm now; None if it does."""

    @abstractmethod
    def _idle_limit_s(self) -> float:
        """Armed on the ground with nothing to do for so long, it disarms."""

    @abstractmethod
    def _may_lift(self) -> bool:
        """Whether what it does takes it off the ground."""

    @abstractmethod
    def _build_fence(self) -> Fence:
        """The fence that its parameters and its plan make."""

    @abstractmethod
    def _speed_limit_mps(self) -> float:
        """Greatest horizontal speed it allows itself, m/s."""

    # --- Step by step ------------------------------------------------------------------

    def _live(self, now_s: float, truth: State) -> Command | None:
        """Live through one time step; returns what the airframe is to do."""
        me = self._me
        step_s = now_s - me.now_s
        me.now_s, me.truth = now_s, truth
        self._codec.advance(me.clock.kept_utc_s(now_s))
        lost_s = me.config.gps_lost_at_s
        me.gps_ok = lost_s is None or now_s < lost_s
        if me.home_enu is None and me.up_s >= me.timeline.home_set_s:
            me.set_home_here()
            me.origin_enu = me.home_enu
        me.draw(step_s)
        me.detect_landing()
        self._watch()
        self._disarm_on_ground()
        me.turn(step_s)
        return self._fly()

    def _fly(self) -> Command | None:
        me = self._me
        if not me.armed or me.home_enu is None:
            return None
        if me.landed and not self._may_lift():
            return None
        me.task, command = me.task.fly(me.situation(me.home_enu))
        if command is None:
            return None
        velocity = command.velocity_enu
        if isinstance(me.task, RESTRAINED):
            velocity = self.fence().restrain(me.position_enu, velocity, self._fence_margin_m())
        return Command(command.error_enu, velocity, command.gain_per_s, self._speed_limit_mps())

    def _disarm_on_ground(self) -> None:
        me = self._me
        if not me.armed or not me.landed or self._may_lift():
            return
        if me.now_s - me.idle_since_s >= self._idle_limit_s():
            me.armed = False

    # --- Modes and arming --------------------------------------------------------------

    def _enter(self, mode: FlightMode) -> int:
        """Change the mode; what it does changes only if the mode does."""
        me = self._me
        if mode is not me.mode:
            me.mode, me.task = mode, mode.task(me.parameters)
        return ACCEPTED

    def _arm(self) -> int:
        me = self._me
        if me.armed:
            return ACCEPTED
        refusal = self._arming_refusal()
        if refusal is not None:
            self._say(refusal)
            return self.manners.refused
        me.armed, me.flown, me.idle_since_s = True, False, me.now_s
        me.set_home_here()
        me.task = me.mode.task(me.parameters)
        return ACCEPTED

    def _disarm(self, *, forced: bool) -> int:
        me = self._me
        if me.armed and not me.landed and not forced:
            return self.manners.refused
        me.armed = False
        return ACCEPTED

    def _follow(self, task: Task, message: Message) -> None:
        """Fly what a setpoint asks for, turned as it asks."""
        me = self._me
        me.task = task
        yaw = setpoints.setpoint_yaw(message, me.yaw_rad)
        if yaw is not None:
            me.wanted_yaw_rad = yaw
        me.yaw_rate_radps = setpoints.setpoint_yaw_rate(message) if yaw is None else 0.0

    def _say(self, text: str, severity: int = dialect.MAV_SEVERITY_CRITICAL) -> None:
        self._codec.send(dialect.MAVLink_statustext_message(severity, text.encode()[:50]))

    # --- Fence -------------------------------------------------------------------------

    def _fence_margin_m(self) -> float:
        """Distance from the fence at which a velocity setpoint stops, m."""
        return 0.0

    def fence(self) -> Fence:
        """The fence in force."""
        me = self._me
        made_of = (me.parameters.changes, self._plans.changes, me.home_enu)
        if made_of != self._fence_of:
            self._fence, self._fence_of = self._build_fence(), made_of
        return self._fence

    def _planned_fence(self, ceiling_up_m: float, circle_m: float) -> Fence:
        """The uploaded fence with a ceiling and a circle around home (infinite for none), m."""
        me = self._me

        def to_enu(lat_e7: int, lon_e7: int) -> tuple[float, float]:
            lat, lon = math.radians(lat_e7 * 1e-7), math.radians(lon_e7 * 1e-7)
            return me.frame.to_enu(lat, lon, me.home_alt_amsl_m)[:2]

        inside, outside, within, without = fence_shapes(self._plans.stored(FENCE), to_enu)
        if me.home_enu is not None and math.isfinite(circle_m):
            within.append((me.home_enu[0], me.home_enu[1], circle_m))
        return Fence(tuple(inside), tuple(outside), tuple(within), tuple(without), ceiling_up_m)

    def _is_outside(self) -> bool:
        """Whether it flies on the wrong side of its fence."""
        me = self._me
        return me.armed and not me.landed and not self.fence().contains(me.position_enu)
