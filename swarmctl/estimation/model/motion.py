"""How the emitter moves between two epochs: constant velocity, or constant acceleration.

A state of order n in a axes is ``[position, velocity, ...]``, (..., n a): order 2 is constant
velocity (CV), order 3 constant acceleration (CA). Both are disturbed by noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.units import Array


def transition(dt: float, axes: int, order: int = 2) -> Array:
    """F of Eq. (7): block (i, j) is ``dt^(j-i) / (j-i)! I``, (order axes, order axes).

    Args:
        dt: Step, s; negative to go back.
        axes: Number of axes.
        order: Number of blocks: 2 for CV, 3 for CA.
    """
    F = np.eye(order * axes)
    for k in range(1, order):
        F += dt**k / math.factorial(k) * np.eye(order * axes, k=k * axes)
    return F


def process_noise(dt: float, psd: Array) -> Array:
    """Q = [[dt³/3, dt²/2], [dt²/2, dt]] x diag(q): the exact integral of F q Fᵀ for CV.

    The acceleration of axis i is white with the power spectral density ``q_i``: in a second
    the velocity walks sqrt(q_i) m/s.

    Args:
        dt: Step, s, >= 0.
        psd: Spectral density of the acceleration per axis, (a,), m²/s³, >= 0.

    Returns:
        (2a, 2a).

    Raises:
        EstimationError: dt or a density is negative or not finite.
    """
    _require_densities("process noise", psd)
    _require_step(dt)
    steps = np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    Q: Array = steps[:, None, :, None] * np.diag(psd)[:, None, :]
    return Q.reshape(2 * psd.size, 2 * psd.size)


class Motion(Protocol):
    """A linear motion model with additive noise: ``x' = F x + w``, ``w ~ N(0, Q)``."""

    @property
    def size(self) -> int:
        """Length of the state."""

    def step(self, dt: float) -> tuple[Array, Array]:
        """F and Q of a step of ``dt`` seconds.

        Raises:
            EstimationError: dt is negative or not finite.
        """


@dataclass(frozen=True)
class ConstantVelocity:
    """Constant velocity with white acceleration, state [position, velocity].

    Args:
        psd: Spectral density of the acceleration per axis, m²/s³, >= 0.

    Raises:
        EstimationError: A density is negative or not finite.
    """

    psd: Sequence[float]

    def __post_init__(self) -> None:
        _require_densities("process noise", np.asarray(self.psd, dtype=np.float64))

    @property
    def size(self) -> int:
        """Length of the state."""
        return 2 * len(self.psd)

    def step(self, dt: float) -> tuple[Array, Array]:
        """As :meth:`Motion.step`."""
        _require_step(dt)
        return _constant_velocity(dt, tuple(self.psd))


@dataclass(frozen=True)
class ConstantAcceleration:
    """Constant acceleration whose value jumps at each step, Eq. (7) with Table 1's Q.

    Table 1 gives Q one number per axis: it is the acceleration block, and per *step*.

    Args:
        variance: Variance of the jump per axis, (m/s²)², >= 0.

    Raises:
        EstimationError: A variance is negative or not finite.
    """

    variance: Sequence[float]

    def __post_init__(self) -> None:
        _require_densities("variance", np.asarray(self.variance, dtype=np.float64))

    @property
    def size(self) -> int:
        """Length of the state."""
        return 3 * len(self.variance)

    def step(self, dt: float) -> tuple[Array, Array]:
        """As :meth:`Motion.step`."""
        return _constant_acceleration(dt, tuple(self.variance))


def transport(x: Array, P: Array, dt: float) -> tuple[Array, Array]:
    """A CV state and its covariance expressed at another epoch, without process noise.

    Args:
        x: (..., 2a).
        P: (..., 2a, 2a).
        dt: Seconds ahead; negative to go back.

    Returns:
        F x and F P Fᵀ.
    """
    F = transition(dt, x.shape[-1] // 2)
    return np.matvec(F, x), F @ P @ F.T


def predict(x: Array, P: Array, dt: float, psd: Array) -> tuple[Array, Array]:
    """The CV time update, Eqs. (10) and (11): F x and F P Fᵀ + Q.

    Args:
        x: (..., 2a).
        P: (..., 2a, 2a).
        dt: Step, s, >= 0.
        psd: Spectral density of the emitter's acceleration per axis, (a,), m²/s³.

    Returns:
        Predicted x and P.

    Raises:
        EstimationError: As :func:`process_noise`.
    """
    Q = process_noise(dt, psd)
    x, P = transport(x, P, dt)
    return x, P + Q


# Epochs are mostly a fixed step apart; making F and Q costs a tenth of a live update.
@lru_cache(maxsize=64)
def _constant_velocity(dt: float, psd: tuple[float, ...]) -> tuple[Array, Array]:
    return _fixed(transition(dt, len(psd)), process_noise(dt, np.array(psd)))


@lru_cache(maxsize=64)
def _constant_acceleration(dt: float, variance: tuple[float, ...]) -> tuple[Array, Array]:
    _require_step(dt)
    axes = len(variance)
    return _fixed(transition(dt, axes, 3), np.diag([*[0.0] * (2 * axes), *variance]))


def _fixed(F: Array, Q: Array) -> tuple[Array, Array]:
    F.flags.writeable = Q.flags.writeable = False  # all who ask get the same two
    return F, Q


def _require_densities(name: str, values: Array) -> None:
    # Written so that NaN fails too.
    if values.ndim != 1 or values.size == 0 or not (values.min() >= 0.0 and values.max() < np.inf):
        raise EstimationError(
            f"{name} must be finite numbers >= 0, one per axis, not {values.tolist()}."
        )


def _require_step(dt: float) -> None:
    if not 0.0 <= dt < np.inf:
        raise EstimationError(f"dt must be a finite number >= 0, not {dt!r}.")
