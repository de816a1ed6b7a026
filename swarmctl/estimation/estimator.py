"""One live track: range differences (RDs) of any pairs in, an honest estimate out.

No clock and no history of positions: it is handed the rows of one epoch after the other, with
the receivers' reported positions at that epoch, and put together from

====================  ====================================================================
``initial``           where to look, from a sector or nothing
``acquisition``       the first second: echoes out, every mode found
``window``            the most probable trajectories while the track is wide
``nuisance``          clocks, navigation and colour of the receivers, as states
``augmented``         the update of emitter and receivers
``robust``            echoes set aside
``manoeuvre``         an emitter that turns or stops
``health``            whether all this may be believed
====================  ====================================================================

Begin
    Where the first innovation could not tell an echo from a poor prior, the first half second
    or so is collected, cleaned of echoes pair by pair, and every mode of the posterior sought.
    All probable modes (mirror images) are carried, each with its probability.
Width
    While the window lasts, the states are taken anew from it whenever a block is complete. It
    ends when straight lines of sight are good enough to linearise at for good, when the
    emitter manoeuvres, or when process noise has bent the track too far.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation import augmented
from swarmctl.estimation.acquisition import distinct, is_ready, search
from swarmctl.estimation.arguments import Array, as_covariance, as_finite
from swarmctl.estimation.augmented import Rows
from swarmctl.estimation.health import Health, Verdict
from swarmctl.estimation.initial import Prior, is_wide
from swarmctl.estimation.manoeuvre import Manoeuvre, matched
from swarmctl.estimation.nuisance import ReceiverErrors, predict
from swarmctl.estimation.robust import screen
from swarmctl.estimation.window import Fit, Window

_CLEAR = 10.0
"""A first innovation of more sigmas of white noise cannot tell an echo from a poor prior."""
_IMPROBABLE = 1e-4
"""Share of the best mode's probability below which a mode is forgotten."""
_MODES = 4
"""Modes carried at most."""
_AHEAD_S = 5.0
_STRAIGHT = 0.05
"""The window ends when the curvature of the RDs over the spread expected ``_AHEAD_S`` from now
is below this share of their white noise."""
_TURNED = 0.9
"""Probability of a manoeuvre that ends the window."""


class Estimate(NamedTuple):
    """What is known of the emitter.

    Attributes:
        epoch_s: s.
        x: Position and velocity, (2d,), SI.
        P: Covariance, (2d, 2d).
        probability: That it is here and not at one of the alternatives.
        manoeuvre: Probability that the emitter is manoeuvring.
    """

    epoch_s: float
    x: Array
    P: Array
    probability: float
    manoeuvre: float


class Limits(NamedTuple):
    """What the position's variance would lose if something were known, as shares of it.

    Attributes:
        clock: If the clocks' biases and drifts were known.
        navigation: If the receivers' positions were.
        colour: If the coloured errors were.
    """

    clock: float
    navigation: float
    colour: float


class Estimator:
    """The track of one emitter.

    Attributes:
        epoch_s: Of the newest rows; minus infinity before the first.
        verdict: Health after the newest rows.
        used: Rows used.
        aside: Rows set aside as echoes.
        innovation: Of the newest rows less those set aside, whitened, (k,): independent unit
            normal numbers if all is right. Empty while rows are collected.

    Args:
        prior: Of position and velocity, d axes each, at the first epoch.
        errors: The receivers' error model.
        process_noise: Spectral density of the emitter's acceleration per axis, (d,), m²/s³.
        manoeuvre: How it may change its mind; None for an emitter that does not.
        block_s: Length of a block of the window, s.
        capacity: Rows of the window.

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
        capacity: int = 128,
    ) -> None:
        self._psd = as_finite("process_noise", process_noise, None)
        d = self._d = self._psd.size
        if d not in {2, 3} or not (self._psd >= 0.0).all():
            raise EstimationError(
                f"process_noise must be 2 or 3 numbers >= 0, not {list(process_noise)}."
            )
        self._prior = Prior(
            as_finite("prior.mean", prior.mean, 2 * d),
            as_covariance("prior.covariance", prior.covariance, 2 * d, 2 * d),
        )
        self._errors = errors
        self._layout = errors.layout(d)
        self._manoeuvre = manoeuvre
        self._models = 1 if manoeuvre is None else 2
        self._block_s = block_s
        self._capacity = capacity
        self.used = 0
        self.aside = 0
        self.epoch_s = -math.inf
        self._begin_again()

    def _begin_again(self) -> None:
        self._window: Window | None = None
        self._collected: list[Rows] | None = None
        self._places: dict[int, int] = {}
        self._health = Health()
        self.verdict = Verdict("initialising", None, 1.0, 0.0, 0.0)
        self.innovation: Array = np.zeros(0)
        # Modes x models: states, covariances, probabilities; and each mode's trajectory.
        n = 2 * self._d
        self._x: Array = np.zeros((0, self._models, n))
        self._P: Array = np.zeros((0, self._models, n, n))
        self._weight: Array = np.zeros((0, self._models))
        self._log_probability: Array = np.zeros(0)
        self._theta: Array = np.zeros((0, n))

    @property
    def is_resolved(self) -> bool:
        """Whether one mode is left."""
        return len(self._x) == 1

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
            EstimationError: The rows' numbers have no finite result.
        """
        try:
            if not len(self._x) and self._collected is None:
                self._begin(rows)
            if self._collected is None:
                self._advance(rows)
                return True
            self._collected.append(rows)
            self.epoch_s = max(self.epoch_s, rows.epoch_s)
            if is_ready(self._collected):
                self._acquire(self._collected)
        except np.linalg.LinAlgError:
            raise EstimationError("The rows' numbers have no finite result.") from None
        return self._collected is None

    def estimates(self) -> list[Estimate]:
        """What is known at :attr:`epoch_s`, the most probable first; empty if nothing is."""
        if self._collected is not None:
            return []
        probability = self._probabilities()
        n = 2 * self._d
        found = []
        for k in np.argsort(-probability):
            x, P = matched(self._x[k, :, :n], self._P[k, :, :n, :n], self._weight[k])
            turning = float(self._weight[k, 1:].sum())
            found.append(Estimate(self.epoch_s, x, P, float(probability[k]), turning))
        return found

    def predict_to(self, epoch_s: float) -> Estimate:
        """The most probable mode at another epoch.

        Of a later one: by its more probable model of motion, for nobody can tell whether an
        emitter that is not heard manoeuvres.

        Raises:
            EstimationError: There is no estimate yet.
        """
        if not len(self._x):
            raise EstimationError("There is no estimate yet.")
        best = self.estimates()[0]
        x, P = self._mode_at(int(np.argmax(self._log_probability)), epoch_s)
        return best._replace(epoch_s=epoch_s, x=x, P=P)

    def mixture_to(self, epoch_s: float) -> Estimate:
        """As :meth:`predict_to`, but with the covariance of all modes together about its mean.

        For who must not trust one of several mirror images.

        Raises:
            EstimationError: There is no estimate yet.
        """
        best = self.predict_to(epoch_s)
        modes = [self._mode_at(k, epoch_s) for k in range(len(self._x))]
        off = np.stack([x for x, _ in modes]) - best.x
        covariances = np.stack([P for _, P in modes]) + off[:, :, None] * off[:, None, :]
        return best._replace(P=(self._probabilities()[:, None, None] * covariances).sum(0))

    def _mode_at(self, k: int, epoch_s: float) -> tuple[Array, Array]:
        """Emitter by mode k at another epoch."""
        d, n = self._d, 2 * self._d
        dt = epoch_s - self.epoch_s
        if dt <= 0.0:
            x, P = matched(self._x[k, :, :n], self._P[k, :, :n, :n], self._weight[k])
            F = np.eye(n)
            F[:d, d:] = dt * np.eye(d)
            return F @ x, F @ P @ F.T
        model = int(np.argmax(self._weight[k]))
        return predict(
            self._x[k, model, :n],
            self._P[k, model, :n, :n],
            dt,
            self._psd_of_models()[model],
            ReceiverErrors(),
            ReceiverErrors().layout(d),
        )

    def limits(self) -> Limits:
        """What limits the accuracy of the most probable mode now; the rest is noise."""
        k = int(np.argmax(self._log_probability))
        P = self._P[k, int(np.argmax(self._weight[k]))]
        d, layout = self._d, self._layout
        variance = float(np.trace(P[:d, :d]))

        def known(*parts: tuple[int | None, int]) -> float:
            states = [
                place + part + axis
                for place in self._places.values()
                for part, width in parts
                if part is not None
                for axis in range(width)
            ]
            if not states:
                return 0.0
            across = P[:d, states]
            inner = P[np.ix_(states, states)]
            return float(np.trace(across @ np.linalg.solve(inner, across.T)) / variance)

        return Limits(
            known((layout.bias, 1), (layout.drift, 1)),
            known((layout.navigation, d)),
            known((layout.colour, 1)),
        )

    def receiver(self, receiver: int) -> tuple[Array, Array]:
        """Errors of a receiver by the most probable mode, and their covariance.

        Args:
            receiver: Its id.

        Returns:
            (size,) and (size, size), as in :class:`~swarmctl.estimation.nuisance.Layout`.

        Raises:
            EstimationError: It has not been heard.
        """
        own = self._states_of(receiver)
        return self._of_states(np.eye(self._x.shape[-1])[own])

    def relative(self, receiver: int, to: int) -> tuple[Array, Array]:
        """Errors of a receiver less those of another, and the covariance of the differences.

        Range differences tell no more of the errors than this.

        Args:
            receiver: Its id.
            to: Id of the other.

        Returns:
            (size,) and (size, size), as :meth:`receiver`, by the most probable mode.

        Raises:
            EstimationError: One of them has not been heard.
        """
        each = np.eye(self._x.shape[-1])
        return self._of_states(each[self._states_of(receiver)] - each[self._states_of(to)])

    def _states_of(self, receiver: int) -> slice:
        if receiver not in self._places or not len(self._x):
            raise EstimationError(f"Receiver {receiver} has not been heard.")
        return slice(self._places[receiver], self._places[receiver] + self._layout.size)

    def _of_states(self, of: Array) -> tuple[Array, Array]:
        """Mean and covariance of linear functions of the most probable mode's states."""
        k = int(np.argmax(self._log_probability))
        return matched(self._x[k] @ of.T, of @ self._P[k] @ of.T, self._weight[k])

    # --- The beginning -----------------------------------------------------------------

    def _begin(self, rows: Rows) -> None:
        self._window = Window(
            self._prior.mean,
            self._prior.covariance,
            self._errors,
            self._psd,
            rows.epoch_s,
            block_s=self._block_s,
            capacity=self._capacity,
        )
        self.epoch_s = rows.epoch_s
        self._set(self._prior.mean[None], self._prior.covariance[None], {})
        self._theta = self._prior.mean[None]
        self._log_probability = np.zeros(1)
        self._admit(rows)
        S = augmented.innovate(self._x, self._P, rows, self._places, self._layout).S
        white = np.diagonal(rows.covariance)
        receivers = np.concatenate([rows.first_at, rows.second_at])
        if (np.diagonal(S[0, 0]) > _CLEAR**2 * white).any() or is_wide(self._prior, receivers):
            self._collected = []
            self._set(np.zeros((0, 2 * self._d)), np.zeros((0, 2 * self._d, 2 * self._d)), {})

    def _set(self, x: Array, P: Array, places: dict[int, int]) -> None:
        """Take states of modes, (S, n) and (S, n, n), for all models."""
        models = (len(x), self._models)
        self._x = np.broadcast_to(x[:, None], (*models, x.shape[-1])).copy()
        self._P = np.broadcast_to(P[:, None], (*models, *P.shape[1:])).copy()
        self._weight = np.broadcast_to(np.eye(self._models)[0], models).copy()
        self._places = places

    def _acquire(self, collected: list[Rows]) -> None:
        window = self._window
        if window is None:
            raise EstimationError("There is no window to acquire from.")
        fit = search(window, self._prior, collected, self._errors.colour_m)
        kept = window.points.measurements
        self.used += kept
        self.aside += sum(len(rows.rd) for rows in collected) - kept
        self._collected = None
        self._take(fit)

    def _take(self, fit: Fit) -> None:
        """The states of the distinct and probable modes of a fit."""
        window = self._window
        if window is None:
            raise EstimationError("There is no window to take modes from.")
        score = -0.5 * fit.objective - 0.5 * np.linalg.slogdet(fit.information)[1]
        likely = score.max() + math.log(_IMPROBABLE)
        chosen = [k for k in distinct(fit, score) if score[k] >= likely][:_MODES]
        states = [window.condense(fit, k, self.epoch_s) for k in chosen]
        places = {
            receiver: 2 * self._d + k * self._layout.size
            for k, receiver in enumerate(window.points.receivers)
        }
        self._set(np.stack([x for x, _ in states]), np.stack([P for _, P in states]), places)
        self._theta = fit.theta[chosen]
        self._log_probability = score[chosen]

    # --- Going on ----------------------------------------------------------------------

    def _psd_of_models(self) -> Array:
        if self._manoeuvre is None:
            return self._psd[None]
        return np.stack([self._psd, self._psd + self._manoeuvre.psd])

    def _admit(self, rows: Rows) -> None:
        """Give the receivers met for the first time their states."""
        variance = self._errors.variance(self._d)
        for receiver in (*rows.first, *rows.second):
            if receiver in self._places:
                continue
            n = self._x.shape[-1]
            self._places[receiver] = n
            more = variance.size
            self._x = np.pad(self._x, ((0, 0), (0, 0), (0, more)))
            self._P = np.pad(self._P, ((0, 0), (0, 0), (0, more), (0, more)))
            self._P[..., n:, n:] = np.diag(variance)

    def _advance(self, rows: Rows) -> None:
        self._admit(rows)
        dt = rows.epoch_s - self.epoch_s
        x, P, weight = self._x, self._P, self._weight
        if dt > 0.0:
            if self._manoeuvre is not None:
                x, P, weight = self._manoeuvre.mix(x, P, weight, dt, self._d)
            x, P = predict(x, P, dt, self._psd_of_models(), self._errors, self._layout)
        lag_s = min(dt, 0.0)
        self.epoch_s = max(self.epoch_s, rows.epoch_s)
        at = None if self._window is None else self._on_trajectory(x, self._window.begin_s)
        first = augmented.innovate(x, P, rows, self._places, self._layout, lag_s, at)

        # A receiver that only a wrong mirror image finds wrong tells the images apart.
        candidates = []
        for k in np.argsort(-self._log_probability):
            nu, S = matched(first.nu[k], first.S[k], weight[k])
            candidates.append((screen(nu, S, rows), int(k), nu, S))
        screened, best, nu, S = min(candidates, key=lambda candidate: len(candidate[0].aside))
        posterior = augmented.update(
            x,
            P,
            rows._replace(covariance=screened.covariance),
            self._places,
            self._layout,
            lag_s=lag_s,
            first=first,
            iterations=3 if at is None else 1,
        )
        self._x, self._P = posterior.x, posterior.P
        likelihood = posterior.log_likelihood
        highest = likelihood.max(-1, keepdims=True)
        weight = weight * np.exp(likelihood - highest)
        total = weight.sum(-1, keepdims=True)
        self._weight = weight / total

        kept = screened.kept
        count = int(kept.sum())
        self.used += count
        self.aside += len(kept) - count
        good = rows if count == len(kept) else rows.where(kept)
        root = np.linalg.cholesky(S[np.ix_(kept, kept)])
        self.innovation = white = np.linalg.solve(root, nu[kept])
        pairs = tuple(zip(good.first, good.second, strict=True))
        self.verdict = self._health.add(
            self.epoch_s, pairs, white, len(kept) - count, screened.aside
        )
        if self._window is None:
            self._compare((highest + np.log(total))[:, 0])
        elif count and lag_s == 0.0 and self._window.points.add(good, self._theta[best]):
            self._renew(self._window, rows)

    def _on_trajectory(self, x: Array, begin_s: float) -> Array:
        """Where to linearise between two renewals: where the window's rows are linearised.

        An epoch linearised elsewhere contradicts them (with clocks and navigation from Table
        1's P0 x 20² the median NEES is 6 half a second later).
        """
        d, theta = self._d, self._theta[:, None]
        at = x.copy()
        at[..., :d] = theta[..., :d] + (self.epoch_s - begin_s) * theta[..., d:]
        at[..., d : 2 * d] = theta[..., d:]
        return at

    def _compare(self, log_likelihood: Array) -> None:
        """Without a window: the modes' probabilities after an epoch, the improbable dropped."""
        if self.is_resolved:
            return
        log_probability = self._log_probability + log_likelihood
        kept = log_probability > log_probability.max() + math.log(_IMPROBABLE)
        self._log_probability = log_probability[kept]
        self._x, self._P, self._weight = self._x[kept], self._P[kept], self._weight[kept]
        self._theta = self._theta[kept]

    def _renew(self, window: Window, rows: Rows) -> None:
        """Take the states anew from the window, or end it."""
        best = int(np.argmax(self._log_probability))
        sight = self._x[best, 0, : self._d] - rows.second_at
        nearest = float(np.sqrt(np.vecdot(sight, sight)).min())
        turning = self._models > 1 and self._weight[best, 1] > _TURNED
        if turning or window.is_stretched(nearest, self.epoch_s):
            self._window = None
            return
        window.points.compress(self._theta[best])
        self._take(window.fit(self._theta))
        self._admit(rows)
        if self.is_resolved and self._is_straight(rows):
            self._window = None

    def _is_straight(self, rows: Rows) -> bool:
        """Whether linearising at the estimate will do from now on."""
        d = self._d
        ahead = np.eye(2 * d)[:d]
        ahead[:, d:] = _AHEAD_S * np.eye(d)
        P = ahead @ self._P[0, 0, : 2 * d, : 2 * d] @ ahead.T
        variance = float(np.linalg.eigvalsh(P)[-1])
        positions = np.concatenate([rows.first_at, rows.second_at])
        aperture = float(np.sqrt(((positions - positions.mean(0)) ** 2).sum(-1)).max())
        sight = self._x[0, 0, :d] - positions
        nearest_squared = float(np.vecdot(sight, sight).min())
        white = math.sqrt(float(np.diagonal(rows.covariance).min()))
        return 0.5 * 2.0 * aperture * variance / nearest_squared < _STRAIGHT * white

    def _probabilities(self) -> Array:
        relative = np.exp(self._log_probability - self._log_probability.max(initial=-math.inf))
        share: Array = relative / relative.sum()
        return share
