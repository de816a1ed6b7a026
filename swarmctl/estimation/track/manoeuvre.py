"""An emitter that turns or stops: two motion models side by side.

This is the interacting multiple model (IMM; Blom, Bar-Shalom, "The interacting multiple model
algorithm for systems with Markovian switching coefficients", IEEE Trans. Automatic Control 33(8),
1988). Model 0 is the quiet one: constant velocity with the mission's process noise. Model 1 is a
manoeuvre: the velocity jumps on entering it and walks on while it lasts.

The probabilities follow the chain, but the moments of what leaves model 1 are merged into model 0
only once a manoeuvre is believed (:data:`BELIEVED`). Merged always, they would act on the quiet
model as a process noise far above its own. ``docs/explanation/track.md`` says why this does no
harm, and how well it works.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.units import Array

BELIEVED = 0.99
"""Probability from which a manoeuvre is taken for a fact: chance alone brings it above one half now
and then in quiet flight."""


@dataclass(frozen=True)
class Manoeuvre:
    """How the emitter may change its mind.

    Attributes:
        speed_mps: 1-sigma of the velocity's jump per axis, about the emitter's top speed, m/s.
        every_s: Mean time between two manoeuvres, s.
        lasts_s: Mean length of one, s.
        is_level: Whether it keeps its height: a car or a ship, where heights are estimated.

    Raises:
        EstimationError: A number is not finite and positive.
    """

    speed_mps: float
    every_s: float = 15.0
    lasts_s: float = 3.0
    is_level: bool = False

    def __post_init__(self) -> None:
        for name in ("speed_mps", "every_s", "lasts_s"):
            # Written so that NaN fails too.
            if not 0.0 < getattr(self, name) < math.inf:
                raise EstimationError(
                    f"{name} must be a finite number > 0, not {getattr(self, name)!r}."
                )

    def axes(self, d: int) -> int:
        """How many of ``d`` axes it happens along, the first ones."""
        return min(d, 2) if self.is_level else d

    def psd(self, d: int) -> Array:
        """Spectral density of the acceleration meanwhile, of ``d`` axes, (d,), m²/s³.

        The velocity walks by another top speed in 20 s. (A tenth to ten times that makes no
        difference that could be measured.)
        """
        return np.where(np.arange(d) < self.axes(d), self.speed_mps**2 / 20.0, 0.0)

    def switching(self, dt: float) -> Array:
        """Probability of model j, ``dt`` seconds after model i, (2, 2)."""
        total = 1.0 / self.every_s + 1.0 / self.lasts_s
        faded = -math.expm1(-dt * total) / total
        enter, leave = faded / self.every_s, faded / self.lasts_s
        return np.array([[1.0 - enter, enter], [leave, 1.0 - leave]])

    def mix(
        self, x: Array, P: Array, weight: Array, dt: float, d: int
    ) -> tuple[Array, Array, Array]:
        """What each model starts a step from.

        Args:
            x: States of the two models, (..., 2, n), ``[position, velocity, ...]``.
            P: Covariances, (..., 2, n, n).
            weight: Probability of each model, (..., 2).
            dt: Step, s.
            d: Axes.

        Returns:
            Mixed x and P, and the models' probabilities after the step, before its measurement.
        """
        joint = weight[..., :, None] * self.switching(dt)
        after: Array = joint.sum(-2)
        joint[..., 1, 0] *= weight[..., 1] > BELIEVED
        share = joint / joint.sum(-2, keepdims=True)  # (..., from, to)
        apart = x[..., 1, :] - x[..., 0, :]
        spread = apart[..., :, None] * apart[..., None, :]
        mixed = share.mT @ x
        flat = P.reshape(*P.shape[:-2], -1)
        covariance = (share.mT @ flat).reshape(P.shape)
        covariance = (
            covariance
            + (share[..., 0, :] * share[..., 1, :])[..., None, None] * (spread[..., None, :, :])
        )
        axes = np.arange(d, d + self.axes(d))
        covariance[..., 1, axes, axes] += (share[..., 0, 1] * self.speed_mps**2)[..., None]
        return mixed, covariance, after


def moment_match(x: Array, P: Array, weight: Array) -> tuple[Array, Array]:
    """Mean and covariance of a mixture.

    Args:
        x: (..., K, n).
        P: (..., K, n, n).
        weight: (..., K), of sum 1.

    Returns:
        (..., n) and (..., n, n).
    """
    mean: Array = np.vecmat(weight, x)
    off = x - mean[..., None, :]
    covariance = (weight[..., None, None] * (P + off[..., :, None] * off[..., None, :])).sum(-3)
    return mean, covariance
