"""The state of a simulated autopilot: mode, task, home, landing detection, heading.

Telemetry reads it; flight, commands and failsafes change it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from sim.autopilots.battery import Battery
from sim.autopilots.boot_sequence import QUICK, BootSequence
from sim.autopilots.flight_modes import FlightMode
from sim.autopilots.flight_tasks import FlyAxes, FlyVelocity, Situation, Task
from sim.autopilots.mission_flight import FlyLegs
from sim.autopilots.parameters import Parameters
from sim.autopilots.traits import Traits
from sim.config import VehicleConfig
from sim.dynamics import State
from sim.navigation_errors import NavigationErrors
from sim.vehicle_clock import VehicleClock
from swarmctl.frames import LocalFrame
from swarmctl.units import Vector

TOUCHDOWN_S = 1.0
"""Ground contact for this long is a landing, s."""
YAW_RATE_RADPS = math.radians(90.0)
"""Greatest turn rate, rad/s."""


class Installation(NamedTuple):
    """What a vehicle gives to its autopilot.

    Attributes:
        config: The UAV.
        frame: Frame of the simulated world.
        clock: Its clock.
        navigation: Errors of its positions; the vehicle advances them.
        truth: True state at the start.
    """

    config: VehicleConfig
    frame: LocalFrame
    clock: VehicleClock
    navigation: NavigationErrors
    truth: State


@dataclass(slots=True)
class OnboardState:
    """State of one autopilot.

    Attributes:
        config: The UAV.
        frame: Frame of the simulated world.
        clock: Its clock.
        navigation: Errors of its positions.
        truth: True state of the airframe.
        traits: Constant traits of its autopilot.
        parameters: Its parameters.
        power_up_s: Simulation time of power-up, past or to come, s.
        battery: Its battery.
        now_s: Simulation time of ``truth``, s.
        mode: Flight mode.
        task: Its task in the air.
        armed: Whether the motors are armed.
        landed: Whether it believes itself on the ground (ArduCopter's ``land_complete``).
        flown: Whether it left the ground since it was armed.
        failsafe: Whether HEARTBEAT shows a failsafe.
        mission_seq: Index of the mission item that is flown, or is next.
        contact_s: Simulation time since which the airframe touches the ground; None in the air.
        idle_since_s: Simulation time since which it stands armed on the ground with nothing to
            do, s.
        origin_enu: Origin of its local frame, m; None before it has a position.
        home_enu: Home, m; None before it has a position.
        home_alt_amsl_m: Altitude of home, m.
        yaw_rad: Heading, clockwise from north, rad.
        wanted_yaw_rad: Heading that it turns to, rad.
        yaw_rate_radps: Turn rate while it flies a velocity, rad/s clockwise.
        gps_ok: Whether its GPS works.
        boot_sequence: Times from power-up.
    """

    config: VehicleConfig
    frame: LocalFrame
    clock: VehicleClock
    navigation: NavigationErrors
    truth: State
    traits: Traits
    parameters: Parameters
    mode: FlightMode
    task: Task
    power_up_s: float
    battery: Battery
    now_s: float = 0.0
    armed: bool = False
    landed: bool = True
    flown: bool = False
    failsafe: bool = False
    mission_seq: int = 0
    contact_s: float | None = 0.0
    idle_since_s: float = 0.0
    origin_enu: Vector | None = None
    home_enu: Vector | None = None
    home_alt_amsl_m: float = 0.0
    yaw_rad: float = 0.0
    wanted_yaw_rad: float = 0.0
    yaw_rate_radps: float = 0.0
    gps_ok: bool = True
    boot_sequence: BootSequence = field(init=False)

    def __post_init__(self) -> None:
        self.boot_sequence = self.traits.boot if self.config.full_boot else QUICK

    @property
    def up_s(self) -> float:
        """True time since power-up, s."""
        return self.now_s - self.power_up_s

    @property
    def boot_s(self) -> float:
        """Time since power-up by its own clock, s."""
        return self.clock.elapsed_s(self.up_s)

    @property
    def doing(self) -> Task:
        """Its task in the air; during a mission, the task of the present leg."""
        task = self.task
        return task.doing or task if isinstance(task, FlyLegs) else task

    @property
    def gps_fix(self) -> bool:
        """Whether its GPS has a fix."""
        return self.gps_ok and self.up_s >= self.boot_sequence.gps_fix_s

    @property
    def position_ok(self) -> bool:
        """Whether its own solution is good enough to arm."""
        return self.gps_ok and self.up_s >= self.boot_sequence.armable_s

    @property
    def prearm_ok(self) -> bool:
        """Whether the pre-arm bit of SYS_STATUS is set."""
        return self.position_ok and self.mode.can_arm

    @property
    def position_enu(self) -> Vector:
        """Position in the autopilot's own solution, m."""
        (x, y, z), (ex, ey, ez) = self.truth.position_enu, self.navigation.correlated_enu
        return (x + ex, y + ey, z + ez)

    def situation(self, home_enu: Vector) -> Situation:
        """What tasks are given; the error of the velocity is neglected."""
        return Situation(self.now_s, self.position_enu, self.truth.velocity_enu, home_enu)

    def set_home_here(self) -> None:
        """Make the present position home."""
        self.home_enu = self.position_enu
        self.home_alt_amsl_m = self.frame.to_geodetic(*self.home_enu)[2]

    def detect_landing(self) -> None:
        """Notice a departure from the ground or a landing."""
        if not self.truth.on_ground:
            self.contact_s, self.landed, self.flown = None, False, True
            return
        if self.contact_s is None:
            self.contact_s = self.now_s
        if not self.landed and self.now_s - self.contact_s >= TOUCHDOWN_S:
            self.landed, self.idle_since_s = True, self.now_s

    def turn(self, step_s: float) -> None:
        """Turn to the wanted heading, or at the wanted rate, for a time step (s)."""
        if self.yaw_rate_radps != 0.0 and isinstance(self.task, FlyVelocity | FlyAxes):
            rate = max(-YAW_RATE_RADPS, min(YAW_RATE_RADPS, self.yaw_rate_radps))
            self.yaw_rad = self.wanted_yaw_rad = self.yaw_rad + rate * step_s
            return
        if self.yaw_rad == self.wanted_yaw_rad:
            return
        to_go = math.remainder(self.wanted_yaw_rad - self.yaw_rad, 2.0 * math.pi)
        if abs(to_go) <= YAW_RATE_RADPS * step_s:
            self.yaw_rad = self.wanted_yaw_rad
        else:
            self.yaw_rad += math.copysign(YAW_RATE_RADPS * step_s, to_go)
