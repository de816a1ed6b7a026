"""The most probable trajectory over a window of epochs, the receivers' errors averaged out.

All epochs of the window are linearised at one trajectory, and again at each better one: linearised
at different estimates they would contradict each other, and the contradiction would look like
information (``docs/explanation/track.md``). With a constant-velocity start ``theta = [e, v]`` at
the window's first epoch the rows are ``z_a = h_a(theta) + eps_a``, ``eps ~ N(0, Sigma)``, with
Sigma in closed form (:mod:`~swarmctl.estimation.track.window_covariance`).

Gauss-Newton on theta, damped by Levenberg and Marquardt while a step does not lower the objective,
has four or six unknowns whatever the number of receivers. Each iteration linearises at the straight
line *and* the most probable random motion ``w(t) = diag(q) sum_a walk(t, t_a) g_a (Sigma⁻¹ r)_a``.
A window that has grown by a block begins where it was, and one iteration is enough then.

The epochs are kept as normal points (:mod:`~swarmctl.estimation.track.window_blocks`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dtrtrs

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import as_covariance, as_finite
from swarmctl.estimation.model.motion import transition
from swarmctl.estimation.model.receiver_errors import ReceiverErrors, predict
from swarmctl.estimation.track.contrast import Contrast, contrast_of_pair
from swarmctl.estimation.track.window_blocks import NormalPoints, Table
from swarmctl.estimation.track.window_covariance import RowCovariance, by_receiver, walk
from swarmctl.units import Array, Mask

_REACH = 0.5
"""A step moves the emitter by at most this share of its distance to the nearest receiver."""
_SMALL_STEP = 0.05
"""A step below this squared number of sigmas ends the search."""
_ALIKE = 0.01
"""Share of the range by which two trajectories may differ and be linearised alike."""
_BENT = 0.05
"""Greatest share of the range by which the emitter may stray from straight lines in a block."""


class Pull(NamedTuple):
    """What pulls the emitter off some straight lines, S of them: one random force per row.

    Attributes:
        time: Times of the rows since the window's first epoch, (M,), s.
        force: g Sigma⁻¹ r of each row, (S, M, d), 1/m.
    """

    time: Array
    force: Array


class Fit(NamedTuple):
    """Local maxima of the probability, one for each start.

    Attributes:
        theta: Position and velocity at the window's first epoch, (S, 2d), SI.
        objective: -2 log of the evidence about it, up to a constant, (S,): smaller is more
            probable, by exp(-difference / 2).
        information: Inverse covariance of theta, (S, 2d, 2d).
        residual: Whitened, at theta, (S, M): unit normal if the model is right.
        slope: Whitened derivative of the rows by theta, (S, M, 2d).
        root: Lower Cholesky factor of Sigma, (S, M, M), m.
        sights: Unit lines of sight of each row, from its first and its second receiver,
            (2, S, M, d).
        bend: Where the emitter strays from theta's straight line at each row's time, and the
            rows are linearised, (S, M, d), m.
    """

    theta: Array
    objective: Array
    information: Array
    residual: Array
    slope: Array
    root: Array
    sights: Array
    bend: Array


class Window:
    """The epochs since the track began, and the trajectory that explains them best.

    Attributes:
        begin_s: The first epoch, s.
        points: The epochs.

    Args:
        mean: Prior of position and velocity at the first epoch, (2d,), SI.
        covariance: Covariance of the prior, (2d, 2d), positive definite.
        errors: The receivers' error model.
        psd: Spectral density of the emitter's acceleration per axis, (d,), m²/s³.
        begin_s: The first epoch, s.
        block_s: Length of a block, s.
        capacity: Rows kept at most.

    Raises:
        EstimationError: A shape is wrong, a number not finite, or the prior no covariance.
    """

    def __init__(
        self,
        mean: Array,
        covariance: Array,
        errors: ReceiverErrors,
        psd: Array,
        begin_s: float,
        *,
        block_s: float = 0.5,
        capacity: int = 96,
    ) -> None:
        self._mean = as_finite("mean", mean, None)
        n = self._mean.size
        self._information = np.linalg.inv(as_covariance("covariance", covariance, n, n))
        self._d = n // 2
        self._errors = errors
        self._psd = psd
        self.begin_s = begin_s
        self.points = NormalPoints(self._d, begin_s, block_s, capacity)

    def worst(self, fit: Fit, index: int) -> tuple[int, float]:
        """The row that fits least, and how many sigmas its residual has.

        ``(Sigma'⁻¹ r)_a / sqrt(Sigma'⁻¹_aa)``, Baarda's statistic, with Sigma' the covariance
        of the rows about the fitted trajectory's: theta unknown.
        """
        inverse = np.linalg.inv(fit.root[index])
        weighted = inverse.T @ fit.residual[index]
        projected = inverse.T @ fit.slope[index]
        diagonal = (inverse * inverse).sum(0)
        diagonal -= np.vecdot(projected, np.linalg.solve(fit.information[index], projected.T).T)
        statistic = np.abs(weighted) / np.sqrt(np.maximum(diagonal, 1e-12))
        row = int(np.argmax(statistic))
        return row, float(statistic[row])

    def evidence(self, fit: Fit, one: int, other: int) -> float:
        """Log-likelihood ratio of the rows, of the modes from two starts, as far as it is real.

        Where the rows scatter about the first more than they were told to, all noise is taken
        for so much greater: a trajectory that does not fit is a poor judge of its mirror image.

        Returns:
            In favour of the other.
        """
        squares = np.vecdot(fit.residual, fit.residual)
        scatter = max(1.0, float(squares[one]) / fit.residual.shape[-1])
        contrast = self.contrast(fit, one, other)
        share = replace(contrast, found=contrast.found / scatter).share
        return float(share * 0.5 * (squares[one] - squares[other]) / scatter)

    def contrast(self, fit: Fit, one: int, other: int) -> Contrast:
        """Between the modes found from two of the starts.

        The noise is that of the reported positions, the white part and what lasts of it.
        """
        table, errors = self.points.table(), self._errors
        pair = [one, other]
        residual = np.matvec(fit.root[pair], fit.residual[pair])
        sights = fit.sights[:, pair]
        sigma = np.sqrt(table.position)
        delta = np.outer(sigma, sigma) * (table.block[:, None] == table.block)
        apart = np.abs(table.time[:, None] - table.time)
        delta += errors.navigation_m**2 * np.exp(-apart / errors.navigation_tau_s)
        receivers = np.stack([table.signs.argmin(0), table.signs.argmax(0)])
        turned = sights[:, 1] - sights[:, 0]
        return contrast_of_pair(residual[0] - residual[1], fit.root[one], receivers, turned, delta)

    def is_stretched(self, distance_m: float) -> bool:
        """Whether the emitter may stray too far within one block, seen from so far away."""
        longest = float(self.points.table().span.max())
        return math.sqrt(float(self._psd.max()) * longest**3 / 3.0) > _BENT * distance_m

    def fit(self, starts: Array, iterations: int = 3, pull: Pull | None = None) -> Fit:
        """Climb to the most probable trajectories near some starts.

        Args:
            starts: (S, 2d), SI.
            iterations: At most so many steps.
            pull: What bends them; None for straight lines.

        Raises:
            EstimationError: The window has no rows, or their numbers have no finite result.
        """
        if self.points.is_empty:
            raise EstimationError("A window without measurements fits any trajectory.")
        table = self.points.table()
        try:
            covariance = RowCovariance(table, self._errors, self._psd)
            if pull is None:
                pull = Pull(table.time[:0], np.zeros((len(starts), 0, self._d)))
            best = self._evaluate(starts, self._bend(pull, table), table, covariance)
            damping = np.zeros(len(starts))
            for _ in range(iterations):
                A = best.information
                gradient = np.vecmat(best.residual, best.slope)
                gradient += np.matvec(self._information, self._mean - best.theta)
                diagonal = damping[:, None] * np.linalg.diagonal(A)
                damped = A + diagonal[:, :, None] * np.eye(2 * self._d)
                step = np.linalg.solve(damped, gradient[..., None])[..., 0]
                step *= self._reach(best, step, table)[:, None]
                length = np.vecdot(step, np.matvec(A, step))
                bend = self._bend(self.pull(_moved(best, step)), table)
                if (length < _SMALL_STEP).all() and self._is_alike(best, bend, table):
                    break
                proposed = self._evaluate(best.theta + step, bend, table, covariance)
                better = proposed.objective < best.objective + 1e-3
                best = _choose(better, proposed, best)
                damping = np.where(better, damping / 10.0, np.maximum(4.0 * damping, 0.1))
        except np.linalg.LinAlgError:
            raise EstimationError("The window's covariance is not one.") from None
        if not np.isfinite(best.objective).all():
            raise EstimationError("The window's numbers have no finite result.")
        return self._finish(best)

    def _finish(self, best: Fit) -> Fit:
        """The last, small step, by the linearisation at hand."""
        gradient = np.vecmat(best.residual, best.slope)
        gradient += np.matvec(self._information, self._mean - best.theta)
        step = np.linalg.solve(best.information, gradient[..., None])[..., 0]
        length = np.vecdot(step, np.matvec(best.information, step))
        step *= (length < 1.0)[:, None]
        return _moved(best, step)

    def _reach(self, fit: Fit, step: Array, table: Table) -> Array:
        d = self._d
        sight = _path(fit.theta, fit.bend, table) - table.at[1]
        nearest = np.sqrt(np.vecdot(sight, sight)).min(-1)
        last = table.time.max()
        moved = np.linalg.norm(step[:, :d] + last * step[:, d:], axis=1)
        moved = np.maximum(moved, np.linalg.norm(step[:, :d], axis=1))
        share: Array = np.minimum(1.0, _REACH * (nearest + 1e-3) / (moved + 1e-9))
        return share

    @staticmethod
    def _is_alike(fit: Fit, bend: Array, table: Table) -> bool:
        """Whether linearising at another bend would change nothing."""
        off, sight = bend - fit.bend, _path(fit.theta, fit.bend, table) - table.at[1]
        return bool((np.vecdot(off, off) <= _ALIKE**2 * np.vecdot(sight, sight)).all())

    def pull(self, fit: Fit) -> Pull:
        """What pulls the emitter off a fit's straight lines, for the next one to begin with."""
        weighted = _solved(fit.root, fit.residual[..., None], transposed=True)
        return Pull(self.points.table().time, (fit.sights[1] - fit.sights[0]) * weighted)

    def _bend(self, pull: Pull, table: Table) -> Array:
        """Where the emitter most probably strays from the straight line, (S, M, d), m."""
        bend: Array = (walk(table.time, pull.time) @ pull.force) * self._psd
        return bend

    def _evaluate(self, theta: Array, bend: Array, table: Table, covariance: RowCovariance) -> Fit:
        sight = _path(theta, bend, table) - table.at[:, None]  # (2, S, M, d)
        distance = np.sqrt(np.vecdot(sight, sight)) + 1e-9
        u = sight / distance[..., None]
        g = u[1] - u[0]
        root = np.linalg.cholesky(covariance.along(u))
        J = np.concatenate([g, table.time[:, None] * g], axis=-1)
        r = table.rd - (distance[1] - distance[0]) + np.vecdot(g, bend)
        rows = np.concatenate([J, r[..., None]], axis=-1)
        whitened = _solved(root, rows)
        slope, residual = whitened[..., :-1], whitened[..., -1]
        off = theta - self._mean
        objective = np.vecdot(residual, residual)
        objective += np.vecdot(off, np.matvec(self._information, off))
        objective += 2.0 * np.log(np.linalg.diagonal(root)).sum(-1)
        information = slope.mT @ slope + self._information
        return Fit(theta, objective, information, residual, slope, root, u, bend)

    def condense(self, fit: Fit, index: int, epoch_s: float) -> tuple[Array, Array]:
        """The state of emitter and receivers at an epoch, given all rows.

        Args:
            fit: A fit of this window as it is.
            index: Which of its starts.
            epoch_s: s, not before the last row.

        Returns:
            x (n,) and P (n, n) of ``[e, v | receivers in the order of points.receivers]``.
        """
        d, errors = self._d, self._errors
        table = self.points.table()
        layout = errors.layout(d)
        receivers = len(table.signs)
        n = 2 * d + receivers * layout.size
        T = epoch_s - self.begin_s
        t = table.time
        u = fit.sights[:, index : index + 1]
        g = (u[1] - u[0])[0]
        C = np.zeros((n, t.size))
        C[:d] = (t * t * (0.5 * T - t / 6.0)) * self._psd[:, None] * g.T
        C[d : 2 * d] = (0.5 * t * t) * self._psd[:, None] * g.T
        of_receivers = C[2 * d :].reshape(receivers, layout.size, t.size)
        if layout.bias is not None:
            together = errors.bias_m**2 + errors.drift_mps**2 * T * t
            of_receivers[:, layout.bias] = table.signs * together
        if layout.drift is not None:
            of_receivers[:, layout.drift] = table.signs * (errors.drift_mps**2 * t)
        if layout.navigation is not None:
            decay = errors.navigation_m**2 * np.exp((t - T) / errors.navigation_tau_s)
            place = slice(layout.navigation, layout.navigation + d)
            of_receivers[:, place] = decay * by_receiver(table, u)[0]
        if layout.colour is not None:
            tau = errors.colour_tau_s
            span = np.maximum(table.span, 1e-3 * tau)
            ago = np.stack([T - t + 0.5 * span, T - t - 0.5 * span])
            once = np.sign(ago) * -np.expm1(-np.abs(ago) / tau)
            decay = tau * (once[0] - once[1]) / span
            of_receivers[:, layout.colour] = table.signs * (errors.colour_m**2 * decay)

        P = np.diag(np.concatenate([np.zeros(2 * d), np.tile(errors.variance(d), receivers)]))
        _, P = predict(np.zeros(n), P, T, self._psd, errors, layout)
        whitened = _solved(fit.root[index : index + 1], C.T[None])[0]
        B = -whitened.T @ fit.slope[index]
        F = transition(T, d)
        B[: 2 * d] += F
        x = whitened.T @ fit.residual[index]
        x[: 2 * d] += F @ fit.theta[index]
        of_theta = np.linalg.inv(fit.information[index])
        P = P - whitened.T @ whitened + B @ of_theta @ B.T
        return x, 0.5 * (P + P.T)


def _solved(root: Array, rows: Array, *, transposed: bool = False) -> Array:
    """``root⁻¹ rows``, or ``root⁻ᵀ rows``, of lower triangular roots, (S, M, M) and (S, M, K).

    By LAPACK itself, since its wrappers cost more than the solution. Its matrices are stored by
    columns: it takes a root's transpose, an upper triangle, as it is.
    """
    trans = 0 if transposed else 1
    found = [dtrtrs(L.T, B, lower=0, trans=trans)[0] for L, B in zip(root, rows, strict=True)]
    return np.stack(found)


def _path(theta: Array, bend: Array, table: Table) -> Array:
    """Where the emitter is at each row's time, (S, M, d), m."""
    d = bend.shape[-1]
    at: Array = theta[:, None, :d] + table.time[:, None] * theta[:, None, d:] + bend
    return at


def _moved(fit: Fit, step: Array) -> Fit:
    """By a step of theta, (S, 2d), small enough for the linearisation at hand."""
    residual = fit.residual - np.matvec(fit.slope, step)
    return fit._replace(theta=fit.theta + step, residual=residual)


def _choose(better: Mask, proposed: Fit, best: Fit) -> Fit:
    if better.all():
        return proposed

    def pick(new: Array, old: Array) -> Array:
        return np.where(better.reshape(-1, *[1] * (old.ndim - 1)), new, old)

    return Fit(
        pick(proposed.theta, best.theta),
        pick(proposed.objective, best.objective),
        pick(proposed.information, best.information),
        pick(proposed.residual, best.residual),
        pick(proposed.slope, best.slope),
        pick(proposed.root, best.root),
        np.where(better[:, None, None], proposed.sights, best.sights),
        pick(proposed.bend, best.bend),
    )
