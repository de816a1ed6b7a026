"""The emitter, a transmitter that drifts."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from sim.config import EmitterConfig
from sim.noise import Normals
from swarmctl.frames import LocalFrame
from swarmctl.units import Vector


class EmitterState(msgspec.Struct, frozen=True, gc=False):
    """True position (m) and velocity (m/s) of the emitter, ENU."""

    position_enu: Vector
    velocity_enu: Vector


class Emitter:
    """Drifts with a mean velocity and a random walk of the horizontal velocity.

    Its altitude AMSL changes only by the vertical part of the mean velocity: it follows the sea's
    surface, which curves away below the tangent plane.

    Args:
        config: Start and motion.
        frame: Frame of the simulated world.
        step_s: Time between calls of :meth:`advance`, s.
        rng: Generator that nothing else uses.

    Attributes:
        state: The emitter now.
    """

    __slots__ = ("_alt_amsl_m", "_frame", "_kick_mps", "_normals", "_step_s", "state")

    def __init__(
        self, config: EmitterConfig, frame: LocalFrame, step_s: float, rng: np.random.Generator
    ) -> None:
        self._frame = frame
        self._step_s = step_s
        self._kick_mps = config.wander_mps_per_sqrt_s * math.sqrt(step_s)
        self._normals = Normals(rng)
        self._alt_amsl_m = config.alt_amsl_m
        self.state = EmitterState(
            frame.to_enu(config.lat_rad, config.lon_rad, config.alt_amsl_m), config.velocity_enu
        )

    def advance(self) -> None:
        """Move on by one step."""
        (x, y, _), (vx, vy, vz) = self.state.position_enu, self.state.velocity_enu
        kick, dt = self._kick_mps, self._step_s
        new_x, new_y = vx + kick * self._normals.draw(), vy + kick * self._normals.draw()
        x, y = x + 0.5 * (vx + new_x) * dt, y + 0.5 * (vy + new_y) * dt
        self._alt_amsl_m += vz * dt
        self.state = EmitterState(
            (x, y, self._frame.up_at(x, y, self._alt_amsl_m)), (new_x, new_y, vz)
        )
