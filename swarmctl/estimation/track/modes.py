"""Everything that is believed at one time: the modes of the posterior, by each model of motion.

Modes are places where the emitter may be (mirror images), told apart by their probabilities. Each
carries the quiet model of motion and, where the emitter may manoeuvre, a second one
(:mod:`~swarmctl.estimation.track.manoeuvre`), with a state ``[e, v | receiver | receiver | ...]``
of each (:mod:`~swarmctl.estimation.kernels.augmented`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.estimate import Estimate, Limits
from swarmctl.estimation.kernels import augmented
from swarmctl.estimation.kernels.augmented import Innovation
from swarmctl.estimation.model.receiver_errors import ReceiverErrors, predict
from swarmctl.estimation.model.rows import Rows
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.estimation.track.contrast import Contrast, no_contrast
from swarmctl.estimation.track.manoeuvre import moment_match
from swarmctl.units import Array, Mask

_IMPROBABLE = 1e-4
"""Share of the best mode's probability below which a mode is forgotten."""
_ALONE = ReceiverErrors()


def is_probable(log_probability: Array) -> Mask:
    """Which modes are not to be forgotten, (S,) of booleans."""
    probable: Mask = log_probability > log_probability.max() + math.log(_IMPROBABLE)
    return probable


class Mixture:
    """The modes, S of them, and the models of motion, M of them.

    Attributes:
        x: States, (S, M, n).
        P: Covariances, (S, M, n, n).
        weight: Probability of each model given the mode, (S, M).
        log_probability: Log-probability of each mode, up to a constant, (S,).
        places: Where each receiver's states begin, by id.
        best: Number of the mode to go by: the most probable, but for :meth:`keep_best`.

    Args:
        behaviour: How emitter and receivers behave.
        x: States, (S, n), of the quiet model.
        P: Covariances, (S, n, n).
        log_probability: (S,).
        places: Where each receiver's states begin in these.
    """

    def __init__(
        self,
        behaviour: Behaviour,
        x: Array,
        P: Array,
        log_probability: Array,
        places: dict[int, int],
    ) -> None:
        self._behaviour = behaviour
        self._layout = behaviour.layout
        self._psds = behaviour.process_noises
        count = (len(x), len(self._psds))
        self.x: Array = np.broadcast_to(x[:, None], (*count, x.shape[-1])).copy()
        self.P: Array = np.broadcast_to(P[:, None], (*count, *P.shape[1:])).copy()
        self.weight: Array = np.broadcast_to(np.eye(count[1])[0], count).copy()
        self.log_probability = log_probability
        self.places = places
        self.best = int(np.argmax(log_probability))
        # What it was at first, and what has been measured since.
        self._at_first = log_probability
        self._measured: Array = np.zeros(len(x))
        self._contrast = no_contrast(len(x))

    def keep_manoeuvre(self, before: Mixture, modes: Sequence[int]) -> None:
        """Go on believing what was believed of a manoeuvre.

        Args:
            before: The mixture that this one takes the place of, with all of its receivers.
            modes: Which of its modes these are, (S,).
        """
        index = np.arange(self.x.shape[-1])
        for receiver, place in self.places.items():
            own = np.arange(self._layout.size)
            index[place + own] = before.places[receiver] + own
        chosen = list(modes)
        self.x[:, 1:] = before.x[chosen][:, 1:, index]
        self.P[:, 1:] = before.P[chosen][:, 1:][..., index[:, None], index]
        self.weight = before.weight[chosen]

    def keep_best(self, mode: int) -> None:
        """Go on with the mode that was the best, unless another is twice as probable by now.

        Else who is led by it would be led to and fro between two that nothing tells apart.
        """
        most = int(np.argmax(self.log_probability))
        is_near = self.log_probability[mode] > self.log_probability[most] - math.log(2.0)
        self.best = mode if is_near else most

    # --- Time and measurement -------------------------------------------------------------

    def admit(self, rows: Rows) -> None:
        """Give the receivers met for the first time their states."""
        variance = self._behaviour.errors.variance(self._behaviour.d)
        for receiver in (*rows.first, *rows.second):
            if receiver in self.places:
                continue
            n = self.x.shape[-1]
            self.places[receiver] = n
            more = variance.size
            self.x = np.pad(self.x, ((0, 0), (0, 0), (0, more)))
            self.P = np.pad(self.P, ((0, 0), (0, 0), (0, more), (0, more)))
            self.P[..., n:, n:] = np.diag(variance)

    def predict(self, dt: float) -> None:
        """Time update by ``dt``, s, > 0."""
        x, P, behaviour = self.x, self.P, self._behaviour
        if behaviour.manoeuvre is not None:
            x, P, self.weight = behaviour.manoeuvre.mix(x, P, self.weight, dt, behaviour.d)
        self.x, self.P = predict(x, P, dt, self._psds, behaviour.errors, self._layout)

    def innovate(self, rows: Rows, lag_s: float, at: Array | None) -> Innovation:
        """As :func:`~swarmctl.estimation.kernels.augmented.innovate`."""
        return augmented.innovate(self.x, self.P, rows, self.places, self._layout, lag_s, at)

    def update(self, rows: Rows, lag_s: float, first: Innovation, iterations: int) -> Array:
        """Measurement update of every mode and model.

        Args:
            rows: The measurement.
            lag_s: Its time less that of the states, <= 0.
            first: Its innovation.
            iterations: At most so many linearisations.

        Returns:
            Log of its likelihood by each mode, (S,), up to a constant.

        Raises:
            EstimationError: The rows' numbers have no finite result.
        """
        posterior = augmented.update(
            self.x,
            self.P,
            rows,
            self.places,
            self._layout,
            lag_s=lag_s,
            first=first,
            iterations=iterations,
        )
        self.x, self.P = posterior.x, posterior.P
        likelihood = posterior.log_likelihood
        highest = likelihood.max(-1, keepdims=True)
        weight = self.weight * np.exp(likelihood - highest)
        total = weight.sum(-1, keepdims=True)
        self.weight = weight / total
        of_modes: Array = (highest + np.log(total))[:, 0]
        return of_modes

    def compare(self, log_likelihood: Array, contrast: Contrast) -> None:
        """Weigh the modes by a measurement, and forget the improbable.

        Args:
            log_likelihood: Its log-likelihood by each mode, (S,).
            contrast: Between any two of them, of (S, S).
        """
        self._measured = self._measured + log_likelihood
        self._contrast = self._contrast + contrast
        best = int(np.argmax(self._at_first + self._measured))
        ratio = self._contrast.share[best] * (self._measured - self._measured[best])
        log_probability = self._at_first + ratio
        kept = is_probable(log_probability)
        self.log_probability = log_probability[kept]
        self._at_first, self._measured = self._at_first[kept], self._measured[kept]
        self._contrast = self._contrast.where(kept)
        self.x, self.P, self.weight = self.x[kept], self.P[kept], self.weight[kept]
        if kept[self.best]:
            self.keep_best(int(kept[: self.best].sum()))
        else:
            self.best = int(np.argmax(self.log_probability))

    # --- What is known --------------------------------------------------------------------

    def estimates(self, epoch_s: float) -> list[Estimate]:
        """Each mode, :attr:`best` first, then the most probable.

        Args:
            epoch_s: Epoch of the states, s.
        """
        probability = self._probabilities()
        n = 2 * self._behaviour.d
        found = []
        for k in sorted(range(len(self.x)), key=lambda k: (k != self.best, -probability[k])):
            x, P = moment_match(self.x[k, :, :n], self.P[k, :, :n, :n], self.weight[k])
            turning = float(self.weight[k, 1:].sum())
            found.append(Estimate(epoch_s, x, P, float(probability[k]), turning))
        return found

    def after(self, dt: float) -> tuple[Array, Array]:
        """The emitter ``dt`` later, or earlier, by the most probable mode.

        A later time is reached by its more probable model of motion, for nobody can tell
        whether an emitter that is not heard manoeuvres.

        Returns:
            (2d,) and (2d, 2d).
        """
        return self._mode_after(self.best, dt)

    def all_after(self, dt: float) -> tuple[Array, Array]:
        """As :meth:`after`, with the covariance of all modes together about that mean."""
        best, _ = self.after(dt)
        modes = [self._mode_after(k, dt) for k in range(len(self.x))]
        off = np.stack([x for x, _ in modes]) - best
        covariances = np.stack([P for _, P in modes]) + off[:, :, None] * off[:, None, :]
        return best, (self._probabilities()[:, None, None] * covariances).sum(0)

    def _mode_after(self, k: int, dt: float) -> tuple[Array, Array]:
        d, n = self._behaviour.d, 2 * self._behaviour.d
        if dt <= 0.0:
            x, P = moment_match(self.x[k, :, :n], self.P[k, :, :n, :n], self.weight[k])
            F = np.eye(n)
            F[:d, d:] = dt * np.eye(d)
            return F @ x, F @ P @ F.T
        fits = int(np.argmax(self.weight[k]))
        x, P, psd = self.x[k, fits, :n], self.P[k, fits, :n, :n], self._psds[fits]
        return predict(x, P, dt, psd, _ALONE, _ALONE.layout(d))

    def limits(self) -> Limits:
        """What limits the accuracy of the most probable mode now; the rest is noise."""
        k = self.best
        P = self.P[k, int(np.argmax(self.weight[k]))]
        d, layout = self._behaviour.d, self._layout
        variance = float(np.trace(P[:d, :d]))

        def known(*parts: tuple[int | None, int]) -> float:
            states = [
                place + part + axis
                for place in self.places.values()
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

    def receiver(self, receiver: int, to: int | None = None) -> tuple[Array, Array]:
        """Errors of a receiver, or less those of another, by the most probable mode.

        Args:
            receiver: Its id.
            to: Id of the other.

        Returns:
            (size,) and their covariance, (size, size).

        Raises:
            EstimationError: One of them has not been heard.
        """
        of = self._states_of(receiver)
        if to is not None:
            of = of - self._states_of(to)
        k = self.best
        return moment_match(self.x[k] @ of.T, of @ self.P[k] @ of.T, self.weight[k])

    def _states_of(self, receiver: int) -> Array:
        """What picks a receiver's states, (size, n)."""
        if receiver not in self.places:
            raise EstimationError(f"Receiver {receiver} has not been heard.")
        begin = self.places[receiver]
        return np.eye(self.x.shape[-1])[begin : begin + self._layout.size]

    def _probabilities(self) -> Array:
        relative = np.exp(self.log_probability - self.log_probability.max())
        share: Array = relative / relative.sum()
        return share
