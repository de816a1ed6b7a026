"""The posterior Cramér-Rao bound where the receivers' errors are states too.

As :mod:`~swarmctl.estimation.bounds.pcrb`, for the state ``[e, v | receivers]`` of
:mod:`~swarmctl.estimation.kernels.augmented`: the same recursion, linearised at the true positions
and at errors of zero. (What the errors are changes a line of sight by metres in kilometres.)
"""

from __future__ import annotations

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import as_finite
from swarmctl.estimation.kernels.augmented import linearise
from swarmctl.estimation.model.receiver_errors import ReceiverErrors, predict
from swarmctl.estimation.model.rows import Rows
from swarmctl.units import Array


class AugmentedBound:
    """The recursion, one epoch at a time.

    Args:
        prior_covariance: Covariance of the emitter's position and velocity, (2d, 2d).
        errors: The receivers' error model.
        process_noise: Spectral density of the emitter's acceleration per axis, (d,), m²/s³.

    Raises:
        EstimationError: A shape is wrong or a number not finite.
    """

    def __init__(
        self, prior_covariance: Array, errors: ReceiverErrors, process_noise: Array
    ) -> None:
        self._psd = as_finite("process_noise", process_noise, None)
        n = 2 * self._psd.size
        self._P = as_finite("prior_covariance", prior_covariance, n, n)
        self._errors = errors
        self._layout = errors.layout(self._psd.size)
        self._places: dict[int, int] = {}

    @property
    def covariance(self) -> Array:
        """The bound of the emitter's position and velocity, (2d, 2d)."""
        n = 2 * self._psd.size
        return self._P[:n, :n]

    def predict(self, dt: float) -> None:
        """Let time pass.

        Args:
            dt: Seconds, >= 0.

        Raises:
            EstimationError: dt is negative or not finite.
        """
        if not 0.0 <= dt < np.inf:
            raise EstimationError(f"dt must be a finite number >= 0, not {dt!r}.")
        nowhere = np.zeros(len(self._P))
        _, self._P = predict(nowhere, self._P, dt, self._psd, self._errors, self._layout)

    def update(self, emitter: Array, rows: Rows) -> None:
        """Account for the rows of one epoch.

        Args:
            emitter: True position, (d,), m.
            rows: With the *true* positions of the receivers.
        """
        variance = self._errors.variance(self._psd.size)
        for receiver in (*rows.first, *rows.second):
            if receiver not in self._places:
                n = self._places[receiver] = len(self._P)
                self._P = np.pad(self._P, (0, variance.size))
                self._P[n:, n:] = np.diag(variance)
        at = np.zeros(len(self._P))
        at[: self._psd.size] = emitter
        _, H = linearise(at, rows, self._places, self._layout)
        HP = H @ self._P
        gain = np.linalg.solve(HP @ H.T + rows.covariance, HP).T
        rest = np.eye(len(at)) - gain @ H
        P = rest @ self._P @ rest.T + gain @ rows.covariance @ gain.T
        self._P = 0.5 * (P + P.T)
