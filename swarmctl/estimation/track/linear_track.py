"""A track by the linear filter: the consistent NCRKF, with a gate and a verdict on its health.

For receivers with good clocks and white errors, and a prior that is a place. One step costs half
of the full :class:`~swarmctl.estimation.track.track.Estimator`'s, there is no window and no search,
and nothing but the receivers' positions is taken for known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import as_covariance, as_finite
from swarmctl.estimation.integrity.gate import Screened, screen, tells_echoes
from swarmctl.estimation.integrity.health import ALARM, Health, Ids, Pairs, Verdict
from swarmctl.estimation.integrity.repetition import Repetition
from swarmctl.estimation.kernels import augmented, ncrkf
from swarmctl.estimation.kernels.augmented import Rows
from swarmctl.estimation.model import motion
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.estimation.track.modes import Estimate, Limits
from swarmctl.units import Array

_WHITE = ReceiverErrors()


class LinearTrack:
    """The track of one emitter by :func:`swarmctl.estimation.kernels.ncrkf.update`.

    Attributes:
        epoch_s: Of the newest rows, s; minus infinity before the first.
        verdict: Health after the newest rows.
        innovation: Whitened innovation of the newest rows that were kept.
        used: Rows used.
        aside: Rows set aside as echoes.
        repeated: Rows left out as copies of earlier ones.

    Args:
        prior: Of position and velocity, d axes each, at the first epoch.
        process_noise: Spectral density of the emitter's acceleration per axis, (d,), m²/s³.

    Raises:
        EstimationError: A shape is wrong, a number not finite, or the prior no covariance.
    """

    def __init__(self, prior: Prior, process_noise: Sequence[float]) -> None:
        self._psd = as_finite("process_noise", process_noise, None)
        self._layout = _WHITE.layout(self._psd.size)
        motion.process_noise(0.0, self._psd)
        self.used = 0
        self.aside = 0
        self.repeated = 0
        self._repetition = Repetition(ALARM)
        self.restart(prior)

    def restart(self, prior: Prior) -> None:
        """Forget everything but the counts, and begin from a prior at the next epoch."""
        n = 2 * self._psd.size
        self._x = as_finite("prior.mean", prior.mean, n)
        self._P = as_covariance("prior.covariance", prior.covariance, n, n)
        if self._x.ndim != 1 or self._P.ndim != 2:
            raise EstimationError("A track has one prior: no leading axes.")
        self.epoch_s = -math.inf
        self.innovation: Array = np.zeros(0)
        self._health = Health()
        self.verdict = Verdict("initialising", None, 1.0, 0.0, 0.0)

    @property
    def is_resolved(self) -> bool:
        """Whether there is one estimate: the linear filter has no alternatives."""
        return self.epoch_s > -math.inf

    def update(self, rows: Rows) -> bool:
        """Take the rows of an epoch.

        Rows older than the track update the state expressed at their own epoch, which then
        returns to the track's; the process noise of the few seconds between is neglected.

        Args:
            rows: With one reference, the first of every pair.

        Returns:
            Whether there is an estimate: always.

        Raises:
            EstimationError: The rows have several references, or no finite result.
        """
        if len(set(rows.first)) != 1:
            raise EstimationError("The linear filter takes the rows of one reference at a time.")
        try:
            self._advance(rows)
        except np.linalg.LinAlgError:
            raise EstimationError("The rows' numbers have no finite result.") from None
        return True

    def _advance(self, rows: Rows) -> None:
        copies = self._repetition.add(rows)
        self.repeated += int(copies.sum())
        rows = rows.where(~copies)
        epoch_s = max(self.epoch_s, rows.epoch_s)
        x, P = self._at(rows.epoch_s)
        if copies.all():
            self._x, self._P = motion.transport(x, P, epoch_s - rows.epoch_s)
            self.epoch_s, self.innovation = epoch_s, np.zeros(0)
            self._judge((), 0, ())
            return
        first = augmented.innovate(x, P, rows, {}, self._layout)
        # With a poor prior nothing is set aside, and nothing judged.
        clear = tells_echoes(first.S, rows)
        everything = Screened(np.ones(len(rows.rd), dtype=np.bool_), rows.covariance, ())
        screened = screen(first.nu, first.S, rows) if clear else everything
        kept = screened.kept
        count = int(kept.sum())
        if count:
            good = rows.where(kept)
            result = ncrkf.update(
                x, P, good.first_at[0], good.second_at, good.rd, good.covariance, 0.0
            )
            x, P = result.x, result.P
        self._x, self._P = motion.transport(x, P, epoch_s - rows.epoch_s)
        self.epoch_s = epoch_s
        self.used += count
        self.aside += len(kept) - count
        root = np.linalg.cholesky(first.S[np.ix_(kept, kept)])
        self.innovation = np.linalg.solve(root, first.nu[kept])
        if clear:
            picked = np.flatnonzero(kept).tolist()
            pairs = tuple((rows.first[k], rows.second[k]) for k in picked)
            self._judge(pairs, len(kept) - count, screened.aside)

    def estimates(self) -> list[Estimate]:
        """What is known at :attr:`epoch_s`; empty before the first rows."""
        if not self.is_resolved:
            return []
        return [Estimate(self.epoch_s, self._x, self._P, 1.0, 0.0)]

    def mixture_to(self, epoch_s: float) -> Estimate:
        """The estimate at another epoch; an earlier one without process noise.

        Raises:
            EstimationError: There is no estimate yet.
        """
        if not self.is_resolved:
            raise EstimationError("There is no estimate yet.")
        x, P = self._at(epoch_s)
        return Estimate(epoch_s, x, P, 1.0, 0.0)

    def limits(self) -> Limits:
        """Nothing that is modelled but noise."""
        return Limits(0.0, 0.0, 0.0)

    def relative(self, receiver: int, to: int) -> tuple[Array, Array]:
        """No errors of receivers are modelled: (0,) and (0, 0)."""
        return np.zeros(0), np.zeros((0, 0))

    def _judge(self, pairs: Pairs, rows_aside: int, aside: Ids) -> None:
        self.verdict = self._health.add(
            self.epoch_s, pairs, self.innovation, rows_aside, aside, self._repetition.sigmas
        )

    def _at(self, epoch_s: float) -> tuple[Array, Array]:
        if not self.is_resolved:
            return self._x, self._P
        dt = epoch_s - self.epoch_s
        if dt < 0.0:
            return motion.transport(self._x, self._P, dt)
        return motion.predict(self._x, self._P, dt, self._psd)
