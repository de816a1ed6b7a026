"""What the errors of a window's rows have in common."""

from __future__ import annotations

import numpy as np

from swarmctl.estimation.track.window_covariance import averaged, walk

RNG = np.random.default_rng(0)


def test_averages_of_a_coloured_error_are_as_alike_as_their_integral_says() -> None:
    # Alone, overlapping, one within the other, twice the same, and a single instant.
    time_s = np.array([0.0, 1.0, 1.3, 1.2, 1.2, 4.0, 4.0])
    span_s = np.array([0.4, 0.9, 0.6, 0.1, 0.1, 2.0, 0.0])
    found = averaged(time_s, span_s, 0.5)
    points = (np.arange(2000) + 0.5) / 2000.0 - 0.5
    times = time_s[:, None] + span_s[:, None] * points
    for a in range(7):
        for b in range(7):
            apart = times[a][:, None] - times[b]
            # The midpoint rule errs by the kernel's kink, a fraction 1/2000 of the span.
            wanted = np.exp(-np.abs(apart) / 0.5).mean()
            np.testing.assert_allclose(found[a, b], wanted, rtol=1e-3)


def test_averages_over_spans_of_any_length_have_a_covariance() -> None:
    time_s = np.sort(RNG.uniform(0.0, 1e4, 60))
    span_s = 10.0 ** RNG.uniform(-3.0, 4.0, 60)
    found = averaged(time_s, span_s, 0.5)
    np.testing.assert_allclose(found, found.T, atol=1e-11)
    assert np.linalg.eigvalsh(found)[0] > -1e-10


def test_the_walk_is_that_of_white_acceleration() -> None:
    # Velocity steps of unit density at every ms; the position is their sum.
    step = 1e-3
    time_s = np.array([0.5, 0.5, 1.5, 2.0])
    kicks = np.arange(0.0, 2.0, step) + 0.5 * step
    moved = np.maximum(time_s[:, None] - kicks, 0.0)
    np.testing.assert_allclose(walk(time_s, time_s), step * moved @ moved.T, rtol=1e-5)
    np.testing.assert_array_equal(walk(time_s, time_s[2:]), walk(time_s, time_s)[:, 2:])
