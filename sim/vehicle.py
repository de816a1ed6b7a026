"""One simulated UAV: its airframe, its autopilot, its wind and its errors."""

from __future__ import annotations

from sim.autopilots import AUTOPILOTS
from sim.autopilots.onboard_state import Installation
from sim.config import SimConfig, VehicleConfig
from sim.dynamics import Command, State, step
from sim.navigation_errors import NavigationErrors
from sim.noise import Normals, generator
from sim.vehicle_clock import VehicleClock
from sim.wind import Wind
from swarmctl.frames import LocalFrame
from swarmctl.units import Vector


class Vehicle:
    """One UAV.

    Args:
        config: The UAV.
        sim: The simulation.
        frame: Frame of the simulated world.
        step_s: Time between calls of :meth:`advance`, s.

    Attributes:
        config: The UAV.
        autopilot: Its autopilot.
        state: True state of the airframe.
    """

    __slots__ = (
        "_command",
        "_frame",
        "_navigation",
        "_step_s",
        "_wind",
        "autopilot",
        "config",
        "state",
    )

    def __init__(
        self, config: VehicleConfig, sim: SimConfig, frame: LocalFrame, step_s: float
    ) -> None:
        self.config = config
        self._frame = frame
        self._step_s = step_s
        self._wind = Wind(sim.wind, step_s, Normals(generator(sim.seed, "gust", config.sysid)))
        self._navigation = NavigationErrors(
            sim.navigation, step_s, generator(sim.seed, "navigation", config.sysid)
        )
        self.state = State(
            frame.to_enu(config.launch_lat_rad, config.launch_lon_rad, config.launch_alt_amsl_m)
        )
        self._command: Command | None = None
        clock = VehicleClock(
            config.clock, sim.utc_start_s, generator(sim.seed, "clock", config.sysid)
        )
        installation = Installation(config, frame, clock, self._navigation, self.state)
        self.autopilot = AUTOPILOTS[config.autopilot](installation)

    def advance(self, now_s: float) -> None:
        """Simulate the step that ends at a simulation time (s)."""
        wind_enu = self._wind.advance()
        self._navigation.advance()
        self.state = step(
            self.state,
            self._command,
            wind_enu,
            self.config.limits,
            self.ground_up_m(),
            self._step_s,
        )
        self._command = self.autopilot.advance(now_s, self.state)

    def ground_up_m(self) -> float:
        """Up coordinate of the ground below, m: the ground is level with the launch point."""
        x, y, _ = self.state.position_enu
        return self._frame.up_at(x, y, self.config.launch_alt_amsl_m)

    @property
    def navigation_error_enu(self) -> Vector:
        """Position in the autopilot's own solution minus the true position, m."""
        return self._navigation.correlated_enu
