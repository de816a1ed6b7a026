"""What limits the estimate's accuracy, in the operator's words: geometry, clocks, noise, ..."""

from __future__ import annotations

from swarmctl.estimation.bounds.consistency import ellipse
from swarmctl.estimation.track.track import Track
from swarmctl.units import Array

_LARGEST_SHARE = 0.5
"""Share of the variance from which one kind of receiver error is what limits the accuracy."""
_ELONGATED = 3.0
"""Ratio of the ellipse's axes from which the geometry is what limits the accuracy."""


def accuracy_limit(track: Track, covariance: Array) -> str:
    """What limits the accuracy now: one word, or a few.

    Args:
        track: The track.
        covariance: The estimate's covariance, (6, 6), SI.
    """
    if not track.estimates():
        return "the prior"
    if not track.is_resolved:
        return "geometry: more than one place is possible"
    clock, navigation, colour = track.limits()
    shares = {"clocks": clock, "navigation": navigation, "multipath": colour}
    worst = max(shares, key=lambda name: shares[name])
    if shares[worst] > _LARGEST_SHARE:
        return worst
    major, minor, _ = ellipse(covariance)
    return "geometry" if major > _ELONGATED * minor else "noise"
