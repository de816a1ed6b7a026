"""How much of what tells two modes apart is real, and how much the noise of reported positions.

With the contrast ``c = h_m(q) - h(q)`` between the range differences expected of a mirror image
and of a mode, S the innovation's covariance, and A what the reported positions' noise makes of c,
whitened, at least the share ``I / (I + tr A)`` of the log-odds counts. I is the real information:
``c' S⁻¹ c`` less ``tr A`` and less some sigmas, ``2 tr A²``, of what the noise makes of it alone.
The share is 0 until the contrast is real and 1 once it is large, so a swarm that hovers on one
line never takes the noise of its positions for evidence of a side. ``docs/explanation/track.md``
derives it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swarmctl.estimation.model.rows import Rows
from swarmctl.units import Array, Mask

_ALLOWED = 3.0
"""Sigmas by which the noise of positions alone may exceed its mean, and still tell nothing."""


@dataclass(frozen=True)
class Contrast:
    """Between two modes or, as arrays, many pairs of them. Those of several epochs add up.

    Attributes:
        found: ``c' S⁻¹ c``.
        noise: What the noise of positions makes of it on average, ``tr A``.
        variance: Variance of that, ``2 tr A²``.
    """

    found: Array
    noise: Array
    variance: Array

    def __add__(self, other: Contrast) -> Contrast:
        """The contrast in the rows of both."""
        return Contrast(
            self.found + other.found, self.noise + other.noise, self.variance + other.variance
        )

    def where(self, kept: Mask) -> Contrast:
        """The contrast between those modes of (S, S) that a mask (S,) keeps."""
        both = np.ix_(kept, kept)
        return Contrast(self.found[both], self.noise[both], self.variance[both])

    @property
    def share(self) -> Array:
        """What of the log-likelihood ratio is evidence, 0 to 1."""
        real = self.found - self.noise - _ALLOWED * np.sqrt(self.variance)
        share: Array = np.maximum(real, 0.0) / np.maximum(self.found, np.finfo(np.float64).tiny)
        return share


def no_contrast(modes: int) -> Contrast:
    """The contrast between any two modes before the first epoch, (modes, modes)."""
    return Contrast(*np.zeros((3, modes, modes)))


def contrast_of_pair(
    c: Array, root: Array, receivers: NDArray[np.intp], turned: Array, delta: Array
) -> Contrast:
    """Between two modes.

    Args:
        c: Difference of the range differences expected, (M,), m.
        root: Lower Cholesky factor of S, (M, M), m.
        receivers: Id of each row's first and second receiver, (2, M).
        turned: Difference of their unit lines of sight, (2, M, d).
        delta: Covariance of the reported positions' noise, along any axis, of one receiver in
            two rows, (M, M), m².
    """
    sign = np.repeat([-1.0, 1.0], c.size)
    signed = sign[:, None] * turned.reshape(2 * c.size, -1)
    same = receivers.ravel()[:, None] == receivers.ravel()
    ends = (same * (signed @ signed.T)).reshape(2, c.size, 2, c.size)
    noise = delta * ends.sum((0, 2))
    whitened = np.linalg.solve(root, np.column_stack([noise, c]))
    A = np.linalg.solve(root, whitened[:, :-1].T)
    of_c = whitened[:, -1]
    return Contrast(of_c @ of_c, np.trace(A), 2.0 * (A * A).sum())


def contrast_in_epoch(rows: Rows, at: Array, nu: Array, S: Array, variance: float) -> Contrast:
    """Between any two modes in the rows of one epoch.

    Args:
        rows: The measurement.
        at: Position of each mode, (S, d), m.
        nu: Its innovation, (S, K), m.
        S: Covariance of nu, (S, K, K), m².
        variance: Variance of the reported positions, per axis, m².

    Returns:
        The contrast of each pair, (S, S).
    """
    sight = at[:, None] - np.stack([rows.first_at, rows.second_at])[:, None]  # (2, S, K, d)
    u = sight / np.sqrt(np.vecdot(sight, sight))[..., None]
    receivers = np.array([rows.first, rows.second])
    delta = np.full((len(rows.rd), len(rows.rd)), variance)
    modes, root = range(len(at)), np.linalg.cholesky(S)
    pairs = [
        [
            contrast_of_pair(nu[k] - nu[j], root[k], receivers, u[:, j] - u[:, k], delta)
            for j in modes
        ]
        for k in modes
    ]
    return Contrast(
        *(
            np.array([[getattr(pair, name) for pair in row] for row in pairs])
            for name in ("found", "noise", "variance")
        )
    )
