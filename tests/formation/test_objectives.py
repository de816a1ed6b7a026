"""The objectives against the estimation's own bound, closed forms and symmetries."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.errors import FormationError
from swarmctl.formation.information import fisher
from swarmctl.formation.objectives import (
    OBJECTIVES,
    Objective,
    approach,
    determinant,
    rms,
    thin,
    track,
)
from swarmctl.formation.requirements import Noise, Requirements
from swarmctl.units import Array
from tests.formation.table_1 import (
    PRIOR,
    standing_at,
    table_1,
    table_1_bound,
    table_1_trajectory,
)


def random_designs(companions: int, count: int) -> Array:
    rng = np.random.default_rng(3)
    shape = (count, companions)
    return np.stack([rng.uniform(-math.pi, math.pi, shape), rng.uniform(10.0, 300.0, shape)], -1)


def each_objective(requirements: Requirements) -> list[Objective]:
    flight = approach(5000.0, 270.0, 12.0, 50.0, PRIOR)
    return [determinant(requirements), rms(requirements), track(requirements, flight)]


# --- one epoch -------------------------------------------------------------------------


def test_determinant_and_rms_are_those_of_the_information_s_inverse() -> None:
    requirements = Requirements(5, 300.0, 10.0, 2000.0, Noise(0.7, 0.3, 0.2))
    designs = random_designs(5, 20)
    covariance = np.linalg.inv(fisher(designs, 2000.0, requirements.noise))
    expected = np.linalg.det(covariance) ** 0.25
    np.testing.assert_allclose(determinant(requirements)(designs), expected, rtol=1e-9)
    expected = np.sqrt(np.trace(covariance, axis1=-2, axis2=-1))
    np.testing.assert_allclose(rms(requirements)(designs), expected, rtol=1e-9)


@pytest.mark.parametrize("degrees", [(180.0,), (90.0,), (0.0, 180.0), (90.0, 180.0)])
def test_a_position_that_is_not_observed_is_infinitely_bad(degrees: tuple[float, ...]) -> None:
    design = standing_at(*degrees)
    requirements = table_1(len(degrees))
    assert determinant(requirements)(design) == math.inf
    assert rms(requirements)(design) == math.inf


def test_two_ends_and_the_reference_already_observe_the_position() -> None:
    """Three points make a parabola."""
    assert rms(table_1(2))(standing_at(90.0, -90.0)) < 1000.0


# --- all objectives --------------------------------------------------------------------


def test_many_designs_in_one_call_get_what_each_gets_alone() -> None:
    requirements = table_1(4)
    designs = random_designs(4, 6)
    for objective in each_objective(requirements):
        together = objective(designs.reshape(2, 3, 4, 2))
        alone = np.array([objective(design) for design in designs])
        assert together.shape == (2, 3)
        assert alone.shape == (6,)
        np.testing.assert_allclose(together.ravel(), alone, rtol=1e-10)


def test_neither_mirroring_nor_renumbering_changes_anything() -> None:
    """On a straight approach; a line of sight that turns to one side tells the sides apart."""
    requirements = table_1(5)
    designs = random_designs(5, 30)
    for objective in each_objective(requirements):
        value = objective(designs)
        np.testing.assert_allclose(objective(designs * [-1.0, 1.0]), value, rtol=1e-9)
        np.testing.assert_allclose(objective(designs[:, ::-1]), value, rtol=1e-9)


@pytest.mark.parametrize("range_m", [600.0, 20_000.0])
def test_on_the_axis_behind_informs_as_ahead_at_any_range(range_m: float) -> None:
    """Not only in the far field: the bearing from slot to emitter is all that counts."""
    requirements = Requirements(3, 300.0, 10.0, range_m)
    flight = approach(range_m, 20.0, 10.0, 50.0, PRIOR)
    behind, ahead = standing_at(70.0, -95.0, 180.0), standing_at(70.0, -95.0, 0.0)
    for objective in (determinant(requirements), rms(requirements), track(requirements, flight)):
        assert objective(ahead) == pytest.approx(objective(behind), rel=1e-8)


def test_the_registry_makes_them_by_name() -> None:
    requirements, design = table_1(3), standing_at(90.0, -90.0, 180.0)
    assert OBJECTIVES["rms"](requirements)(design) == rms(requirements)(design)
    assert OBJECTIVES["determinant"](requirements)(design) == determinant(requirements)(design)
    flight = table_1_trajectory()
    by_name = OBJECTIVES["track"](requirements, flight)(design)
    assert by_name == track(requirements, flight)(design)


# --- the track -------------------------------------------------------------------------


@pytest.mark.parametrize("companions", [1, 3, 6])
def test_the_track_is_the_estimation_s_own_bound(companions: int) -> None:
    """Table 1's flight, whose line of sight turns, random formations that turn with it."""
    designs = random_designs(companions, 3)
    values = track(table_1(companions), table_1_trajectory())(designs)
    expected = [table_1_bound(design) for design in designs]
    np.testing.assert_allclose(values, expected, rtol=1e-8)


def test_the_ranking_at_table_1_s_own_geometry() -> None:
    """Bounds at 12 s as found independently.

    Rounded there to two or three digits, and its guidance is not known to the last metre,
    while what is left of the range counts squared: 3 %.
    """
    paper_4, uniform_4 = (90.0, -90.0) * 2, (0.0, 90.0, 180.0, -90.0)
    expected = {
        paper_4: 5.2,
        uniform_4: 4.5,
        (90.0, 90.0, -90.0, 180.0): 4.45,
        (90.0, -90.0) * 4: 4.88,
        tuple(np.arange(0.0, 360.0, 45.0)): 4.23,
        (*(90.0, -90.0) * 3, 180.0, 180.0): 3.39,
        (*(90.0, -90.0) * 2, *(180.0,) * 4): 3.30,
    }
    for degrees, metres in expected.items():
        value = track(table_1(len(degrees)), table_1_trajectory())(standing_at(*degrees))
        assert value == pytest.approx(metres, rel=0.03)
        assert value == pytest.approx(table_1_bound(standing_at(*degrees)), rel=1e-8)


def test_thirty_epochs_stand_for_six_hundred() -> None:
    """Information goes with range^-4 at most, and the trapezoidal rule is off by h² f'' / 12.

    That is a share of 20/12 (change of range in a step / range)², half of it in the RMS.
    """
    thinned = thin(table_1_trajectory(), 30)
    assert len(thinned.epochs_s) == len(thinned.emitter) == len(thinned.reference) == 30
    assert thinned.epochs_s[[0, -1]] == pytest.approx([0.0, 12.0])
    assert thinned.weights.sum() == pytest.approx(601.0)
    mean = (thinned.weights * thinned.epochs_s).sum() / 601.0
    assert mean == pytest.approx(6.0)
    designs = random_designs(4, 20)
    full = track(table_1(4), table_1_trajectory())(designs)
    ranges = np.linalg.norm(thinned.emitter - thinned.reference, axis=1)
    share = 20.0 / 12.0 * np.square(np.diff(ranges) / ranges[1:]).max()
    assert share < 0.01
    np.testing.assert_allclose(track(table_1(4), thinned)(designs), full, rtol=share)


def test_a_trajectory_of_few_epochs_is_left_alone() -> None:
    assert thin(table_1_trajectory(), 601) is table_1_trajectory()
    with pytest.raises(FormationError, match="at least 2 epochs, not 1"):
        thin(table_1_trajectory(), 1)


def test_an_approach_is_straight_at_constant_speed() -> None:
    flight = approach(3000.0, 20.0, 60.0, 10.0, PRIOR, emitter_velocity=(1.0, -2.0), epochs=7)
    np.testing.assert_allclose(flight.epochs_s, np.arange(0.0, 61.0, 10.0))
    np.testing.assert_allclose(flight.emitter, np.outer(flight.epochs_s, [1.0, -2.0]))
    np.testing.assert_allclose(flight.reference[:, 0], 20.0 * flight.epochs_s - 3000.0)
    assert not flight.reference[:, 1].any()
    assert flight.weights.sum() == pytest.approx(601.0)


def test_more_epochs_more_information() -> None:
    design = standing_at(90.0, -90.0, 180.0)
    slow = track(table_1(3), approach(5000.0, 270.0, 12.0, 5.0, PRIOR))
    fast = track(table_1(3), approach(5000.0, 270.0, 12.0, 50.0, PRIOR))
    assert fast(design) < slow(design) < math.sqrt(2.0 * PRIOR[0, 0] + 2.0 * PRIOR[2, 2] * 144.0)


def test_what_is_no_approach_is_refused() -> None:
    with pytest.raises(FormationError, match=r"12 s at 500 m/s reach beyond the emitter, 5000 m"):
        approach(5000.0, 500.0, 12.0, 50.0, PRIOR)
    with pytest.raises(FormationError, match="no two epochs"):
        approach(5000.0, 270.0, 0.01, 10.0, PRIOR)


def test_what_is_no_trajectory_is_refused() -> None:
    good = approach(5000.0, 270.0, 12.0, 50.0, PRIOR)
    requirements = table_1(3)
    with pytest.raises(FormationError, match=r"must have the shapes .* not \(30,\), \(29, 2\)"):
        track(requirements, good._replace(emitter=good.emitter[1:]))
    with pytest.raises(FormationError, match="must increase"):
        track(requirements, good._replace(epochs_s=good.epochs_s[::-1]))
    with pytest.raises(FormationError, match="positive definite"):
        track(requirements, good._replace(prior_covariance=np.diag([1.0, 1.0, 1.0, 0.0])))
    with pytest.raises(
        FormationError,
        match="comes within 230 m of the reference UAV; the greatest slot distance, 300",
    ):
        track(requirements, approach(5000.0, 265.0, 18.0, 50.0, PRIOR))
