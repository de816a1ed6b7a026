"""What a simulated autopilot knows about itself: read by telemetry, changed by the autopilot."""

from __future__ import annotations

from dataclasses import dataclass, field

from sim import modes
from sim.config import VehicleConfig
from sim.dynamics import State
from sim.guidance import Situation, Task
from sim.modes import FlightMode
from sim.navigation import PositionError
from swarmctl.frames import LocalFrame, Vector

GPS_FIX_S = 1.0
"""Time from power-up to the GPS fix, and with it to UTC (ArduCopter: 10 s)."""
HOME_SET_S = 2.0
"""Time from power-up to a position, origin and home (ArduCopter: 20 s)."""
ARMABLE_S = 4.0
"""Time from power-up until arming checks pass (ArduCopter: 43 s)."""


@dataclass(slots=True)
class Onboard:
    """State of one autopilot.

    Attributes:
        config: The UAV.
        frame: Frame of the simulated world.
        utc_start_s: UTC at simulation time 0, s.
        navigation: Error of its positions.
        truth: True state of the airframe.
        now_s: Simulation time of ``truth``, s.
        mode: Flight mode.
        task: What it does when in the air.
        armed: Whether the motors are armed.
        landed: Whether it knows itself on the ground (ArduCopter's ``land_complete``).
        contact_s: Simulation time since which the airframe touches the ground; None in the air.
        idle_since_s: Simulation time since which it stands armed on the ground with nothing to
            do, s.
        origin_enu: Origin of its local frame, m; None before it has a position.
        home_enu: Home, m; None before it has a position.
        home_alt_amsl_m: Altitude of home, m.
        yaw_rad: Heading, clockwise from north, rad.
        wanted_yaw_rad: Heading it turns to, rad.
        charge: Battery charge left, 0..1.
    """

    config: VehicleConfig
    frame: LocalFrame
    utc_start_s: float
    navigation: PositionError
    truth: State
    now_s: float = 0.0
    mode: FlightMode = modes.STABILIZE
    task: Task = field(default_factory=lambda: modes.STABILIZE.task)
    armed: bool = False
    landed: bool = True
    contact_s: float | None = 0.0
    idle_since_s: float = 0.0
    origin_enu: Vector | None = None
    home_enu: Vector | None = None
    home_alt_amsl_m: float = 0.0
    yaw_rad: float = 0.0
    wanted_yaw_rad: float = 0.0
    charge: float = 1.0

    @property
    def boot_s(self) -> float:
        """Time since power-up, s."""
        return self.now_s - self.config.boot_delay_s

    @property
    def position_enu(self) -> Vector:
        """Position in the autopilot's own solution, m."""
        (x, y, z), (ex, ey, ez) = self.truth.position_enu, self.navigation.correlated_enu
        return (x + ex, y + ey, z + ez)

    def situation(self, home_enu: Vector) -> Situation:
        """What guidance goes by; the velocity's error is negligible."""
        return Situation(self.now_s, self.position_enu, self.truth.velocity_enu, home_enu)

    def set_home_here(self) -> None:
        """Take the present position for home."""
        self.home_enu = self.position_enu
        self.home_alt_amsl_m = self.frame.to_geodetic(*self.home_enu)[2]

    @property
    def prearm_ok(self) -> bool:
        """Whether it says it would arm."""
        return self.boot_s >= ARMABLE_S and self.mode.can_arm
