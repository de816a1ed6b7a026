"""What is wrong with a receiver besides white noise: its clock, its position, its echoes.

The arrival that receiver r measures is, as a distance,

    a_r = |e - p_r + n_r| + b_r + c_r + white,        rd = a_j - a_i

with p_r the *reported* position. Nothing here depends on who is the reference: a range
difference (RD) of any pair (i, j) is the difference of two arrivals.

=============  ==========================================================================
``b_r``        clock bias, m (a nanosecond is 0.30 m), growing with ``b'_r``, m/s
``n_r``        navigation error, reported less true position, d axes, m: first-order
               Gauss-Markov (GNSS: 1.5 m, 60 s)
``c_r``        coloured error of the arrival, m: first-order Gauss-Markov (multipath:
               tenths of seconds)
=============  ==========================================================================

The navigation error is carried with all its axes. Its projection on the line of sight alone
would be enough for a line that does not turn, but is no Markov process once it does: in an
orbit the error ahead becomes the error across within a time constant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.units import Array


@dataclass(frozen=True)
class ReceiverErrors:
    """The error model that all receivers share; what has sigma 0 takes no state.

    Attributes:
        bias_m: 1-sigma of a clock's bias at the beginning, m.
        drift_mps: 1-sigma of its drift, m/s; constant.
        navigation_m: 1-sigma of the navigation error per axis, m.
        navigation_tau_s: Its correlation time, s.
        colour_m: 1-sigma of an *arrival's* coloured error, m; an RD has sqrt(2) of it.
        colour_tau_s: Its correlation time, s.

    Raises:
        EstimationError: A sigma is negative, a time not positive, a number not finite, or
            there is a drift without a bias.
    """

    bias_m: float = 0.0
    drift_mps: float = 0.0
    navigation_m: float = 0.0
    navigation_tau_s: float = 60.0
    colour_m: float = 0.0
    colour_tau_s: float = 0.5

    def __post_init__(self) -> None:
        # Written so that NaN fails too.
        for name in ("bias_m", "drift_mps", "navigation_m", "colour_m"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise EstimationError(
                    f"{name} must be a finite number >= 0, not {getattr(self, name)!r}."
                )
        for name in ("navigation_tau_s", "colour_tau_s"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise EstimationError(
                    f"{name} must be a finite number > 0, not {getattr(self, name)!r}."
                )
        if self.drift_mps > 0.0 and self.bias_m == 0.0:
            raise EstimationError("A clock that drifts has a bias: bias_m must be above 0.")

    def layout(self, d: int) -> Layout:
        """Where each part stands among a receiver's states, for d axes."""
        size = 0
        places = []
        for sigma, width in (
            (self.bias_m, 1),
            (self.drift_mps, 1),
            (self.navigation_m, d),
            (self.colour_m, 1),
        ):
            places.append(size if sigma > 0.0 else None)
            size += width if sigma > 0.0 else 0
        return Layout(d, size, *places)

    def variance(self, d: int) -> Array:
        """Prior variance of a receiver's states, (size,), SI."""
        sigmas = [self.bias_m, self.drift_mps, *[self.navigation_m] * d, self.colour_m]
        return np.array([sigma * sigma for sigma in sigmas if sigma > 0.0])


@dataclass(frozen=True)
class Layout:
    """Places of a receiver's states; None for a part that is not modelled.

    Attributes:
        d: Axes.
        size: States per receiver.
        bias: Place of the clock's bias.
        drift: Place of its drift.
        navigation: Place of the first axis of the navigation error.
        colour: Place of the coloured error.
    """

    d: int
    size: int
    bias: int | None
    drift: int | None
    navigation: int | None
    colour: int | None

    def loading(self, sight: Array) -> Array:
        """Derivative of an arrival by the receiver's states.

        Args:
            sight: Unit line of sight, (..., d).

        Returns:
            (..., size).
        """
        row = np.zeros((*sight.shape[:-1], self.size))
        for place in (self.bias, self.colour):
            if place is not None:
                row[..., place] = 1.0
        if self.navigation is not None:
            row[..., self.navigation : self.navigation + self.d] = sight
        return row


def predict(
    x: Array, P: Array, dt: float, psd: Array, errors: ReceiverErrors, layout: Layout
) -> tuple[Array, Array]:
    """Time update of the state ``[e, v | receiver 0 | receiver 1 | ...]``.

    Constant velocity with white acceleration; a clock's bias grows with its drift; navigation
    and colour decay by ``exp(-dt / tau)`` and are refreshed to their stationary variance.

    Args:
        x: (..., 2d + R size).
        P: (..., 2d + R size, 2d + R size).
        dt: Step, s, >= 0.
        psd: Spectral density of the emitter's acceleration per axis, (..., d), m²/s³.
        errors: The receivers' model.
        layout: Its :meth:`ReceiverErrors.layout`.

    Returns:
        Predicted x and P, copies.
    """
    d, n = layout.d, x.shape[-1]
    decay = np.ones(n)
    noise = np.zeros(n)
    for place, width, sigma, tau in (
        (layout.navigation, d, errors.navigation_m, errors.navigation_tau_s),
        (layout.colour, 1, errors.colour_m, errors.colour_tau_s),
    ):
        if place is None:
            continue
        factor = math.exp(-dt / tau)
        for k in range(place, place + width):
            decay[2 * d + k :: layout.size] = factor
            noise[2 * d + k :: layout.size] = sigma * sigma * (1.0 - factor * factor)
    x = x * decay
    P = P * (decay[:, None] * decay)
    moved = [(slice(0, d), slice(d, 2 * d))]
    if layout.bias is not None and layout.drift is not None:
        moved.append(
            (
                slice(2 * d + layout.bias, n, layout.size),
                slice(2 * d + layout.drift, n, layout.size),
            )
        )
    for what, by in moved:
        x[..., what] += dt * x[..., by]
        P[..., what, :] += dt * P[..., by, :]
        P[..., :, what] += dt * P[..., :, by]
    diagonal = np.arange(n)
    P[..., diagonal, diagonal] += noise
    axes = diagonal[:d]
    P[..., axes, axes] += psd * (dt**3 / 3.0)
    P[..., axes, axes + d] += psd * (dt**2 / 2.0)
    P[..., axes + d, axes] += psd * (dt**2 / 2.0)
    P[..., axes + d, axes + d] += psd * dt
    return x, P
