"""Which numbers of a feed cannot be: no measurement of this system comes near them."""

from __future__ import annotations

from swarmctl.units import SPEED_OF_LIGHT_MPS

_ABSURD = 1e6
"""No UAV, range difference or sigma of this system reaches a thousand kilometres (nor a
thousand kilometres a second): such a number is corrupt."""
_ABSURD_S = 1e11
"""No clock of this system has counted three thousand years."""


def are_plausible(*values: float) -> bool:
    """Whether all are finite and below a thousand kilometres (m) or that a second (m/s)."""
    return all(-_ABSURD < value < _ABSURD for value in values)


def is_arrival_plausible(toa_s: int, toa_frac_s: float, sigma_s: float) -> bool:
    """Whether an arrival time, ``toa_s + toa_frac_s`` (s), and its 1-sigma (s) can be."""
    return (
        0.0 <= toa_frac_s < 1.0
        and abs(toa_s) <= _ABSURD_S
        and sigma_s > 0.0
        and are_plausible(SPEED_OF_LIGHT_MPS * sigma_s)
    )
