"""Dog-legs: the predicted bound against the filter's own recursion, and the choice of a course."""

import math

import numpy as np
import pytest

from swarmctl.errors import FormationError
from swarmctl.estimation.bounds.pcrb import CramerRaoBound
from swarmctl.estimation.model.motion import ConstantVelocity
from swarmctl.estimation.model.range_difference import rd_covariance
from swarmctl.formation.dogleg import (
    EVERY_S,
    DogLegs,
    Prediction,
    Situation,
    Terms,
    predict,
    turned,
)
from swarmctl.formation.guidance import approach_and_orbit
from swarmctl.formation.requirements import Noise

TERMS = Terms(Noise(3.0, 0.5, 0.5), 10.0, 4e-4, 10.0, 5.0, 60.0, 3700.0)
LOS = math.atan2(700.0, 1400.0)
FORMATIONS = {1: [83.0], 2: [83.0, -83.0], 4: [83.0, 83.0, -83.0, 180.0]}


def situation(
    companions: int, *, range_sigma_m: float = 380.0, velocity: tuple[float, float] = (0.0, 0.0)
) -> Situation:
    """1565 m from an emitter known but for its range; its bearing to 2 m."""
    along = np.array([math.cos(LOS), math.sin(LOS)])
    axes = np.column_stack((along, [-along[1], along[0]]))
    P = np.zeros((4, 4))
    P[:2, :2] = axes @ np.diag([range_sigma_m**2, 4.0]) @ axes.T
    P[2:, 2:] = 0.01 * np.eye(2)
    theta = np.radians(FORMATIONS[companions]) + LOS
    offsets = 285.0 * np.column_stack((np.cos(theta), np.sin(theta)))
    emitter = np.array([1400.0, 700.0, *velocity])
    return Situation(np.zeros(2), emitter, P, offsets, 800.0, 8.0)


def one(now: Situation, angle_deg: float, leg_s: float) -> Prediction:
    return predict(TERMS, now, np.array(math.radians(angle_deg)), np.array(leg_s), 120.0)


@pytest.mark.parametrize("companions", [1, 2, 4])
@pytest.mark.parametrize("angle_deg", [0.0, 60.0, -90.0])
def test_the_prediction_is_the_cramer_rao_recursion_along_the_path(
    companions: int, angle_deg: float
) -> None:
    now = situation(companions, velocity=(1.0, -0.5))
    times, path, rms = one(now, angle_deg, 20.0)
    bound = CramerRaoBound(now.covariance, ConstantVelocity((4e-4, 4e-4)))
    theta = np.radians(FORMATIONS[companions])
    last = 0.0
    for time, reference, expected in zip(times.tolist(), path, rms, strict=True):
        emitter = now.emitter[:2] + time * now.emitter[2:]
        bearing = math.atan2(*(emitter - reference)[::-1])
        slots = 285.0 * np.column_stack((np.cos(theta + bearing), np.sin(theta + bearing)))
        # As many epochs as the step has are one with that much less variance.
        share = 1.0 / math.sqrt(TERMS.rate_hz * (time - last))
        bound.predict(time - last)
        Cr = rd_covariance(np.full(companions, 3.0 * share), 0.5)
        bound.update(emitter, reference, reference + slots, Cr, 0.5 * share)
        assert math.sqrt(np.trace(bound.covariance[:2, :2])) == pytest.approx(expected, rel=1e-6)
        last = time


@pytest.mark.parametrize("angle_deg", [0.0, -20.0, 60.0, 90.0])
def test_the_predicted_path_is_what_the_guidance_law_flies(angle_deg: float) -> None:
    now = situation(1, velocity=(1.0, -0.5))
    times, path, _ = one(now, angle_deg, 15.0)
    here, drift, dt = now.reference.copy(), (1.0, -0.5), 0.01
    place = {}
    for step in range(9000):
        place[step] = here.copy()
        offset = here - now.emitter[:2] - step * dt * now.emitter[2:]
        wanted = approach_and_orbit((offset[0], offset[1]), drift, 800.0, 10.0, 8.0)
        course = math.radians(angle_deg) if step * dt < 15.0 else 0.0
        here += dt * np.array(turned(wanted, drift, course))
    # Until 100 m outside the orbit: from there on the law slows the approach down.
    on_the_way = times < 15.0 + (765.0 - 100.0 - 150.0 * math.cos(math.radians(angle_deg))) / 10.0
    assert on_the_way.sum() >= 10
    for time, expected in zip(times[on_the_way], path[on_the_way], strict=True):
        # A step of the ideal point is 0.1 m.
        assert place[round(time / dt)] == pytest.approx(expected, abs=0.2)


def test_one_companion_triangulates_where_four_see_the_range_themselves() -> None:
    assert abs(DogLegs(TERMS).follow(situation(1), 0.1)) >= math.radians(20.0)
    assert DogLegs(TERMS).follow(situation(4), 0.1) == 0.0


def test_a_range_that_is_known_is_approached_straight() -> None:
    assert DogLegs(TERMS).follow(situation(1, range_sigma_m=3.0), 0.1) == 0.0


def test_a_leg_that_leaves_the_fence_is_flown_the_other_way_or_not_at_all() -> None:
    now = situation(1)
    side = math.copysign(1.0, DogLegs(TERMS).follow(now, 0.1))
    # The fence's centre moves to the other side; the reference UAV is close to the fence.
    away = 2000.0 * side * np.array([-math.sin(LOS), math.cos(LOS)])
    moved = now._replace(
        reference=now.reference + away, emitter=now.emitter + np.append(away, [0.0, 0.0])
    )
    terms = Terms(**{**vars(TERMS), "fence_m": 2030.0})
    course = DogLegs(terms).follow(moved, 0.1)
    assert math.copysign(1.0, course) == -side
    assert abs(course) >= math.radians(20.0)
    assert DogLegs(Terms(**{**vars(TERMS), "fence_m": 1.0})).follow(now, 0.1) == 0.0


def test_the_side_is_kept_while_the_estimate_wavers() -> None:
    """Both sides are worth the same here, but for noise."""
    legs, now = DogLegs(TERMS), situation(1)
    first = legs.follow(now, 0.1)
    assert first < 0.0  # the way round that the orbit goes
    rng = np.random.default_rng(0)
    for _ in range(5):
        # By what the bearing is uncertain, and a tenth of what the range is.
        along, across = rng.normal(size=2) * (38.0, 2.0)
        ahead = np.array([math.cos(LOS), math.sin(LOS)])
        shift = along * ahead + across * np.array([-ahead[1], ahead[0]])
        wavering = now._replace(emitter=now.emitter + np.append(shift, [0.0, 0.0]))
        assert legs.follow(wavering, EVERY_S) <= 0.0


def test_the_course_is_straight_again_once_that_is_as_good() -> None:
    legs = DogLegs(TERMS)
    assert legs.follow(situation(1), 0.1) != 0.0
    assert legs.follow(situation(1, range_sigma_m=3.0), EVERY_S - 0.2) != 0.0
    assert legs.follow(situation(1, range_sigma_m=3.0), 0.3) == 0.0


def test_near_the_orbit_the_course_is_straight() -> None:
    assert DogLegs(TERMS).follow(situation(1)._replace(radius_m=1400.0), 0.1) == 0.0


def test_inside_the_orbit_there_is_nothing_to_predict() -> None:
    with pytest.raises(FormationError, match=r"orbit of 1600 m; it starts 1565"):
        one(situation(1)._replace(radius_m=1600.0), 0.0, 5.0)
