"""What the operator is told limits the accuracy."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from swarmctl.estimation.estimate import Limits
from swarmctl.estimation.track.track import Track
from swarmctl.mission.accuracy_limit import accuracy_limit

ROUND = np.eye(6)


def track(
    clock: float = 0.0,
    navigation: float = 0.0,
    colour: float = 0.0,
    *,
    known: bool = True,
    is_resolved: bool = True,
) -> Track:
    """What of a track is asked."""
    return cast(
        Track,
        SimpleNamespace(
            estimates=lambda: ["one"] if known else [],
            is_resolved=is_resolved,
            limits=lambda: Limits(clock, navigation, colour),
        ),
    )


def test_before_any_measurement_it_is_the_prior() -> None:
    assert accuracy_limit(track(0.9, known=False, is_resolved=False), ROUND) == "the prior"


def test_several_possible_places_come_before_any_receiver_error() -> None:
    told = accuracy_limit(track(0.9, is_resolved=False), ROUND)
    assert told == "geometry: more than one place is possible"


@pytest.mark.parametrize(
    ("shares", "told"),
    [
        ((0.6, 0.3, 0.1), "clocks"),
        ((0.3, 0.6, 0.1), "navigation"),
        ((0.1, 0.3, 0.6), "multipath"),
        ((0.5, 0.3, 0.2), "noise"),
    ],
)
def test_a_receiver_error_with_more_than_half_of_the_variance_is_named(
    shares: tuple[float, float, float], told: str
) -> None:
    assert accuracy_limit(track(*shares), ROUND) == told


@pytest.mark.parametrize(("ratio", "told"), [(2.9, "noise"), (3.1, "geometry")])
def test_a_long_ellipse_is_geometry(ratio: float, told: str) -> None:
    assert accuracy_limit(track(), np.diag([ratio**2, 1.0, 1.0, 1.0, 1.0, 1.0])) == told
