r"""What the errors of a window's rows have in common: their covariance, in closed form.

All that a row ``rd = h(straight line) + eps`` is uncertain of besides the line is linear and
Gaussian, so the covariance of eps is known (Rasmussen, Williams, "Gaussian Processes for Machine
Learning", 2006, ch. 2). With t since the window's first epoch and s_ra = +1, -1, 0 as receiver r
is the second, the first or no part of row a, two rows a, b have, receiver by receiver,

    s_ra s_rb [bias² + drift² t_a t_b + nav² exp(-|t_a - t_b| / tau) u_raᵀ u_rb + colour ...]

and from the emitter's white acceleration of density q, with g_a = u_ja - u_ia and t_a <= t_b,
``g_aᵀ diag(q) g_b (t_a² t_b / 2 - t_a³ / 6)``. The mean of the emitter's random part over a
block of length L is not its value in the middle: they differ by a variance of q L³ / 320.

The lines of sight apart, all of it is fixed by the rows' times, and is worked out once.
"""

from __future__ import annotations

import numpy as np

from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.estimation.track.window_blocks import Table
from swarmctl.units import Array


class RowCovariance:
    """Sigma of a window's rows, whatever their lines of sight.

    Args:
        table: The rows, M of R receivers.
        errors: The receivers' error model.
        psd: Spectral density of the emitter's acceleration per axis, (d,), m²/s³.
    """

    def __init__(self, table: Table, errors: ReceiverErrors, psd: Array) -> None:
        self._table, self._psd = table, psd
        t = table.time
        scalar = errors.bias_m**2 + errors.drift_mps**2 * t[:, None] * t
        if errors.colour_m > 0.0:
            scalar += errors.colour_m**2 * averaged(t, table.span, errors.colour_tau_s)
        self._fixed = table.white + (table.signs.T @ table.signs) * scalar
        self._decay: Array | None = None
        if errors.navigation_m > 0.0:
            apart = np.abs(t[:, None] - t)
            self._decay = errors.navigation_m**2 * np.exp(-apart / errors.navigation_tau_s)
        self._walk: Array | None = None
        if psd.any():
            self._walk = walk(t, t)
            same_block = table.block[:, None] == table.block
            within = np.outer(table.span**1.5, table.span**1.5) / 320.0
            self._walk += within * same_block

    def along(self, u: Array) -> Array:
        """Sigma for lines of sight of the first and the second receivers, (2, S, M, d).

        Returns:
            (S, M, M), m².
        """
        Sigma = self._fixed
        if self._decay is not None:
            V = by_receiver(self._table, u).reshape(len(u[0]), -1, self._table.time.size)
            Sigma = Sigma + self._decay * (V.mT @ V)
        if self._walk is not None:
            g = u[1] - u[0]
            Sigma = Sigma + self._walk * ((g * self._psd) @ g.mT)
        return np.broadcast_to(Sigma, (len(u[0]), *self._fixed.shape))


def walk(time_s: Array, other_s: Array) -> Array:
    """Covariance of positions by white acceleration of density 1, (M, K), s³.

    Args:
        time_s: (M,), since it began.
        other_s: (K,).
    """
    early = np.minimum(time_s[:, None], other_s)
    late = np.maximum(time_s[:, None], other_s)
    covariance: Array = early * early * (0.5 * late - early / 6.0)
    return covariance


def by_receiver(table: Table, u: Array) -> Array:
    """s_ra u_ra, (S, R, d, M), of lines of sight as for :meth:`RowCovariance.along`."""
    second = np.maximum(table.signs, 0.0)
    first = np.minimum(table.signs, 0.0)
    of_second = second[:, None, :] * u[1].mT[:, None]
    both: Array = of_second + first[:, None, :] * u[0].mT[:, None]
    return both


def averaged(time_s: Array, span_s: Array, tau_s: float) -> Array:
    """Correlation of a Gauss-Markov process between its averages over spans, (M, M).

    This is the exact integral of ``exp(-|u - v| / tau)`` over both spans, so it is a covariance
    for any spans and times. Where two spans do not overlap it is a product of how much each
    fades within itself and of what lies between them.

    Args:
        time_s: Middles of the spans, (M,).
        span_s: Their lengths, (M,).
        tau_s: Time constant.
    """
    span = np.maximum(span_s, 1e-3 * tau_s) / tau_s
    apart = np.abs(time_s[:, None] - time_s) / tau_s
    within = -np.expm1(-span) / span
    between = apart - 0.5 * (span[:, None] + span)
    mean: Array = np.outer(within, within) * np.exp(-np.maximum(between, 0.0))

    def twice(x: Array) -> Array:
        """Primitive of ``exp(-|x|)`` integrated twice."""
        return np.exp(-np.abs(x)) + np.abs(x)

    a, b = np.nonzero(between < 0.0)
    half, other, off = 0.5 * span[a], 0.5 * span[b], apart[a, b]
    total = twice(off + half + other) + twice(off - half - other)
    total -= twice(off + half - other) + twice(off - half + other)
    mean[a, b] = total / (4.0 * half * other)
    return mean
