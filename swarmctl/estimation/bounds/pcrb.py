"""The posterior Cramér-Rao bound (PCRB) of a track.

For ``x' = F x + w``, ``w ~ N(0, Q)`` and RDs ``r(e) + eps``, ``eps ~ N(0, C)``, no estimator's
error covariance is below P of the recursion (Tichavský, Muravchik, Nehorai, "Posterior
Cramér-Rao bounds for discrete-time nonlinear filtering", IEEE Trans. Signal Processing 46(5),
1998; linear motion, additive Gaussian noise):

    J <- (F J⁻¹ Fᵀ + Q)⁻¹,        J <- J + Hᵀ C⁻¹ H,        P = J⁻¹

with H the RDs' Jacobian at the *true* positions and C the effective covariance of the RDs at
the *measured* ones (:func:`~swarmctl.estimation.model.range_difference.effective_covariance`).

It is kept as P, not as J: an exactly known axis (zero prior variance, Q = 0) has no finite J,
and Q is singular as soon as one axis has no process noise. C always has an inverse. The update
has Joseph's form, a sum of two positive semi-definite terms, so tight axes next to loose ones
(1 m beside 400 m) stay harmless.

The bound is conditional on the trajectory it is given. Averaged over an ensemble drawn from
the prior it is what that ensemble's mean squared error compares with.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import as_finite, as_not_negative
from swarmctl.estimation.model.motion import Motion
from swarmctl.estimation.model.range_difference import effective_covariance, jacobian
from swarmctl.units import Array


class CramerRaoBound:
    """The recursion, one epoch at a time.

    Attributes:
        covariance: The bound P of the state, (..., n, n), its first d entries the position.

    Args:
        prior_covariance: Covariance of the prior, (..., n, n), positive semi-definite.
        motion: The emitter's motion, a state of n.

    Raises:
        EstimationError: A shape is wrong, a number not finite, or the prior not positive
            semi-definite.
    """

    def __init__(self, prior_covariance: ArrayLike, motion: Motion) -> None:
        self._motion = motion
        n = motion.size
        prior = as_finite("prior_covariance", prior_covariance, n, n)
        smallest = np.linalg.eigvalsh(prior).min()
        if smallest < -1e-9 * np.abs(prior).max():
            raise EstimationError("prior_covariance must be positive semi-definite.")
        self.covariance: Array = prior

    def predict(self, dt: float) -> None:
        """Let time pass.

        Args:
            dt: Seconds, >= 0.

        Raises:
            EstimationError: dt is negative or not finite.
        """
        F, Q = self._motion.step(dt)
        self.covariance = F @ self.covariance @ F.T + Q

    def update(
        self,
        emitter: ArrayLike,
        reference: ArrayLike,
        companions: ArrayLike,
        rd_covariance: ArrayLike,
        sigma_p: float,
    ) -> None:
        """Account for the RDs of one epoch.

        Args:
            emitter: True position of the emitter, (..., d), m.
            reference: True position of the reference UAV, (..., d), m.
            companions: True positions of the companions, (..., N, d), m.
            rd_covariance: Covariance of the receivers' RD noise, (..., N, N), m².
            sigma_p: 1-sigma of the measured UAV positions per axis, m.

        Raises:
            EstimationError: A shape is wrong, a number not finite, or sigma_p negative.
        """
        emitter = as_finite("emitter", emitter, None)
        d = emitter.shape[-1]
        companions = as_finite("companions", companions, None, d)
        n = companions.shape[-2]
        C = effective_covariance(
            as_finite("rd_covariance", rd_covariance, n, n), as_not_negative("sigma_p", sigma_p)
        )
        J = jacobian(emitter, as_finite("reference", reference, d), companions)
        padding = np.zeros((*J.shape[:-1], self._motion.size - d))
        H = np.concatenate([J, padding], axis=-1)
        PH = self.covariance @ H.mT
        gain = np.linalg.solve(H @ PH + C, PH.mT).mT
        rest = np.eye(self._motion.size) - gain @ H
        P = rest @ self.covariance @ rest.mT + gain @ C @ gain.mT
        self.covariance = 0.5 * (P + P.mT)


def pcrb(
    prior_covariance: ArrayLike,
    motion: Motion,
    epochs_s: ArrayLike,
    emitter: ArrayLike,
    reference: ArrayLike,
    companions: ArrayLike,
    rd_covariance: ArrayLike,
    sigma_p: float,
) -> Array:
    """The bound along a whole trajectory, RDs at every epoch; time is the first axis.

    Args:
        prior_covariance: At the first epoch, before its RDs, (..., n, n).
        motion: The emitter's motion, a state of n.
        epochs_s: (K,), s, not decreasing.
        emitter: True positions, (K, ..., d), m.
        reference: True positions, (K, ..., d), m.
        companions: True positions, (K, ..., N, d), m.
        rd_covariance: The same at all epochs, (..., N, N), m².
        sigma_p: 1-sigma of the measured UAV positions per axis, m.

    Returns:
        P after the RDs of each epoch, (K, ..., n, n).

    Raises:
        EstimationError: As :class:`CramerRaoBound`; or the epochs decrease or their number is
            not that of the positions.
    """
    epochs = as_finite("epochs_s", epochs_s, None)
    tracks = (np.asarray(emitter), np.asarray(reference), np.asarray(companions))
    if epochs.ndim != 1 or any(len(track) != epochs.size for track in tracks):
        raise EstimationError(f"epochs_s must be (K,), one per position, not {epochs.shape}.")
    bound = CramerRaoBound(prior_covariance, motion)
    history = []
    previous = epochs[0]
    for epoch, e, p_0, p in zip(epochs, *tracks, strict=True):
        bound.predict(float(epoch - previous))
        bound.update(e, p_0, p, rd_covariance, sigma_p)
        history.append(bound.covariance)
        previous = epoch
    return np.stack(history)
