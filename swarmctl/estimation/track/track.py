"""The track of one emitter: the rows of one epoch after the other in, an honest estimate out.

The epoch loop is the same whatever filter runs in it (:mod:`~swarmctl.estimation.track.kernel`):

==============  ==========================================================================
repetition      copies of earlier rows are left out: they are no measurements
predict         the filter goes to the rows' epoch
innovate        measured less predicted range differences
screen          receivers whose arrival cannot be what the track expects are set aside
update          the filter uses the rest
whiten, judge   the innovations say whether all this may be believed
==============  ==========================================================================

There is no clock and no history of positions here: the rows bring the receivers' reported
positions at their epoch.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import as_covariance, as_finite
from swarmctl.estimation.estimate import Counts, Estimate, Limits
from swarmctl.estimation.integrity.gate import GATE, Screened, screen
from swarmctl.estimation.integrity.health import ALARM, Health, Ids, Pairs, Verdict
from swarmctl.estimation.integrity.repetition import Repetition
from swarmctl.estimation.model import motion
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.rows import Rows
from swarmctl.estimation.track.kernel import Kernel, Residual
from swarmctl.units import Array


class Track:
    """The track of one emitter.

    Attributes:
        verdict: Health after the newest rows.
        innovation: Whitened innovation of the newest rows that were kept, (k,): independent unit
            normal numbers if all is right. Empty while rows are collected.
        counts: What became of the rows.

    Args:
        kernel: The filter.
        prior: Position and velocity at the first epoch, d axes each.
        gate: Sigmas beyond which an arrival is set aside.

    Raises:
        EstimationError: The prior has the wrong shape, is not finite, or is no covariance.
    """

    def __init__(self, kernel: Kernel, prior: Prior, *, gate: float = GATE) -> None:
        self._kernel = kernel
        self._prior = prior
        self._gate = gate
        self._repetition = Repetition(ALARM)
        self._begun_s: float | None = None
        self.counts = Counts()
        self._begin(prior)

    def _begin(self, prior: Prior) -> None:
        n = 2 * self._kernel.process_noise.size
        mean = as_finite("prior.mean", prior.mean, n)
        covariance = as_covariance("prior.covariance", prior.covariance, n, n)
        if mean.ndim != 1 or covariance.ndim != 2:
            raise EstimationError("A track has one prior: no leading axes.")
        self._kernel.begin(Prior(mean, covariance))
        self._health = Health()
        self.verdict = Verdict("initialising", None, 1.0, 0.0, 0.0)
        self.innovation: Array = np.zeros(0)

    @property
    def epoch_s(self) -> float:
        """Epoch of the newest rows, s; minus infinity before the first."""
        return self._kernel.epoch_s

    @property
    def is_begun(self) -> bool:
        """Whether any rows have been taken, before or after a restart."""
        return self._begun_s is not None

    @property
    def is_resolved(self) -> bool:
        """Whether there is one estimate and no alternative to it."""
        return self._kernel.is_resolved

    def restart(self, prior: Prior | None = None) -> None:
        """Forget everything but the counts, and begin anew at the next epoch.

        Args:
            prior: What to begin from; None for the track's own prior, aged to the newest epoch.
        """
        self._begin(self._aged_prior(self.epoch_s) if prior is None else prior)

    # --- The epoch loop ----------------------------------------------------------------

    def update(self, rows: Rows) -> bool:
        """Take the rows of an epoch.

        Args:
            rows: Finite, with a covariance that is one. Epochs increase; rows a few seconds
                late are used as what they are.

        Returns:
            Whether there is an estimate.

        Raises:
            EstimationError: The filter cannot take such rows, or their numbers have no finite
                result: :meth:`restart`.
        """
        try:
            self._take(rows)
        except np.linalg.LinAlgError:
            raise EstimationError("The rows' numbers have no finite result.") from None
        if self._begun_s is None:
            self._begun_s = rows.epoch_s
        return self._kernel.has_estimate

    def _take(self, rows: Rows) -> None:
        kernel = self._kernel
        copies = self._repetition.add(rows)
        if copies.any():
            self._count(Counts(repeated=int(copies.sum())))
            rows = rows.where(~copies)
        if not len(rows.rd):
            kernel.coast(rows.epoch_s)
            if kernel.has_estimate:
                self._judge((), np.zeros(0), 0, ())
            return
        collected = kernel.collect(rows)
        if collected is not None:
            self._count(collected)
            return

        residuals = kernel.innovate(rows)
        clear = kernel.tells_echoes(residuals[0].S, rows)
        # A receiver that only a wrong mirror image finds wrong tells the images apart.
        screened, mode = self._screen(residuals, rows) if clear else (_everything(rows), 0)
        kernel.update(rows, screened, mode)

        kept = screened.kept
        used = int(kept.sum())
        aside = len(kept) - used
        self._count(Counts(used=used, aside=aside))
        nu, S = residuals[mode]
        white = np.linalg.solve(np.linalg.cholesky(S[np.ix_(kept, kept)]), nu[kept])
        if clear:
            good = rows if not aside else rows.where(kept)
            pairs = tuple(zip(good.first, good.second, strict=True))
            self._judge(pairs, white, aside, screened.aside)
        self.innovation = white

    def _screen(self, residuals: Sequence[Residual], rows: Rows) -> tuple[Screened, int]:
        """What the mode that sets the fewest receivers aside keeps, and which mode that is."""
        found = [screen(nu, S, rows, self._gate) for nu, S in residuals]
        mode = min(range(len(found)), key=lambda k: len(found[k].aside))
        return found[mode], mode

    def _count(self, more: Counts) -> None:
        self.counts = Counts(*(a + b for a, b in zip(self.counts, more, strict=True)))

    def _judge(self, pairs: Pairs, white: Array, rows_aside: int, aside: Ids) -> None:
        self.innovation = white
        self.verdict = self._health.add(
            self.epoch_s, pairs, white, rows_aside, aside, self._repetition.sigmas
        )

    # --- What is known -----------------------------------------------------------------

    def latest(self) -> Estimate:
        """The estimate after the newest rows, with the covariance of all modes about it.

        Raises:
            EstimationError: There is no estimate yet.
        """
        return self.mixture_to(self.epoch_s)._replace(
            nis=float(self.innovation @ self.innovation), rd_count=len(self.innovation)
        )

    def estimates(self) -> list[Estimate]:
        """What is known at :attr:`epoch_s`, empty if nothing is.

        The most probable comes first; of several that hardly differ, the one that did before.
        """
        return self._kernel.estimates()

    def predict_to(self, epoch_s: float) -> Estimate:
        """The most probable mode at another epoch.

        A later epoch is reached by its more probable model of motion, for nobody can tell
        whether an emitter that is not heard manoeuvres; an earlier one without process noise.

        Raises:
            EstimationError: There is no estimate yet.
        """
        return self._known().predict_to(epoch_s)

    def mixture_to(self, epoch_s: float) -> Estimate:
        """As :meth:`predict_to`, but with the covariance of all modes together about its mean.

        It is for who must not trust one of several mirror images.

        Raises:
            EstimationError: There is no estimate yet.
        """
        return self._known().mixture_to(epoch_s)

    def believed_at(self, epoch_s: float) -> Estimate:
        """As :meth:`mixture_to`; while there is no estimate, the prior, aged to the epoch.

        Raises:
            EstimationError: The epoch is not finite.
        """
        if not math.isfinite(epoch_s):
            raise EstimationError(f"epoch_s must be finite, not {epoch_s!r}.")
        if self._kernel.has_estimate:
            return self.mixture_to(epoch_s)
        return Estimate(epoch_s, *self._aged_prior(epoch_s))

    def limits(self) -> Limits:
        """What limits the accuracy of the most probable mode now; the rest is noise.

        Raises:
            EstimationError: There is no estimate yet.
        """
        return self._known().limits()

    def relative(self, receiver: int, to: int) -> tuple[Array, Array]:
        """Errors of a receiver less those of another, and the covariance of the differences.

        Range differences tell no more of the errors than this.

        Args:
            receiver: Its id.
            to: Id of the other.

        Returns:
            (size,) and (size, size), as in
            :class:`~swarmctl.estimation.model.receiver_errors.Layout`.

        Raises:
            EstimationError: One of them has not been heard, or there is no estimate yet.
        """
        return self._known().relative(receiver, to)

    def _known(self) -> Kernel:
        if not self._kernel.has_estimate:
            raise EstimationError("There is no estimate yet.")
        return self._kernel

    def _aged_prior(self, epoch_s: float) -> Prior:
        x, P = self._prior
        elapsed_s = 0.0 if self._begun_s is None else max(0.0, epoch_s - self._begun_s)
        return Prior(*motion.predict(x, P, elapsed_s, self._kernel.process_noise))


def _everything(rows: Rows) -> Screened:
    return Screened(np.ones(len(rows.rd), dtype=np.bool_), rows.covariance, ())
