"""The extended Kalman filter that most people would write: white noise, one linearisation.

To compare with. It has the interface of :class:`~swarmctl.estimation.track.track.Estimator` as far
as a recording needs it, the same gate and the same health, but begins at the prior's mean and
knows neither coloured errors nor clocks.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from swarmctl.estimation.integrity.gate import screen
from swarmctl.estimation.integrity.health import ALARM, Health, Verdict
from swarmctl.estimation.integrity.repetition import Repetition
from swarmctl.estimation.kernels import augmented
from swarmctl.estimation.kernels.augmented import Rows
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.receiver_errors import ReceiverErrors, predict
from swarmctl.estimation.track.modes import Estimate

_WHITE = ReceiverErrors()


class PlainEkf:
    """The track of one emitter by an EKF.

    Attributes:
        verdict: Health after the newest rows.
        used: Rows used.
        aside: Rows set aside as echoes.
        repeated: 0: it uses copies of earlier rows, and its health names them.

    Args:
        prior: Of position and velocity, d axes each, at the first epoch.
        process_noise: Spectral density of the emitter's acceleration per axis, (d,), m²/s³.
        gate: Sigmas beyond which an arrival is set aside.
    """

    def __init__(self, prior: Prior, process_noise: Sequence[float], *, gate: float) -> None:
        self._psd = np.array(process_noise)
        self._gate = gate
        self._layout = _WHITE.layout(self._psd.size)
        self.used = 0
        self.aside = 0
        self.repeated = 0
        self._repetition = Repetition(ALARM)
        self.restart(prior)

    def restart(self, prior: Prior) -> None:
        """Forget everything but the counts, and begin from a prior at the next epoch."""
        self._x, self._P = prior
        self._epoch_s: float | None = None
        self._health = Health()
        self.verdict = Verdict("initialising", None, 1.0, 0.0, 0.0)

    def update(self, rows: Rows) -> bool:
        """Take the rows of an epoch, later than the last.

        Returns:
            Whether there is an estimate: always.

        Raises:
            EstimationError: The rows' numbers have no finite result.
        """
        dt = 0.0 if self._epoch_s is None else rows.epoch_s - self._epoch_s
        self._epoch_s = rows.epoch_s
        self._repetition.add(rows)
        x, P = predict(self._x, self._P, dt, self._psd, _WHITE, self._layout)
        first = augmented.innovate(x, P, rows, {}, self._layout)
        screened = screen(first.nu, first.S, rows, self._gate)
        weighed = rows._replace(covariance=screened.covariance)
        posterior = augmented.update(x, P, weighed, {}, self._layout, first=first, iterations=1)
        self._x, self._P = posterior.x, posterior.P
        kept = screened.kept
        count = int(kept.sum())
        self.used += count
        self.aside += len(kept) - count
        good = rows.where(kept)
        root = np.linalg.cholesky(first.S[np.ix_(kept, kept)])
        white = np.linalg.solve(root, first.nu[kept])
        pairs = tuple(zip(good.first, good.second, strict=True))
        self.verdict = self._health.add(
            rows.epoch_s,
            pairs,
            white,
            len(kept) - count,
            screened.aside,
            self._repetition.sigmas,
        )
        return True

    def estimates(self) -> list[Estimate]:
        """What is known after the newest rows."""
        if self._epoch_s is None:
            return []
        return [Estimate(self._epoch_s, self._x, self._P, 1.0, 0.0)]
