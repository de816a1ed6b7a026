"""How all simulated autopilots fly, step by step: modes, arming, disarming, mission and fence.

A subclass per autopilot fills in what differs. Messages and commands arrive in
:mod:`sim.autopilots.autopilot` and :mod:`sim.autopilots.command_handler`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

from sim.autopilots import setpoints
from sim.autopilots.flight_modes import FlightMode
from sim.autopilots.flight_tasks import Task
from sim.autopilots.geofence import Fence
from sim.autopilots.mission_flight import FlyLegs, Pace, legs_of
from sim.autopilots.mission_items import FENCE, MISSION, fence_shapes
from sim.autopilots.mission_protocol import MissionProtocol, UploadTraits
from sim.autopilots.onboard_state import OnboardState
from sim.autopilots.telemetry import mission_current
from sim.autopilots.traits import Traits
from sim.dynamics import Command, State
from sim.mavlink import ACCEPTED, Codec, Message, dialect
from swarmctl.units import Vector


class Flight(ABC):
    """The flying half of an autopilot.

    Args:
        onboard: State of the autopilot.
    """

    traits: ClassVar[Traits]
    transfer: ClassVar[UploadTraits]

    def __init__(self, onboard: OnboardState) -> None:
        self._me = onboard
        self._codec = Codec(onboard.config.sysid, onboard.config.signing_key)
        self._uploads = MissionProtocol(self.transfer, self._codec.send)
        self._fences: Mapping[str, Fence] = {}
        self._fences_of: object = None
        self._items: object = None
        self._legs_announced = 0

    # --- What a subclass fills in ------------------------------------------------------

    @abstractmethod
    def _watch(self) -> None:
        """Check the failsafes, once per step."""

    @abstractmethod
    def _arming_refusal(self) -> str | None:
        """Why it refuses to arm now; None if it arms."""

    @abstractmethod
    def _idle_limit_s(self) -> float:
        """Time after which it disarms if it stands armed on the ground with nothing to do, s."""

    @abstractmethod
    def _may_lift(self) -> bool:
        """Whether its task takes it off the ground."""

    @abstractmethod
    def _build_fences(self) -> Mapping[str, Fence]:
        """The fences that its parameters and the upload make, by the autopilot's names for them."""

    @abstractmethod
    def _pace(self) -> Pace:
        """How it flies its missions."""

    @abstractmethod
    def _speed_limit_mps(self) -> float:
        """Greatest horizontal speed it allows itself, m/s."""

    # --- Step by step ------------------------------------------------------------------

    def _live(self, now_s: float, truth: State) -> Command | None:
        """Simulate one time step; returns the command to the airframe."""
        me = self._me
        step_s = now_s - me.now_s
        me.now_s, me.truth = now_s, truth
        if me.config.signing_key is not None:
            self._codec.advance(me.clock.kept_utc_s(now_s))
        me.gps_ok = me.config.faults.gps_works(now_s)
        if me.home_enu is None and me.up_s >= me.boot_sequence.home_set_s:
            me.set_home_here()
            me.origin_enu = me.home_enu
        me.battery.draw(step_s, armed=me.armed)
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
        velocity = self._restrained(command.velocity_enu)
        return Command(command.error_enu, velocity, command.gain_per_s, self._speed_limit_mps())

    def _restrained(self, velocity_enu: Vector) -> Vector:
        """The part of a velocity (m/s) that the fences allow."""
        return velocity_enu

    def _disarm_on_ground(self) -> None:
        me = self._me
        if not me.armed or not me.landed or self._may_lift():
            return
        if me.now_s - me.idle_since_s >= self._idle_limit_s():
            me.armed = False

    # --- Modes and arming --------------------------------------------------------------

    def _enter(self, mode: FlightMode) -> int:
        """Change the mode; entering the present mode again does not restart its task."""
        me = self._me
        if mode is not me.mode:
            me.mode, me.task = mode, self._task_of(mode)
        return ACCEPTED

    def _task_of(self, mode: FlightMode) -> Task:
        """The task of a mode on entering it."""
        return mode.task(self._me.parameters)

    def _arm(self) -> int:
        me = self._me
        if me.armed:
            return ACCEPTED
        refusal = self._arming_refusal()
        if refusal is not None:
            self._say(refusal)
            return self.traits.refused
        me.armed, me.flown, me.idle_since_s = True, False, me.now_s
        me.set_home_here()
        me.task = self._task_of(me.mode)
        return ACCEPTED

    def _disarm(self, *, forced: bool) -> int:
        me = self._me
        if me.armed and not me.landed and not forced:
            return self.traits.refused
        me.armed = False
        return ACCEPTED

    def _follow(self, task: Task, message: Message) -> None:
        """Take over a setpoint's task, heading and turn rate."""
        me = self._me
        me.task = task
        yaw = setpoints.setpoint_yaw(message, me.yaw_rad)
        if yaw is not None:
            me.wanted_yaw_rad = yaw
        me.yaw_rate_radps = setpoints.setpoint_yaw_rate(message) if yaw is None else 0.0

    def _say(self, text: str, severity: int = dialect.MAV_SEVERITY_CRITICAL) -> None:
        self._codec.send(dialect.MAVLink_statustext_message(severity, text.encode()[:50]))

    # --- Mission -----------------------------------------------------------------------

    def _first_item(self) -> int:
        """Number of the first item that is flown."""
        return int(self.transfer.home_is_first)

    def _follow_mission(self, was_armed: bool) -> None:
        """Announce the item that is flown and those that are done; disarming starts over."""
        me, task, before = self._me, self._me.task, self._me.mission_seq
        has_landed = was_armed and not me.armed
        if was_armed and isinstance(task, FlyLegs):
            done = task.legs[self._legs_announced : task.at + has_landed]
            after = (*task.legs[self._legs_announced + 1 :], None)
            for leg, following in zip(done, after, strict=False):
                if following is None or following.seq != leg.seq:
                    self._codec.send(dialect.MAVLink_mission_item_reached_message(leg.seq))
            self._legs_announced = task.at + has_landed
            if task.leg is not None:
                me.mission_seq = task.leg.seq
        self._notice_new_mission(restart=has_landed)
        if me.mission_seq != before:
            self._codec.send(mission_current(me))

    def _notice_new_mission(self, *, restart: bool = False) -> None:
        """Start a newly uploaded mission at its first item; optionally the present one too."""
        items = self._uploads.stored(MISSION)
        if restart or items is not self._items:
            self._items, self._me.mission_seq = items, min(self._first_item(), len(items))

    def _mission(self) -> FlyLegs:
        """The uploaded mission from the present item on."""
        me = self._me
        self._notice_new_mission()
        self._legs_announced = 0
        items = self._uploads.stored(MISSION)
        return FlyLegs(legs_of(items, me.mission_seq, self._place), self._pace())

    def _place(self, lat_e7: int, lon_e7: int, alt_m: float, above_home: bool) -> Vector:
        """Place of a mission item, ENU, m; latitude and longitude of zero mean home."""
        me = self._me
        home = me.home_enu or me.position_enu
        alt = alt_m + me.home_alt_amsl_m if above_home else alt_m
        if (lat_e7, lon_e7) == (0, 0):
            return (*home[:2], me.frame.up_at(*home[:2], alt))
        return me.frame.to_enu(math.radians(lat_e7 * 1e-7), math.radians(lon_e7 * 1e-7), alt)

    # --- Fence -------------------------------------------------------------------------

    def fences(self) -> Mapping[str, Fence]:
        """The fences in force."""
        me = self._me
        made_of = (me.parameters.changes, self._uploads.changes, me.home_enu)
        if made_of != self._fences_of:
            self._fences, self._fences_of = self._build_fences(), made_of
        return self._fences

    def _allows(self, position_enu: Vector) -> bool:
        """Whether every fence allows a position, m."""
        return all(fence.contains(position_enu) for fence in self.fences().values())

    def _beyond_m(self) -> dict[str, float]:
        """The fences that the vehicle is on the wrong side of, and how far, m."""
        here = self._me.position_enu
        return {
            name: fence.beyond_m(here)
            for name, fence in self.fences().items()
            if not fence.contains(here)
        }

    def _home_circle(self, radius_m: float) -> Fence:
        """A fence around home."""
        home = self._me.home_enu
        return Fence() if home is None else Fence(circles_inside=((*home[:2], radius_m),))

    def _uploaded_fence(self) -> Fence:
        """The uploaded fence."""
        me = self._me

        def to_enu(lat_e7: int, lon_e7: int) -> tuple[float, float]:
            lat, lon = math.radians(lat_e7 * 1e-7), math.radians(lon_e7 * 1e-7)
            return me.frame.to_enu(lat, lon, me.home_alt_amsl_m)[:2]

        inside, outside, within, without = fence_shapes(self._uploads.stored(FENCE), to_enu)
        return Fence(tuple(inside), tuple(outside), tuple(within), tuple(without))
