"""Random draws of the simulation: normal deviates in blocks, and first-order Gauss-Markov.

Each consumer has its own generator (:func:`generator`), so that the draws of one vehicle do not
depend on those of another.
"""

from __future__ import annotations

import math
import zlib

import numpy as np

from swarmctl.units import Vector

BLOCK = 1024
"""Number of deviates drawn at once: one call of numpy costs as much as thirty scalar draws."""


def generator(seed: int, purpose: str, sysid: int = 0) -> np.random.Generator:
    """An independent generator for one purpose of one vehicle.

    Args:
        seed: Seed of the simulation.
        purpose: What is drawn from it, for example ``gust``.
        sysid: System id of the vehicle; 0 for a purpose that belongs to none.
    """
    return np.random.default_rng((seed, zlib.crc32(purpose.encode()), sysid))


class Normals:
    """Standard normal deviates, one at a time, as plain floats.

    Args:
        rng: Generator that nothing else uses.
    """

    __slots__ = ("_block", "_rng")

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._block: list[float] = []

    def draw(self) -> float:
        """The next deviate."""
        if not self._block:
            self._block = self._rng.standard_normal(BLOCK).tolist()
        return self._block.pop()


class GaussMarkov:
    """Stationary first-order Gauss-Markov process on three independent axes.

    Exactly discretised: ``x(t + h) = phi x(t) + sigma sqrt(1 - phi²) w`` with
    ``phi = exp(-h / tau)``, so that its variance is sigma² whatever the step. It starts in its
    stationary distribution.

    Args:
        sigma: Standard deviation per axis, in the unit of ``value``.
        tau_s: Correlation time, s.
        step_s: Time between calls of :meth:`advance`, s.
        normals: Source of its deviates.

    Attributes:
        value: The process now.
    """

    __slots__ = ("_drive", "_normals", "_phi", "value")

    def __init__(self, sigma: float, tau_s: float, step_s: float, normals: Normals) -> None:
        self._phi = math.exp(-step_s / tau_s)
        self._drive = sigma * math.sqrt(1.0 - self._phi * self._phi)
        self._normals = normals
        draw = normals.draw
        self.value: Vector = (sigma * draw(), sigma * draw(), sigma * draw())

    def advance(self) -> None:
        """Move on by one step."""
        drive = self._drive
        if drive == 0.0:
            return
        phi, draw = self._phi, self._normals.draw
        x, y, z = self.value
        self.value = (
            phi * x + drive * draw(),
            phi * y + drive * draw(),
            phi * z + drive * draw(),
        )
