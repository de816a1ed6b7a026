r"""The full filter of a track: clocks, echoes, mirror images and manoeuvres, from a poor start.

====================  ====================================================================
``acquisition``       the first second: echoes out, every mode found
``window``            the most probable trajectories while the track is wide
``modes``             all modes and models of motion, with the receivers' errors as states
``contrast``          how much of what tells modes apart is the noise of reported positions
``manoeuvre``         an emitter that turns or stops
====================  ====================================================================

Begin
    Where the first innovation could not tell an echo from a poor prior, the first half second
    or so is collected, cleaned of echoes pair by pair, and every mode of the posterior sought.
    All probable modes (mirror images) are carried, each with its probability.
Width
    While the window lasts, the states are taken anew from it whenever a block is complete, and
    for a second after a silence at every epoch. What is believed of a manoeuvre is kept, for the
    window's straight trajectory knows nothing of it. The window ends when straight lines of
    sight are good enough to linearise at for good, when the emitter manoeuvres, or when its
    random motion within a block is no longer small. Ended earlier, in an orbit with real clocks,
    it would leave a track that grows surer and surer of a place hundreds of metres off, with
    innovations as they should be: each epoch is then linearised at its own estimate.

``docs/explanation/track.md`` has the mathematics.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.estimate import Counts, Estimate, Limits
from swarmctl.estimation.integrity.gate import Screened, tells_echoes
from swarmctl.estimation.kernels.augmented import Innovation
from swarmctl.estimation.model.prior import Prior, is_wide
from swarmctl.estimation.model.rows import Rows
from swarmctl.estimation.track.acquisition import distinct, is_ready, search
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.estimation.track.contrast import Contrast, contrast_in_epoch
from swarmctl.estimation.track.kernel import Residual
from swarmctl.estimation.track.manoeuvre import BELIEVED, moment_match
from swarmctl.estimation.track.modes import Mixture, is_probable
from swarmctl.estimation.track.window import Fit, Pull, Window
from swarmctl.units import Array

_MODES = 4
"""Modes carried at most."""
_AHEAD_S = 5.0
_STRAIGHT = 0.05
"""The window ends when the curvature of the range differences over the spread expected
``_AHEAD_S`` from now is below this share of their white noise."""

_SETTLES_S = 1.0
"""For so long after a silence of at least as long every epoch is a block of the window: half a
second by one linearisation is too much where the track is 100 m wide, 500 m from the emitter."""


class _Innovated(NamedTuple):
    """What :meth:`FullKernel.innovate` found, for the update that follows."""

    dt: float  # since the epoch before, s; negative for late rows
    lag_s: float
    innovation: Innovation
    residuals: list[Residual]  # of the modes in the order below
    order: list[int]


class FullKernel:
    """A :class:`~swarmctl.estimation.track.kernel.Kernel` of modes, window and receivers' states.

    Attributes:
        epoch_s: Epoch of the newest rows, s; minus infinity before the first.
        process_noise: Spectral density of the emitter's acceleration per axis, (d,), m²/s³.

    Args:
        behaviour: How emitter and receivers behave.
        block_s: Length of a block of the window, s.
        capacity: Rows of the window.
    """

    def __init__(self, behaviour: Behaviour, *, block_s: float = 0.5, capacity: int = 96) -> None:
        self._behaviour = behaviour
        self._block_s = block_s
        self._capacity = capacity
        self.process_noise = behaviour.process_noise
        self.epoch_s = -math.inf

    def begin(self, prior: Prior) -> None:
        """Forget everything, and begin from a prior at the next epoch."""
        self._prior = prior
        self._settled_s = -math.inf
        self._turning = 0.0  # greatest probability of a manoeuvre since the last renewal
        self._window: Window | None = None
        # Each mode's straight line over the window, and what pulls the emitter off it.
        self._theta: Array = np.zeros((0, 2 * self._behaviour.d))
        self._pull: Pull | None = None
        # The last renewal's time, with each mode's position and velocity then.
        self._nominal: tuple[float, Array] = (-math.inf, self._theta)
        self._collected: list[Rows] = []
        self._mixture: Mixture | None = None
        self._innovated: _Innovated | None = None

    @property
    def has_estimate(self) -> bool:
        """Whether there is an estimate."""
        return self._mixture is not None

    @property
    def is_resolved(self) -> bool:
        """Whether one mode is left."""
        return self._mixture is not None and len(self._mixture.x) == 1

    # --- What is known -----------------------------------------------------------------

    def estimates(self) -> list[Estimate]:
        """What is known at :attr:`epoch_s`, empty if nothing is; the mode to go by first."""
        return [] if self._mixture is None else self._mixture.estimates(self.epoch_s)

    def predict_to(self, epoch_s: float) -> Estimate:
        """As :meth:`swarmctl.estimation.track.kernel.Kernel.predict_to`."""
        known = self._known()
        x, P = known.after(epoch_s - self.epoch_s)
        return known.estimates(epoch_s)[0]._replace(x=x, P=P)

    def mixture_to(self, epoch_s: float) -> Estimate:
        """As :meth:`swarmctl.estimation.track.kernel.Kernel.mixture_to`."""
        known = self._known()
        x, P = known.all_after(epoch_s - self.epoch_s)
        return known.estimates(epoch_s)[0]._replace(x=x, P=P)

    def limits(self) -> Limits:
        """What limits the accuracy of the most probable mode now; the rest is noise."""
        return self._known().limits()

    def relative(self, receiver: int, to: int) -> tuple[Array, Array]:
        """As :meth:`swarmctl.estimation.track.kernel.Kernel.relative`, by the mode to go by."""
        return self._known().receiver(receiver, to)

    def _known(self) -> Mixture:
        if self._mixture is None:
            raise EstimationError("There is no estimate yet.")
        return self._mixture

    # --- The beginning -----------------------------------------------------------------

    def collect(self, rows: Rows) -> Counts | None:
        """Keep the rows until they are enough to search for every mode in.

        The rows are not kept once there is an estimate, or where the prior is so good that the
        first of them can already tell an echo.

        Returns:
            As :meth:`swarmctl.estimation.track.kernel.Kernel.collect`.
        """
        if self._mixture is None and self._window is None:
            self._begin(rows)
        if self._mixture is not None:
            return None
        self._collected.append(rows)
        self.epoch_s = max(self.epoch_s, rows.epoch_s)
        return self._acquire() if is_ready(self._collected) else Counts()

    def _begin(self, rows: Rows) -> None:
        mean, covariance = self._prior
        self._window = Window(
            mean,
            covariance,
            self._behaviour.errors,
            self._behaviour.process_noise,
            rows.epoch_s,
            block_s=self._block_s,
            capacity=self._capacity,
        )
        self.epoch_s = rows.epoch_s
        mixture = Mixture(self._behaviour, mean[None], covariance[None], np.zeros(1), {})
        mixture.admit(rows)
        S = mixture.innovate(rows, 0.0, None).S
        receivers = np.concatenate([rows.first_at, rows.second_at])
        if tells_echoes(S[0, 0], rows) and not is_wide(self._prior, receivers):
            self._mixture, self._theta = mixture, mean[None]
            self._nominal = self.epoch_s, mean[None]

    def _acquire(self) -> Counts:
        window = self._window
        if window is None:
            raise EstimationError("There is no window to acquire from.")
        collected, self._collected = self._collected, []
        fit = search(window, self._prior, collected, self._behaviour.errors.colour_m)
        kept = window.points.measurements
        self._mixture, _ = self._taken(window, fit)
        return Counts(used=kept, aside=sum(len(rows.rd) for rows in collected) - kept)

    def _taken(self, window: Window, fit: Fit) -> tuple[Mixture, list[int]]:
        """The states of the distinct and probable modes of a fit, and which these are."""
        score = -0.5 * fit.objective - 0.5 * np.linalg.slogdet(fit.information)[1]
        modes = distinct(fit, score)
        data = -0.5 * np.vecdot(fit.residual, fit.residual)
        for k in modes[1:]:
            # Only the real part of what the rows say counts.
            score[k] += window.evidence(fit, modes[0], k) - (data[k] - data[modes[0]])
        probable = is_probable(score[modes])
        chosen = [k for k, is_kept in zip(modes, probable, strict=True) if is_kept]
        chosen = sorted(chosen, key=lambda k: -score[k])[:_MODES]
        states = [window.condense(fit, k, self.epoch_s) for k in chosen]
        behaviour = self._behaviour
        places = {
            receiver: 2 * behaviour.d + k * behaviour.layout.size
            for k, receiver in enumerate(window.points.receivers)
        }
        x, P = np.stack([x for x, _ in states]), np.stack([P for _, P in states])
        self._theta, pull = fit.theta[chosen], window.pull(fit)
        self._pull = pull._replace(force=pull.force[chosen])
        self._nominal = (self.epoch_s, np.asarray(x[:, : 2 * behaviour.d], dtype=np.float64))
        return Mixture(behaviour, x, P, score[chosen], places), chosen

    # --- Going on ----------------------------------------------------------------------

    def coast(self, epoch_s: float) -> None:
        """Let time pass up to an epoch without a measurement."""
        if self._mixture is not None and epoch_s > self.epoch_s:
            self._mixture.predict(epoch_s - self.epoch_s)
            self.epoch_s = epoch_s

    def innovate(self, rows: Rows) -> list[Residual]:
        """As :meth:`swarmctl.estimation.track.kernel.Kernel.innovate`."""
        mixture = self._known()
        mixture.admit(rows)
        dt = rows.epoch_s - self.epoch_s
        if dt > 0.0:
            mixture.predict(dt)
        lag_s = min(dt, 0.0)
        self.epoch_s = max(self.epoch_s, rows.epoch_s)
        at = None if self._window is None else self._on_trajectory(mixture.x)
        found = mixture.innovate(rows, lag_s, at)
        order = [int(k) for k in np.argsort(-mixture.log_probability)]
        residuals = [
            Residual(*moment_match(found.nu[k], found.S[k], mixture.weight[k])) for k in order
        ]
        self._innovated = _Innovated(dt, lag_s, found, residuals, order)
        return residuals

    def tells_echoes(self, S: Array, rows: Rows) -> bool:
        """Always: the beginning is over only once an echo shows."""
        return True

    def update(self, rows: Rows, screened: Screened, mode: int) -> None:
        """As :meth:`swarmctl.estimation.track.kernel.Kernel.update`."""
        mixture, window, innovated = self._known(), self._window, self._innovated
        if innovated is None:
            raise EstimationError("An update follows an innovation.")
        self._innovated = None
        dt, lag_s, innovation, residuals, order = innovated
        weighed = rows._replace(covariance=screened.covariance)
        iterations = 3 if window is None else 1
        likelihood = mixture.update(weighed, lag_s, innovation, iterations)
        # A wrong mirror image seems to turn where the right one goes straight on.
        self._turning = max(self._turning, float(mixture.weight[:, 1:].sum(-1).min()))

        kept = screened.kept
        if not kept.any():
            return
        good = rows if kept.all() else rows.where(kept)
        if window is None:
            if not self.is_resolved:
                of_modes = [residuals[order.index(k)] for k in range(len(order))]
                nus = np.stack([nu[kept] for nu, _ in of_modes])
                covariances = np.stack([S[np.ix_(kept, kept)] for _, S in of_modes])
                mixture.compare(likelihood, self._contrast(mixture, good, nus, covariances))
        elif lag_s == 0.0:
            if dt > _SETTLES_S:
                self._settled_s = rows.epoch_s + _SETTLES_S
            alone = rows.epoch_s < self._settled_s
            if window.points.add(good, self._theta[order[mode]], alone=alone) or alone:
                self._renew(window, mixture, rows)

    def _contrast(self, mixture: Mixture, rows: Rows, nu: Array, S: Array) -> Contrast:
        """Between the modes in the rows of one epoch.

        An error of navigation lasts, but counts as if it were new: on the safe side.
        """
        variance = rows.position_m**2 + self._behaviour.errors.navigation_m**2
        return contrast_in_epoch(rows, mixture.x[:, 0, : self._behaviour.d], nu, S, variance)

    def _on_trajectory(self, x: Array) -> Array:
        """Where to linearise between two renewals: where the window's rows are linearised.

        An epoch linearised elsewhere contradicts them (with clocks and navigation from Table
        1's P0 x 20² the median NEES is 6 half a second later).
        """
        d, (since_s, nominal) = self._behaviour.d, self._nominal
        at = x.copy()
        at[..., :d] = (nominal[:, :d] + (self.epoch_s - since_s) * nominal[:, d:])[:, None]
        at[..., d : 2 * d] = nominal[:, None, d:]
        return at

    def _renew(self, window: Window, mixture: Mixture, rows: Rows) -> None:
        """Take the states anew from the window, or end it."""
        best = mixture.best
        sight = mixture.x[best, 0, : self._behaviour.d] - rows.second_at
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
        d = self._behaviour.d
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
