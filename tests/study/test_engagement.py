"""The engagement of Table 1: its geometry, its motion, and what is measured of it."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from swarmctl.errors import EstimationError, UsageError
from swarmctl.estimation.model.motion import ConstantVelocity
from swarmctl.estimation.model.range_difference import range_differences
from swarmctl.study.engagement import (
    Engagement,
    Moment,
    Turn,
    fly,
    measure,
    own_acceleration,
    prior_at,
    relative_state,
)
from swarmctl.units import Array
from tests.estimation.scenarios import table_1
from tests.study.whiteness import assert_white

FORMATION = np.array([[-math.pi / 2, 300.0], [0.0, 250.0], [2.0, 100.0], [3.0, 40.0]])


def emitters(runs: int) -> Array:
    """Some near that of Table 1."""
    rng = np.random.default_rng(1)
    return Engagement().emitter + rng.normal(0.0, [300.0, 300.0, 10.0, 10.0], (runs, 4))


def flight(engagement: Engagement, formation: Array, emitter: Array) -> Moment:
    """A whole flight, time on the first axis."""
    moments = list(fly(engagement, formation, emitter))
    return Moment(
        moments[0].dt,
        *(np.array(field) for field in list(zip(*moments, strict=True))[1:]),
    )


def bearing(vector: Array) -> Array:
    angle: Array = np.arctan2(vector[..., 1], vector[..., 0])
    return angle


# --- Where everybody is ----------------------------------------------------------------


def test_the_scene_is_table_1_s() -> None:
    """Start, speeds and headings; 16 s in steps of 20 ms; then about 600 m away."""
    engagement = Engagement()
    np.testing.assert_allclose(engagement.epochs_s, np.linspace(0.0, 16.0, 801), atol=1e-12)
    moments = list(fly(engagement, FORMATION, engagement.emitter))
    assert [moment.dt for moment in moments] == [0.0] + 800 * [0.02]
    first = moments[0]
    np.testing.assert_array_equal(first.reference, [-5000.0, 0.0])
    np.testing.assert_array_equal(first.emitter[:2], [0.0, 0.0])
    for velocity, speed, heading in ((first.velocity, 270.0, 30.0), (first.emitter[2:], 20, 135)):
        assert math.hypot(*velocity) == pytest.approx(speed, rel=1e-12)
        assert math.degrees(float(bearing(velocity))) == pytest.approx(heading, rel=1e-12)

    whole = flight(engagement, FORMATION, engagement.emitter)
    np.testing.assert_allclose(np.linalg.norm(whole.velocity, axis=-1), 270.0, rtol=1e-12)
    np.testing.assert_allclose(np.diff(whole.reference, axis=0), 0.02 * whole.velocity[1:])
    np.testing.assert_allclose(whole.emitter[-1, :2], 16.0 * engagement.emitter[2:], rtol=1e-9)
    distance = np.linalg.norm(whole.emitter[:, :2] - whole.reference, axis=-1)
    assert distance.argmin() == 800
    assert distance[-1] == pytest.approx(600.0, abs=50.0)


def test_it_is_the_scene_the_filters_own_tests_fly() -> None:
    """Which was written down a second time, for one emitter and one formation."""
    expected = table_1()
    formation = np.array([[-math.pi / 2, 300.0], [0.0, 300.0], [math.pi / 2, 300.0]])
    found = flight(Engagement(), formation, Engagement().emitter)
    np.testing.assert_allclose(found.emitter, expected.emitter, atol=1e-6)
    np.testing.assert_allclose(found.reference, expected.reference, atol=1e-6)
    np.testing.assert_allclose(found.companions, expected.companions, atol=1e-6)


def test_the_formation_turns_with_the_true_line_of_sight() -> None:
    """In each run with its own."""
    found = flight(Engagement(duration_s=8.0), FORMATION, emitters(3))
    slots = found.companions - found.reference[..., None, :]
    np.testing.assert_allclose(
        np.linalg.norm(slots, axis=-1), np.broadcast_to(FORMATION[:, 1], slots.shape[:-1])
    )
    sight = bearing(found.emitter[..., :2] - found.reference)[..., None]
    off = bearing(slots) - sight - FORMATION[:, 0]
    assert np.abs(np.angle(np.exp(1j * off))).max() < 1e-9
    assert np.ptp(sight) > 0.1  # it does turn


@pytest.mark.parametrize("gain", [3.0, 4.0])
def test_the_heading_turns_gain_times_as_fast_as_the_line_of_sight(gain: float) -> None:
    """So heading - gain x bearing stays as it was, but for the steps.

    Their error is of first order in the step T: twice that of T/2 less that of T leaves the
    second order, less by T over the seconds in which things change. With another gain what
    is left would be all of it, whatever the step.
    """
    start = emitters(3)
    drifts = []
    for period_s, every in ((0.02, 1), (0.01, 2)):
        found = flight(Engagement(gain=gain, period_s=period_s), FORMATION, start)
        sight = bearing(found.emitter[..., :2] - found.reference)
        drift = bearing(found.velocity) - gain * sight
        drifts.append((drift - drift[0])[::every])
        assert np.ptp(sight, axis=0).min() > 0.1  # the line of sight does turn
    coarse, fine = drifts
    assert np.abs(2.0 * fine - coarse).max() < 0.1 * np.abs(coarse).max()


def test_the_paper_s_state_has_the_flight_s_derivatives() -> None:
    """First and second differences over steps of T = 1 ms.

    Both are those of a moment up to 2 T later: they are off by no more than 2 T times the next
    derivative, for which the next difference is taken, with a half more for its own error.
    Rounding adds 1e-12 of 5 km, over T².
    """
    engagement = Engagement(period_s=1e-3, duration_s=6e-3)
    start = emitters(50)
    state = relative_state(engagement, start)
    found = flight(engagement, FORMATION, start)
    p = found.emitter[..., :2] - found.reference
    s = np.concatenate([p, np.linalg.norm(p, axis=-1, keepdims=True)], axis=-1)
    np.testing.assert_allclose(state[:, :3], s[0], rtol=1e-12)
    T = engagement.period_s
    rounding = 5000.0 * 1e-12 / T**2
    for order, columns in ((1, slice(3, 6)), (2, slice(6, 9))):
        derivative = np.diff(s, order, axis=0)[0] / T**order
        following = np.abs(np.diff(s, order + 1, axis=0) / T ** (order + 1)).max((0, 1))
        allowed = 3.0 * T * following + rounding
        assert (np.abs(state[:, columns] - derivative) < allowed).all()
        # The bound says something: the derivatives are much larger.
        assert (np.abs(state[:, columns]).max(0) > 20.0 * allowed).all()
    np.testing.assert_array_equal(state[:, 6:8], -own_acceleration(engagement, start))


def test_a_prior_knows_where_the_reference_uav_starts() -> None:
    engagement = Engagement()
    mean, P = np.arange(9.0), np.eye(9)
    prior = prior_at(mean, P, engagement)
    first = next(fly(engagement, FORMATION, engagement.emitter))
    np.testing.assert_array_equal(prior.reference, [*first.reference, *first.velocity])
    assert prior.mean is mean
    assert prior.covariance is P


# --- What is drawn ---------------------------------------------------------------------


def test_a_disturbed_emitter_moves_with_the_model_s_noise() -> None:
    engagement = Engagement(duration_s=1.0, period_s=0.5)
    motion = ConstantVelocity((0.04, 0.5))
    start = np.tile(engagement.emitter, (10_000, 1))
    moments = list(fly(engagement, FORMATION, start, motion, np.random.default_rng(2)))
    F, Q = motion.step(0.5)
    steps = [b.emitter - a.emitter @ F.T for a, b in pairwise(moments)]
    white = np.zeros((8, 8))
    white[:4, :4] = white[4:, 4:] = Q
    assert_white(np.concatenate(steps, axis=-1), white)


def test_an_axis_without_noise_is_not_disturbed() -> None:
    engagement = Engagement(duration_s=1.0)
    motion, rng = ConstantVelocity((0.04, 0.0)), np.random.default_rng(3)
    *_, last = fly(engagement, FORMATION, engagement.emitter, motion, rng)
    assert last.emitter[2] != engagement.emitter[2]
    assert last.emitter[3] == pytest.approx(engagement.emitter[3], rel=1e-12)


def test_measurements_have_the_noise_that_is_claimed() -> None:
    """Range differences and every position, all at once, correlated by the reference alone.

    That of the RDs through the shared receiver: rho = 1/2. The velocity comes by navigation.
    """
    engagement = Engagement(sigma_r_m=0.7, sigma_p_m=0.4, rho=0.5)
    moment = next(fly(engagement, FORMATION, engagement.emitter))
    runs, n = 40_000, len(FORMATION)
    scan = measure(engagement, moment, np.random.default_rng(3), runs)
    rd = range_differences(moment.emitter[:2], moment.reference, moment.companions)
    noise = [
        scan.rd - rd,
        scan.reference - moment.reference,
        (scan.companions - moment.companions).reshape(runs, 2 * n),
    ]
    covariance = np.diag([0.0] * n + [0.4**2] * (2 * n + 2))
    covariance[:n, :n] = 0.7**2 * (0.5 * np.eye(n) + 0.5)
    assert_white(np.concatenate(noise, axis=-1), covariance)

    np.testing.assert_allclose(scan.rd_covariance, covariance[:n, :n], rtol=1e-12)
    assert scan.sigma_p == 0.4
    assert scan.dt == 0.0
    np.testing.assert_array_equal(scan.velocity, moment.velocity)
    np.testing.assert_array_equal(scan.truth.rd, rd)
    np.testing.assert_array_equal(scan.truth.baselines, moment.companions - moment.reference)


def test_each_run_has_its_own_truth_and_its_own_noise() -> None:
    """Measurements of a batch of trajectories lie about theirs."""
    engagement = Engagement(sigma_r_m=1e-6, sigma_p_m=1e-6)
    moment = next(fly(engagement, FORMATION, emitters(5)))
    scan = measure(engagement, moment, np.random.default_rng(4), 5)
    np.testing.assert_allclose(scan.companions, moment.companions, atol=1e-4)
    for i in range(5):
        rd = range_differences(moment.emitter[i, :2], moment.reference[i], moment.companions[i])
        np.testing.assert_allclose(scan.rd[i], rd, atol=1e-4)
    assert len(np.unique(scan.rd - scan.truth.rd)) == scan.rd.size


# --- Wrong arguments -------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(3,), (3, 3), (0, 2), (1, 3, 2)])
def test_a_formation_of_another_shape_is_refused(shape: tuple[int, ...]) -> None:
    engagement = Engagement()
    with pytest.raises(UsageError, match=r"A formation must be \(N, 2\)"):
        next(fly(engagement, np.zeros(shape), engagement.emitter))


def test_a_disturbance_without_a_generator_is_refused() -> None:
    engagement = Engagement()
    with pytest.raises(UsageError, match="needs a random generator"):
        next(fly(engagement, FORMATION, engagement.emitter, ConstantVelocity((0.1, 0.1))))


def test_noise_from_the_reference_receiver_alone_is_refused() -> None:
    with pytest.raises(EstimationError, match="rho must be"):
        replace(Engagement(), rho=1.0).rd_covariance(3)


@pytest.mark.parametrize(
    ("turn", "velocity"),
    [
        (Turn(1.0, math.pi / 2.0, 1.0), [-14.142136, -14.142136]),
        (Turn(1.0, -math.pi / 2.0, 1.0), [14.142136, 14.142136]),
        (Turn(1.0, 0.0, 0.0), [0.0, 0.0]),
    ],
)
def test_an_emitter_turns_at_once(turn: Turn, velocity: list[float]) -> None:
    """Where it is at that epoch; until then all is as without it."""
    scene, formation = Engagement(period_s=0.25, duration_s=2.0), np.array([[0.0, 300.0]])
    plain = list(fly(scene, formation, scene.emitter))
    turned = list(fly(scene, formation, scene.emitter, turn=turn))
    for k in range(4):
        np.testing.assert_array_equal(turned[k].emitter, plain[k].emitter)
    for k in range(4, 9):
        off = (k - 4) * 0.25 * np.array(velocity)
        np.testing.assert_allclose(turned[k].emitter[:2], plain[4].emitter[:2] + off, atol=1e-6)
        np.testing.assert_allclose(turned[k].emitter[2:], velocity, atol=1e-6)
