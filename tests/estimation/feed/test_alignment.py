"""A vehicle between its reports."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.feed.alignment import PositionHistory
from swarmctl.units import Vector


def circle(epoch_s: float) -> tuple[Vector, Vector]:
    """A UAV orbiting at 430 m and 10 m/s, climbing at 0.5 m/s."""
    radius, speed = 430.0, 10.0
    angle = speed / radius * epoch_s
    c, s = math.cos(angle), math.sin(angle)
    return (radius * c, radius * s, 60.0 + 0.5 * epoch_s), (-speed * s, speed * c, 0.5)


def history(*epochs_s: float) -> PositionHistory:
    result = PositionHistory(5.0, 0.5)
    for epoch_s in epochs_s:
        result.add(epoch_s, *circle(epoch_s))
    return result


def error(of: PositionHistory, epoch_s: float) -> float:
    position = of.at(epoch_s)
    assert position is not None
    return math.dist(position, circle(epoch_s)[0])


def test_between_samples_a_curve_is_followed() -> None:
    samples = [0.2 * k for k in range(11)]
    orbit = history(*samples)
    # The fourth derivative of the circle is v (v / R)³; Hermite's error h⁴ / 384 of it.
    bound = 10.0 * (10.0 / 430.0) ** 3 * 0.2**4 / 384.0 + 1e-12
    for before, after in pairwise(samples):
        for share in (0.0, 0.25, 0.5, 0.9, 1.0):
            assert error(orbit, before + share * (after - before)) < bound


def test_the_error_under_jerk_is_what_the_documentation_says() -> None:
    """The worst motion for the middle of a gap: the jerk reverses there."""
    jerk, gap = 10.0, 0.1
    half = gap / 2.0
    middle = jerk * half**3 / 6.0
    speed = jerk * half**2 / 2.0
    acceleration = jerk * half
    end = middle + speed * half + acceleration * half**2 / 2.0 - jerk * half**3 / 6.0
    end_speed = speed + acceleration * half - jerk * half**2 / 2.0
    samples = PositionHistory(5.0, 0.5)
    samples.add(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    samples.add(gap, (end, 0.0, 0.0), (end_speed, 0.0, 0.0))
    found = samples.at(half)
    assert found is not None
    assert abs(found[0] - middle) == pytest.approx(jerk * gap**3 / 96.0)


def test_order_and_repetition_do_not_matter() -> None:
    epochs = [0.0, 0.2, 0.4, 0.6]
    shuffled = history(0.4, 0.0, 0.6, 0.2, 0.2, 0.6)
    assert len(shuffled) == 4
    for epoch_s in (0.05, 0.3, 0.55):
        assert shuffled.at(epoch_s) == history(*epochs).at(epoch_s)


def test_a_repeated_epoch_keeps_the_first_sample() -> None:
    samples = history(1.0)
    samples.add(1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert samples.at(1.0) == circle(1.0)[0]


def test_outside_the_samples_the_velocity_carries_on_up_to_the_limit() -> None:
    samples = history(1.0, 1.2)
    (x, y, z), (u, v, w) = circle(1.2)
    assert samples.at(1.7) == pytest.approx((x + 0.5 * u, y + 0.5 * v, z + 0.5 * w), abs=1e-9)
    (x, y, z), (u, v, w) = circle(1.0)
    assert samples.at(0.6) == pytest.approx((x - 0.4 * u, y - 0.4 * v, z - 0.4 * w), abs=1e-9)
    assert samples.at(1.71) is None
    assert samples.at(0.49) is None
    assert history().at(0.0) is None


def test_in_a_gap_only_what_is_near_a_sample_is_known() -> None:
    samples = history(0.0, 3.0)
    assert samples.at(1.5) is None
    # Within reach of a sample: Hermite over 3 s of the circle.
    assert error(samples, 0.5) < 10.0 * (10.0 / 430.0) ** 3 * 3.0**4 / 384.0
    assert error(samples, 2.5) < 10.0 * (10.0 / 430.0) ** 3 * 3.0**4 / 384.0


def test_only_the_recent_past_is_kept() -> None:
    samples = history(*[0.125 * k for k in range(200)])
    assert len(samples) == 41
    samples.add(3.0, *circle(3.0))
    assert len(samples) == 41
    assert samples.at(3.0) is None


def test_brackets_means_a_sample_on_both_sides() -> None:
    samples = history(1.0, 2.0)
    assert [samples.brackets(t) for t in (0.9, 1.0, 1.5, 2.0, 2.1)] == [
        False,
        True,
        True,
        True,
        False,
    ]
    assert not history().brackets(0.0)


@pytest.mark.parametrize("limits", [(-1.0, 0.5), (5.0, -0.5), (math.nan, 0.5), (5.0, math.nan)])
def test_impossible_limits_are_refused(limits: tuple[float, float]) -> None:
    with pytest.raises(EstimationError, match="must not be negative"):
        PositionHistory(*limits)
