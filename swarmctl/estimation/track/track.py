"""One live track: range differences (RDs) of any pairs in, an honest estimate out.

No clock and no history of positions: it is handed the rows of one epoch after the other, with
the receivers' reported positions at that epoch, and put together from

====================  ====================================================================
``initial``           where to look, from a sector or nothing
``acquisition``       the first second: echoes out, every mode found
``window``            the most probable trajectories while the track is wide
``nuisance``          clocks, navigation and colour of the receivers, as states
``augmented``         the update of emitter and receivers
``mixture``           all modes and models of motion, and what is known by them
``contrast``          what of it is the noise of reported positions
``robust``            echoes set aside
``manoeuvre``         an emitter that turns or stops
``repetition``        copies of earlier rows, which are no measurements
``health``            whether all this may be believed
====================  ====================================================================

Begin
    Where the first innovation could not tell an echo from a poor prior, the first half second
    or so is collected, cleaned of echoes pair by pair, and every mode of the posterior sought.
    All probable modes (mirror images) are carried, each with its probability.
Width
    While the window lasts, the states are taken anew from it whenever a block is complete, and
    for a second after a silence at every epoch, but for what is believed of a manoeuvre, of
    which its straight trajectory knows nothing. It ends when straight lines of sight are good
    enough to linearise at for good, when the emitter manoeuvres, or when its random motion
    within a block is no longer small. (Ended earlier, in an orbit with real clocks, each epoch
    linearised at its own estimate makes the track surer and surer of a place hundreds of metres
    off, with innovations as they should be.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import as_covariance, as_finite
from swarmctl.estimation.integrity.gate import GATE, screen, tells_echoes
from swarmctl.estimation.integrity.health import ALARM, Health, Ids, Pairs, Verdict
from swarmctl.estimation.integrity.repetition import Repetition
from swarmctl.estimation.kernels.augmented import Rows
from swarmctl.estimation.model.prior import Prior, is_wide
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.estimation.track.acquisition import distinct, is_ready, search
from swarmctl.estimation.track.contrast import Contrast, of_epoch
from swarmctl.estimation.track.manoeuvre import BELIEVED, Manoeuvre, matched
from swarmctl.estimation.track.modes import Estimate, Limits, Mixture, Model, is_probable
from swarmctl.estimation.track.window import Fit, Pull, Window
from swarmctl.units import Array

_MODES = 4
"""Modes carried at most."""
_AHEAD_S = 5.0
_STRAIGHT = 0.05
"""The window ends when the curvature of the RDs over the spread expected ``_AHEAD_S`` from now
is below this share of their white noise."""

_SETTLES_S = 1.0
"""For so long after a silence of at least as long every epoch is a block of the window: half a
second by one linearisation is too much where the track is 100 m wide, 500 m from the emitter."""


class Estimator:
    """The track of one emitter.

    Attributes:
        epoch_s: Of the newest rows; minus infinity before the first.
        verdict: Health after the newest rows.
        used: Rows used.
        aside: Rows set aside as echoes.
        repeated: Rows left out as copies of earlier ones.
        innovation: Of the newest rows less those set aside, whitened, (k,): independent unit
            normal numbers if all is right. Empty while rows are collected.

    Args:
        prior: Of position and velocity, d axes each, at the first epoch.
        errors: The receivers' error model.
        process_noise: Spectral density of the emitter's acceleration per axis, (d,), m²/s³.
        manoeuvre: How it may change its mind; None for an emitter that does not.
        block_s: Length of a block of the window, s.
        capacity: Rows of the window.
        gate: Sigmas beyond which an arrival is set aside.

    Raises:
        EstimationError: A shape is wrong, a number not finite, or the prior no covariance.
    """

    def __init__(
        self,
        prior: Prior,
        errors: ReceiverErrors,
        process_noise: Sequence[float],
        *,
        manoeuvre: Manoeuvre | None = None,
        block_s: float = 0.5,
        capacity: int = 96,
        gate: float = GATE,
    ) -> None:
        psd = as_finite("process_noise", process_noise, None)
        d = psd.size
        if d not in {2, 3} or not (psd >= 0.0).all():
            raise EstimationError(
                f"process_noise must be 2 or 3 numbers >= 0, not {list(process_noise)}."
            )
        self._prior = Prior(
            as_finite("prior.mean", prior.mean, 2 * d),
            as_covariance("prior.covariance", prior.covariance, 2 * d, 2 * d),
        )
        self._model = Model(psd, errors, manoeuvre)
        self._block_s = block_s
        self._capacity = capacity
        self._gate = gate
        self.used = 0
        self.aside = 0
        self.repeated = 0
        self._repetition = Repetition(ALARM)
        self.epoch_s = -math.inf
        self._begin_again()

    def _begin_again(self) -> None:
        self._settled_s = -math.inf
        self._turning = 0.0  # greatest probability of a manoeuvre since the last renewal
        self._window: Window | None = None
        self._theta: Array = np.zeros((0, 2 * self._model.d))  # of the window, each mode's
        self._pull: Pull | None = None  # off these straight lines
        # Of the epochs since the last renewal: its time, position and velocity of each mode.
        self._nominal: tuple[float, Array] = (-math.inf, self._theta)
        self._collected: list[Rows] = []
        self._mixture: Mixture | None = None
        self._health = Health()
        self.verdict = Verdict("initialising", None, 1.0, 0.0, 0.0)
        self.innovation: Array = np.zeros(0)

    @property
    def is_resolved(self) -> bool:
        """Whether one mode is left."""
        return self._mixture is not None and len(self._mixture.x) == 1

    def restart(self, prior: Prior) -> None:
        """Forget everything but the counts, and begin from a prior at the next epoch."""
        self._prior = prior
        self._begin_again()

    def update(self, rows: Rows) -> bool:
        """Take the rows of an epoch.

        Args:
            rows: Finite, with a covariance that is one. Epochs increase; rows a few seconds
                late are used as what they are.

        Returns:
            Whether there is an estimate.

        Raises:
            EstimationError: The rows' numbers have no finite result: :meth:`restart`.
        """
        try:
            copies = self._repetition.add(rows)
            if copies.any():
                self.repeated += int(copies.sum())
                rows = rows.where(~copies)
            if not len(rows.rd):
                self._coast(rows.epoch_s)
                return self._mixture is not None
            if self._mixture is None and self._window is None:
                self._begin(rows)
            if self._mixture is not None:
                self._advance(self._mixture, rows)
                return True
            self._collected.append(rows)
            self.epoch_s = max(self.epoch_s, rows.epoch_s)
            if is_ready(self._collected):
                self._acquire()
        except np.linalg.LinAlgError:
            raise EstimationError("The rows' numbers have no finite result.") from None
        return self._mixture is not None

    def estimates(self) -> list[Estimate]:
        """What is known at :attr:`epoch_s`, empty if nothing is.

        The most probable first; of several that hardly differ, the one that was so before.
        """
        return [] if self._mixture is None else self._mixture.estimates(self.epoch_s)

    def predict_to(self, epoch_s: float) -> Estimate:
        """The most probable mode at another epoch.

        Of a later one: by its more probable model of motion, for nobody can tell whether an
        emitter that is not heard manoeuvres.

        Raises:
            EstimationError: There is no estimate yet.
        """
        known = self._known()
        x, P = known.after(epoch_s - self.epoch_s)
        return known.estimates(epoch_s)[0]._replace(x=x, P=P)

    def mixture_to(self, epoch_s: float) -> Estimate:
        """As :meth:`predict_to`, but with the covariance of all modes together about its mean.

        For who must not trust one of several mirror images.

        Raises:
            EstimationError: There is no estimate yet.
        """
        known = self._known()
        x, P = known.all_after(epoch_s - self.epoch_s)
        return known.estimates(epoch_s)[0]._replace(x=x, P=P)

    def limits(self) -> Limits:
        """What limits the accuracy of the most probable mode now; the rest is noise.

        Raises:
            EstimationError: There is no estimate yet.
        """
        return self._known().limits()

    def receiver(self, receiver: int) -> tuple[Array, Array]:
        """Errors of a receiver by the most probable mode, and their covariance.

        Args:
            receiver: Its id.

        Returns:
            (size,) and (size, size), as in
            :class:`~swarmctl.estimation.model.receiver_errors.Layout`.

        Raises:
            EstimationError: It has not been heard, or there is no estimate yet.
        """
        return self._known().receiver(receiver)

    def relative(self, receiver: int, to: int) -> tuple[Array, Array]:
        """Errors of a receiver less those of another, and the covariance of the differences.

        Range differences tell no more of the errors than this.

        Args:
            receiver: Its id.
            to: Id of the other.

        Returns:
            As :meth:`receiver`.

        Raises:
            EstimationError: One of them has not been heard, or there is no estimate yet.
        """
        return self._known().receiver(receiver, to)

    def _known(self) -> Mixture:
        if self._mixture is None:
            raise EstimationError("There is no estimate yet.")
        return self._mixture

    # --- The beginning -----------------------------------------------------------------

    def _begin(self, rows: Rows) -> None:
        mean, covariance = self._prior
        self._window = Window(
            mean,
            covariance,
            self._model.errors,
            self._model.psd,
            rows.epoch_s,
            block_s=self._block_s,
            capacity=self._capacity,
        )
        self.epoch_s = rows.epoch_s
        mixture = Mixture(self._model, mean[None], covariance[None], np.zeros(1), {})
        mixture.admit(rows)
        S = mixture.innovate(rows, 0.0, None).S
        receivers = np.concatenate([rows.first_at, rows.second_at])
        if tells_echoes(S[0, 0], rows) and not is_wide(self._prior, receivers):
            self._mixture, self._theta = mixture, mean[None]
            self._nominal = self.epoch_s, mean[None]

    def _acquire(self) -> None:
        window = self._window
        if window is None:
            raise EstimationError("There is no window to acquire from.")
        collected, self._collected = self._collected, []
        fit = search(window, self._prior, collected, self._model.errors.colour_m)
        kept = window.points.measurements
        self.used += kept
        self.aside += sum(len(rows.rd) for rows in collected) - kept
        self._mixture, _ = self._taken(window, fit)

    def _taken(self, window: Window, fit: Fit) -> tuple[Mixture, list[int]]:
        """The states of the distinct and probable modes of a fit, and which these are."""
        score = -0.5 * fit.objective - 0.5 * np.linalg.slogdet(fit.information)[1]
        modes = distinct(fit, score)
        data = -0.5 * np.vecdot(fit.residual, fit.residual)
        for k in modes[1:]:
            # Of what the rows say only what is real.
            score[k] += window.evidence(fit, modes[0], k) - (data[k] - data[modes[0]])
        probable = is_probable(score[modes])
        chosen = [k for k, is_kept in zip(modes, probable, strict=True) if is_kept]
        chosen = sorted(chosen, key=lambda k: -score[k])[:_MODES]
        states = [window.condense(fit, k, self.epoch_s) for k in chosen]
        model = self._model
        places = {
            receiver: 2 * model.d + k * model.layout.size
            for k, receiver in enumerate(window.points.receivers)
        }
        x, P = np.stack([x for x, _ in states]), np.stack([P for _, P in states])
        self._theta, pull = fit.theta[chosen], window.pull(fit)
        self._pull = pull._replace(force=pull.force[chosen])
        self._nominal = (self.epoch_s, np.asarray(x[:, : 2 * model.d], dtype=np.float64))
        return Mixture(model, x, P, score[chosen], places), chosen

    # --- Going on ----------------------------------------------------------------------

    def _coast(self, epoch_s: float) -> None:
        """Let time pass without a measurement."""
        if self._mixture is None:
            return
        if epoch_s > self.epoch_s:
            self._mixture.predict(epoch_s - self.epoch_s)
            self.epoch_s = epoch_s
        self._judge((), np.zeros(0), 0, ())

    def _judge(self, pairs: Pairs, white: Array, rows_aside: int, aside: Ids) -> None:
        self.innovation = white
        self.verdict = self._health.add(
            self.epoch_s, pairs, white, rows_aside, aside, self._repetition.sigmas
        )

    def _advance(self, mixture: Mixture, rows: Rows) -> None:
        mixture.admit(rows)
        dt = rows.epoch_s - self.epoch_s
        if dt > 0.0:
            mixture.predict(dt)
        lag_s = min(dt, 0.0)
        self.epoch_s = max(self.epoch_s, rows.epoch_s)
        window = self._window
        at = None if window is None else self._on_trajectory(mixture.x)
        first = mixture.innovate(rows, lag_s, at)

        # A receiver that only a wrong mirror image finds wrong tells the images apart.
        candidates = []
        for k in np.argsort(-mixture.log_probability):
            nu, S = matched(first.nu[k], first.S[k], mixture.weight[k])
            candidates.append((screen(nu, S, rows, self._gate), int(k), nu, S))
        screened, best, nu, S = min(candidates, key=lambda candidate: len(candidate[0].aside))
        weighed = rows._replace(covariance=screened.covariance)
        likelihood = mixture.update(weighed, lag_s, first, iterations=3 if at is None else 1)
        # A wrong mirror image seems to turn where the right one goes straight on.
        self._turning = max(self._turning, float(mixture.weight[:, 1:].sum(-1).min()))

        kept = screened.kept
        count = int(kept.sum())
        self.used += count
        self.aside += len(kept) - count
        good = rows if count == len(kept) else rows.where(kept)
        root = np.linalg.cholesky(S[np.ix_(kept, kept)])
        white = np.linalg.solve(root, nu[kept])
        pairs = tuple(zip(good.first, good.second, strict=True))
        self._judge(pairs, white, len(kept) - count, screened.aside)
        if window is None:
            if count and not self.is_resolved:
                candidates.sort(key=lambda candidate: candidate[1])
                nus = np.stack([nu[kept] for _, _, nu, _ in candidates])
                covariances = np.stack([S[np.ix_(kept, kept)] for *_, S in candidates])
                mixture.compare(likelihood, self._contrast(mixture, good, nus, covariances))
        elif count and lag_s == 0.0:
            if dt > _SETTLES_S:
                self._settled_s = rows.epoch_s + _SETTLES_S
            alone = rows.epoch_s < self._settled_s
            if window.points.add(good, self._theta[best], alone=alone) or alone:
                self._renew(window, mixture, rows)

    def _contrast(self, mixture: Mixture, rows: Rows, nu: Array, S: Array) -> Contrast:
        """Between the modes in the rows of one epoch.

        An error of navigation lasts, but counts as if it were new: on the safe side.
        """
        variance = rows.position_m**2 + self._model.errors.navigation_m**2
        return of_epoch(rows, mixture.x[:, 0, : self._model.d], nu, S, variance)

    def _on_trajectory(self, x: Array) -> Array:
        """Where to linearise between two renewals: where the window's rows are linearised.

        An epoch linearised elsewhere contradicts them (with clocks and navigation from Table
        1's P0 x 20² the median NEES is 6 half a second later).
        """
        d, (since_s, nominal) = self._model.d, self._nominal
        at = x.copy()
        at[..., :d] = (nominal[:, :d] + (self.epoch_s - since_s) * nominal[:, d:])[:, None]
        at[..., d : 2 * d] = nominal[:, None, d:]
        return at

    def _renew(self, window: Window, mixture: Mixture, rows: Rows) -> None:
        """Take the states anew from the window, or end it."""
        best = mixture.best
        sight = mixture.x[best, 0, : self._model.d] - rows.second_at
        nearest = float(np.sqrt(np.vecdot(sight, sight)).min())
        turned, self._turning = self._turning > BELIEVED, 0.0
        window.points.compress(self._theta[best])
        if turned or window.is_stretched(nearest):
            self._window = None
            return
        renewed, chosen = self._taken(window, window.fit(self._theta, pull=self._pull))
        renewed.admit(rows)
        renewed.keep_manoeuvre(mixture, chosen)
        if best in chosen:
            renewed.keep_best(chosen.index(best))
        self._mixture = renewed
        if self.is_resolved and self._is_straight(renewed, rows):
            self._window = None

    def _is_straight(self, mixture: Mixture, rows: Rows) -> bool:
        """Whether linearising at the estimate will do from now on."""
        d = self._model.d
        ahead = np.eye(2 * d)[:d]
        ahead[:, d:] = _AHEAD_S * np.eye(d)
        P = ahead @ mixture.P[0, 0, : 2 * d, : 2 * d] @ ahead.T
        variance = float(np.linalg.eigvalsh(P)[-1])
        positions = np.concatenate([rows.first_at, rows.second_at])
        aperture = float(np.sqrt(((positions - positions.mean(0)) ** 2).sum(-1)).max())
        sight = mixture.x[0, 0, :d] - positions
        nearest_squared = float(np.vecdot(sight, sight).min())
        white = math.sqrt(float(np.diagonal(rows.covariance).min()))
        return 0.5 * 2.0 * aperture * variance / nearest_squared < _STRAIGHT * white
