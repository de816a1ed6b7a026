"""What is drawn before a run: each way to begin has the statistics it claims."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.study.engagement import Engagement, relative_state
from swarmctl.study.starts import (
    CA,
    CV,
    Anywhere,
    DrawnEstimate,
    DrawnTruth,
    RangeIgnorant,
    Start,
    fixed_frame,
    table_1_covariance,
)
from tests.study.whiteness import assert_white

RUNS = 20_000
ENGAGEMENT = Engagement()
STARTS = [DrawnEstimate(), DrawnEstimate(20.0), DrawnTruth(), RangeIgnorant()]


def test_p0_is_table_1_s() -> None:
    """Variances per axis, twice that for the range and its derivatives; nothing off it."""
    sigmas = [100.0, 100.0, 100.0 * math.sqrt(2.0), 30.0, 30.0, 30.0 * math.sqrt(2.0)]
    sigmas += [10.0, 10.0, 10.0 * math.sqrt(2.0)]
    expected = np.diag(np.array(sigmas) / 3.0) ** 2
    np.testing.assert_allclose(table_1_covariance(), expected, rtol=1e-12)
    np.testing.assert_allclose(table_1_covariance(40.0), 1600.0 * expected, rtol=1e-12)


def test_cv_and_ca_pick_a_state_without_the_range() -> None:
    """Of [x, y, D, and derivatives]: numbered so that the order shows."""
    names = np.array(["x", "y", "D", "vx", "vy", "vD", "ax", "ay", "aD"])
    assert names[list(CV)].tolist() == ["x", "y", "vx", "vy"]
    assert names[list(CA)].tolist() == ["x", "y", "vx", "vy", "ax", "ay"]


@pytest.mark.parametrize("scale", [1.0, 20.0])
def test_a_drawn_estimate_errs_by_scale_squared_p0(scale: float) -> None:
    draw = DrawnEstimate(scale).draw(ENGAGEMENT, np.random.default_rng(1), RUNS)
    assert not draw.disturbed
    np.testing.assert_array_equal(draw.emitter, ENGAGEMENT.emitter)
    P = scale**2 * table_1_covariance()
    assert_white(draw.prior.mean - relative_state(ENGAGEMENT, ENGAGEMENT.emitter), P)


def test_a_drawn_truth_lies_about_a_fixed_estimate() -> None:
    """x^_0 is Table 1's emitter in all runs; the filters' other entries err by P0, too."""
    draw = DrawnTruth().draw(ENGAGEMENT, np.random.default_rng(2), RUNS)
    assert draw.disturbed
    assert draw.emitter.shape == (RUNS, 4)
    P = table_1_covariance()
    fixed = draw.prior.mean[:, CV]
    assert (fixed == fixed[0]).all()
    np.testing.assert_array_equal(fixed[0, :2], [5000.0, 0.0])
    own = draw.prior.reference
    np.testing.assert_allclose(fixed[0] + own, ENGAGEMENT.emitter, rtol=1e-12, atol=1e-9)

    truth = relative_state(ENGAGEMENT, draw.emitter)
    # The truth's range, too, is that of its position: the estimate's error is P0's throughout.
    assert_white(draw.prior.mean - truth, P)
    assert_white(draw.emitter - ENGAGEMENT.emitter, P[np.ix_(CV, CV)])


def test_a_range_ignorant_start_knows_the_bearing_only() -> None:
    """10 km assumed in all runs, 5 km true, and due east as it truly is; the rest as in Table 1."""
    start = RangeIgnorant()
    draw = start.draw(ENGAGEMENT, np.random.default_rng(3), RUNS)
    assert not draw.disturbed
    np.testing.assert_array_equal(draw.emitter, ENGAGEMENT.emitter)
    np.testing.assert_array_equal(draw.prior.mean[:, :3] - [10_000.0, 0.0, 10_000.0], 0.0)
    truth = relative_state(ENGAGEMENT, ENGAGEMENT.emitter)
    np.testing.assert_array_equal(truth[:3], [5000.0, 0.0, 5000.0])
    P = start.covariance()
    np.testing.assert_array_equal(np.diag(P)[:3], [5000.0**2, 500.0**2, 5000.0**2])
    assert_white((draw.prior.mean - truth)[:, 3:], table_1_covariance()[3:, 3:])


@pytest.mark.parametrize("start", STARTS, ids=repr)
def test_the_prior_claims_what_the_start_says_and_is_drawn_anew_from_a_seed(start: Start) -> None:
    """The generator alone decides: the same seed, the same draw."""
    first, again, other = (
        start.draw(ENGAGEMENT, np.random.default_rng(seed), 4) for seed in (7, 7, 8)
    )
    np.testing.assert_array_equal(first.prior.covariance, start.covariance())
    assert first.prior.mean.shape == (4, 9)
    np.testing.assert_array_equal(first.prior.mean, again.prior.mean)
    np.testing.assert_array_equal(first.emitter, again.emitter)
    assert not np.array_equal(first.prior.mean, other.prior.mean)
    np.testing.assert_array_equal(first.prior.reference[:2], [-5000.0, 0.0])


def test_anywhere_is_a_disc_round_the_swarm_and_any_velocity() -> None:
    """The prior is that of a place uniform over the disc; the emitter is Table 1's."""
    start = Anywhere(reach_m=6000.0, speed_mps=30.0)
    draw = start.draw(ENGAGEMENT, np.random.default_rng(1), 3)
    np.testing.assert_array_equal(draw.emitter, ENGAGEMENT.emitter)
    mean, P = fixed_frame(draw.prior)
    np.testing.assert_allclose(mean, np.broadcast_to([-5000.0, 0.0, 0.0, 0.0], (3, 4)), atol=1e-9)
    rng = np.random.default_rng(2)
    place = rng.uniform(-6000.0, 6000.0, (200_000, 2))
    place = place[np.hypot(*place.T) < 6000.0]
    np.testing.assert_allclose(P[:2, :2], np.cov(place.T), atol=0.02 * 3000.0**2)
    np.testing.assert_allclose(P[2:, 2:], 900.0 * np.eye(2))


@pytest.mark.parametrize("start", STARTS, ids=repr)
def test_in_the_fixed_frame_a_prior_errs_as_in_the_paper_s_state(start: Start) -> None:
    draw = start.draw(ENGAGEMENT, np.random.default_rng(3), 50)
    mean, P = fixed_frame(draw.prior)
    np.testing.assert_array_equal(P, start.covariance()[np.ix_(CV, CV)])
    truth = relative_state(ENGAGEMENT, draw.emitter)
    np.testing.assert_allclose(
        mean - draw.emitter, draw.prior.mean[:, CV] - truth[..., CV], atol=1e-9
    )
