"""The emitter moves with constant velocity, disturbed by white acceleration.

State ``x = [e, v]`` in d axes, (..., 2d). The acceleration of axis i is white with power
spectral density ``q_i`` (m²/s³): in a second the velocity walks sqrt(q_i) m/s.
"""

from __future__ import annotations

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import Array


def transition(dt: float, d: int) -> Array:
    """F = [[I, dt I], [0, I]], (2d, 2d).

    Args:
        dt: Step, s; negative to go back.
        d: Number of axes.
    """
    return np.eye(2 * d) + dt * np.eye(2 * d, k=d)


def process_noise(dt: float, psd: Array) -> Array:
    """Q = [[dt³/3, dt²/2], [dt²/2, dt]] x diag(q), the exact integral of F q Fᵀ.

    Args:
        dt: Step, s, >= 0.
        psd: Spectral density of the acceleration per axis, (d,), m²/s³, >= 0.

    Returns:
        (2d, 2d).

    Raises:
        EstimationError: dt or a density is negative or not finite.
    """
    if psd.ndim != 1 or not (psd.min() >= 0.0 and psd.max() < np.inf):
        raise EstimationError(
            f"process noise must be d finite numbers >= 0, one per axis, not {psd.tolist()}."
        )
    if not 0.0 <= dt < np.inf:
        raise EstimationError(f"dt must be a finite number >= 0, not {dt!r}.")
    steps = np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    Q: Array = steps[:, None, :, None] * np.diag(psd)[:, None, :]
    return Q.reshape(2 * psd.size, 2 * psd.size)


def transport(x: Array, P: Array, dt: float) -> tuple[Array, Array]:
    """State and covariance expressed at another epoch, without process noise.

    Args:
        x: (..., 2d).
        P: (..., 2d, 2d).
        dt: Seconds ahead; negative to go back.

    Returns:
        F x and F P Fᵀ.
    """
    F = transition(dt, x.shape[-1] // 2)
    return np.matvec(F, x), F @ P @ F.T


def predict(x: Array, P: Array, dt: float, psd: Array) -> tuple[Array, Array]:
    """The time update, Eqs. (10) and (11): F x and F P Fᵀ + Q.

    Args:
        x: (..., 2d).
        P: (..., 2d, 2d).
        dt: Step, s, >= 0.
        psd: Spectral density of the acceleration per axis, (d,), m²/s³.

    Returns:
        Predicted x and P.

    Raises:
        EstimationError: As :func:`process_noise`.
    """
    Q = process_noise(dt, psd)
    x, P = transport(x, P, dt)
    return x, P + Q
