"""The designs against the paper's equations, the theory of regression, and each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmctl.errors import FormationError
from swarmctl.formation.design_search import worst
from swarmctl.formation.designs import DESIGNS, optimal, paper, regression, uniform, worst_case
from swarmctl.formation.information import slots_in_los_frame
from swarmctl.formation.objectives import OBJECTIVES, determinant, rms, thin, track
from swarmctl.formation.requirements import Noise, Requirements
from swarmctl.units import Array
from tests.formation.table_1 import standing_at, table_1, table_1_bound, table_1_trajectory

SECTOR = np.radians(np.linspace(-30.0, 30.0, 121))


def nearest_and_farthest(design: Array) -> tuple[float, float]:
    """Least distance of any two UAVs, and the greatest of one from the reference, m."""
    swarm = np.vstack((np.zeros(2), slots_in_los_frame(design)))
    apart = np.linalg.norm(swarm[:, None] - swarm[None], axis=-1)
    farthest = float(apart[0].max())
    np.fill_diagonal(apart, np.inf)
    return float(apart.min()), farthest


def on_axis(design: Array) -> Array:
    """Angles of the slots on the axis of the line of sight."""
    slots = slots_in_los_frame(design)
    angles: Array = design[np.abs(slots[:, 1]) < 1e-6, 0]
    return angles


def ends_and_middle(design: Array) -> tuple[int, int, int]:
    """How many slots are to the left, on the axis and to the right."""
    across = slots_in_los_frame(design)[:, 1]
    left, right = int((across > 1e-6).sum()), int((across < -1e-6).sum())
    return left, len(design) - left - right, right


# --- every design ----------------------------------------------------------------------


@given(
    name=st.sampled_from(["uniform", "paper", "regression"]),
    companions=st.integers(1, 12),
    d_m=st.floats(20.0, 1000.0),
    shares=st.floats(0.01, 1.0),
    ranges=st.floats(1.05, 100.0),
    ahead=st.booleans(),
)
def test_slots_keep_the_separation_and_the_range(
    name: str, companions: int, d_m: float, shares: float, ranges: float, ahead: bool
) -> None:
    wanted = Requirements(companions, d_m, d_m * shares, d_m * ranges, ahead=ahead)
    try:
        design = DESIGNS[name](wanted, determinant(wanted))
    except FormationError:
        assert shares > 0.1  # nobody is refused where there is plenty of room
        return
    assert design.shape == (companions, 2)
    assert (np.abs(design[:, 0]) <= math.pi).all()
    nearest, farthest = nearest_and_farthest(design)
    assert nearest >= wanted.separation_m * (1.0 - 1e-8)
    assert farthest <= d_m * (1.0 + 1e-8)


@settings(max_examples=12, deadline=None)
@given(
    name=st.sampled_from(["worst_case", "optimal"]),
    companions=st.integers(1, 6),
    shares=st.floats(0.01, 0.4),
    ranges=st.floats(1.5, 50.0),
    noise=st.sampled_from([Noise(0.5, 0.0, 0.0), Noise(0.5, 1.0, 0.5)]),
)
def test_so_do_the_slots_of_a_search(
    name: str, companions: int, shares: float, ranges: float, noise: Noise
) -> None:
    wanted = Requirements(companions, 300.0, 300.0 * shares, 300.0 * ranges, noise)
    try:
        design = DESIGNS[name](wanted, rms(wanted))
    except FormationError:
        assert shares > 0.1
        return
    nearest, farthest = nearest_and_farthest(design)
    assert nearest >= wanted.separation_m * (1.0 - 1e-8)
    assert farthest <= 300.0 * (1.0 + 1e-8)


@pytest.mark.parametrize("name", sorted(DESIGNS))
def test_too_many_for_the_range_names_the_numbers(name: str) -> None:
    wanted = Requirements(12, 20.0, 15.0, 1000.0)
    with pytest.raises(FormationError, match=r"12 companions.* 20 m") as refused:
        DESIGNS[name](wanted, rms(wanted))
    assert "15 m" in str(refused.value)


@pytest.mark.parametrize("name", sorted(DESIGNS))
def test_six_fit_even_where_the_separation_is_the_range(name: str) -> None:
    """A hexagon."""
    wanted = Requirements(6, 20.0, 20.0, 1000.0)
    assert nearest_and_farthest(DESIGNS[name](wanted, rms(wanted))) == pytest.approx((20, 20))


def test_a_swarm_too_crowded_for_the_paper_s_rule_may_fit_otherwise() -> None:
    wanted = Requirements(9, 40.0, 25.0, 1000.0)
    with pytest.raises(FormationError, match="9 companions perpendicular to the line of sight"):
        paper(wanted)
    assert nearest_and_farthest(regression(wanted, rms(wanted)))[0] >= 25.0 * (1.0 - 1e-8)


@pytest.mark.parametrize("name", ["paper", "regression", "optimal"])
def test_slots_on_the_axis_are_behind_unless_ahead_is_asked_for(name: str) -> None:
    behind = Requirements(7, 300.0, 10.0, 5000.0)
    ahead = Requirements(7, 300.0, 10.0, 5000.0, ahead=True)
    objective = rms(behind)
    first, second = (DESIGNS[name](wanted, objective) for wanted in (behind, ahead))
    assert len(on_axis(first)) == len(on_axis(second)) >= 1
    assert np.cos(on_axis(first)) == pytest.approx(-1.0)
    assert np.cos(on_axis(second)) == pytest.approx(1.0)
    assert objective(first) == pytest.approx(float(objective(second)), rel=1e-6)


def test_the_axis_is_filled_behind_before_anyone_goes_ahead() -> None:
    """Four fit behind at 15 m within 60 m: 60, 45, 30 and 15 m."""
    wanted = Requirements(9, 60.0, 15.0, 5000.0)
    angles = on_axis(regression(wanted, rms(wanted)))
    assert (np.cos(angles) < 0.0).sum() == 4
    assert len(angles) == 5


# --- the paper's -----------------------------------------------------------------------


def test_the_uniform_formation_of_table_1() -> None:
    assert np.degrees(uniform(table_1(3))[:, 0]) == pytest.approx([-120.0, 0.0, 120.0])


@pytest.mark.parametrize("companions", [1, 4, 7])
def test_the_uniform_circle_is_that_of_remark_2(companions: int) -> None:
    """theta_j = 360° j / N: the N-th roots of one, each of them."""
    design = uniform(table_1(companions))
    roots = np.exp(1j * design[:, 0])
    assert roots**companions == pytest.approx(1.0)
    assert len(set(np.round(np.degrees(design[:, 0]), 6))) == companions
    assert (np.diff(design[:, 0]) > 0.0).all()
    assert design[:, 1] == pytest.approx(300.0)


def test_three_companions_stand_as_in_equation_29_with_the_odd_one_behind() -> None:
    design = paper(table_1(3))
    assert np.degrees(design[:, 0]) == pytest.approx([90.0, -90.0, 180.0])
    assert design[:, 1] == pytest.approx(300.0)


def test_four_companions_stand_as_in_equation_31_spread_along_the_circle() -> None:
    """By half the separation to each side: 5 m on 300 m."""
    design = paper(table_1(4))
    half = math.degrees(math.asin(5.0 / 300.0))
    expected = [-90.0 - half, -90.0 + half, 90.0 - half, 90.0 + half]
    assert np.sort(np.degrees(design[:, 0])) == pytest.approx(expected)
    assert design[:, 1] == pytest.approx(300.0)


@given(companions=st.integers(2, 24), separation_m=st.floats(2.0, 60.0))
def test_spreading_an_arm_costs_no_more_than_along_the_circle_or_inwards(
    companions: int, separation_m: float
) -> None:
    """Cost is what is lost of s², on which the information goes."""
    count = companions // 2
    try:
        design = paper(Requirements(companions, 300.0, separation_m, 5000.0))
    except FormationError:
        return
    across = np.square(slots_in_los_frame(design)[: 2 * count, 1]).sum() / 2.0
    inwards = 300.0 - separation_m * np.arange(count)
    if (inwards > 0.0).all():
        assert across >= np.square(inwards).sum() * (1.0 - 1e-12)
    angle = 2.0 * math.asin(separation_m / 600.0)
    along = (np.arange(count) - 0.5 * (count - 1)) * angle
    if (np.abs(along) < 0.5 * math.pi).all():
        assert across >= np.square(300.0 * np.cos(along)).sum() * (1.0 - 1e-12)


@pytest.mark.parametrize("companions", [2, 5, 8, 11])
def test_the_paper_s_and_the_uniform_formation_mirror_themselves(companions: int) -> None:
    for design in (paper(table_1(companions)), uniform(table_1(companions))):
        slots = slots_in_los_frame(design)
        image = slots * [1.0, -1.0]
        distance = np.linalg.norm(slots[:, None] - image[None], axis=-1)
        assert distance.min(axis=1) == pytest.approx(0.0, abs=1e-9)


# --- regression ------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["determinant", "rms"])
def test_three_companions_get_the_paper_s_own_formation(name: str) -> None:
    """But for the finite range: the ends are where the emitter's rays touch the circle."""
    wanted = Requirements(3, 300.0, 10.0, 900.0)
    design = regression(wanted, OBJECTIVES[name](wanted))
    end = math.degrees(math.acos(1.0 / 3.0))
    assert np.degrees(design[:, 0]) == pytest.approx([end, -end, 180.0])
    assert design[:, 1] == pytest.approx(300.0)


@pytest.mark.parametrize(
    ("name", "companions", "split"),
    [
        ("determinant", 8, (3, 2, 3)),
        ("determinant", 11, (4, 3, 4)),
        ("rms", 7, (2, 3, 2)),
        ("rms", 11, (3, 5, 3)),
    ],
)
def test_splits_of_the_theory_when_errors_are_common(
    name: str, companions: int, split: tuple[int, int, int]
) -> None:
    """A third each for the determinant; a quarter, a half, a quarter for the RMS.

    Equal receivers, exact positions: every UAV's timing counts alike, the reference's, too.
    """
    noise = Noise(0.5, 0.0, 0.5)
    wanted = Requirements(companions, 300.0, 1.0, 1e5, noise)
    objective = OBJECTIVES[name](wanted)
    assert ends_and_middle(regression(wanted, objective)) == split


def test_when_errors_are_not_common_all_stand_at_the_ends() -> None:
    """The reference then costs nothing, and nobody is needed beside it."""
    wanted = Requirements(8, 300.0, 1.0, 1e5, Noise(0.5, 0.0, 0.0))
    assert ends_and_middle(regression(wanted, determinant(wanted))) == (4, 0, 4)
    assert ends_and_middle(regression(wanted, rms(wanted))) == (4, 0, 4)


@pytest.mark.parametrize(("ranges", "gain"), [(17.0, 1.01), (3.0, 1.38)])
def test_at_finite_range_ends_at_ninety_degrees_lose(ranges: float, gain: float) -> None:
    """By 1 % of the information's determinant at 17 d, by 38 % at 3 d."""
    wanted = Requirements(3, 300.0, 10.0, 300.0 * ranges)
    objective = determinant(wanted)
    ratio = objective(paper(wanted)) / objective(regression(wanted, objective))
    assert ratio**4 == pytest.approx(gain, abs=0.005)


# --- worst case ------------------------------------------------------------------------


@pytest.mark.parametrize("companions", [3, 4, 5])
@pytest.mark.parametrize("by", ["determinant", "rms"])
def test_over_the_sector_no_other_design_is_better(companions: int, by: str) -> None:
    wanted = table_1(companions)
    objective = OBJECTIVES[by](wanted)
    best = worst(objective, worst_case(wanted, objective), SECTOR)
    for name in ("uniform", "paper", "regression", "optimal"):
        # The search looks at nine angles of the sector: between them 1 % may hide.
        assert best <= 1.01 * worst(objective, DESIGNS[name](wanted, objective), SECTOR)


def test_four_over_a_sector_of_thirty_degrees() -> None:
    """For the determinant the ends spread to 63° and 108°.

    For the RMS a design that does not mirror itself is better than ends at 32° and 97°.
    """
    wanted = table_1(4)
    design = worst_case(wanted, determinant(wanted))
    assert np.sort(np.degrees(design[:, 0])) == pytest.approx([-108, -63, 63, 108], abs=1.0)
    design = worst_case(wanted, rms(wanted))
    mirrored = worst(rms(wanted), standing_at(32.0, -32.0, 97.0, -97.0), SECTOR)
    assert worst(rms(wanted), design, SECTOR) < 0.97 * mirrored


def test_without_a_sector_the_worst_case_is_the_case() -> None:
    wanted = Requirements(5, 300.0, 10.0, 5000.0, sector_rad=0.0)
    objective = determinant(wanted)
    value = objective(worst_case(wanted, objective))
    assert value == pytest.approx(float(objective(optimal(wanted, objective))), rel=1e-6)


# --- optimal ---------------------------------------------------------------------------


@pytest.mark.parametrize("by", ["determinant", "rms"])
@pytest.mark.parametrize(
    ("companions", "range_km", "sigma_p", "rho"),
    [(3, 1, 0.0, 0.0), (4, 20, 1.0, 0.5), (6, 5, 0.0, 0.5), (12, 2, 1.0, 0.0)],
)
def test_optimal_is_at_least_as_good_as_every_other(
    by: str, companions: int, range_km: float, sigma_p: float, rho: float
) -> None:
    wanted = Requirements(companions, 300.0, 10.0, 1000.0 * range_km, Noise(0.5, sigma_p, rho))
    objective = OBJECTIVES[by](wanted)
    value = objective(optimal(wanted, objective))
    assert math.isfinite(value)
    for name, design in DESIGNS.items():
        if name == "worst_case" and companions == 12:
            continue  # takes half a second
        other = objective(design(wanted, objective))
        # The search ends when a step gains less than 1e-7; those it starts from it may not lose.
        assert value <= other * (1.0 + (1e-12 if name != "worst_case" else 1e-6))


def test_optimal_cannot_be_improved_by_small_moves() -> None:
    """At 1 km, crowded, where it is 0.4 % better than any split between ends and axis."""
    wanted = Requirements(5, 300.0, 10.0, 1000.0)
    objective = rms(wanted)
    design = optimal(wanted, objective)
    assert objective(design) < 0.997 * objective(regression(wanted, objective))
    rng = np.random.default_rng(4)
    moved = design + rng.normal(0.0, 1.0, (4000, 5, 2)) * [0.01, 3.0] * rng.random((4000, 1, 1))
    moved[..., 1] = np.minimum(moved[..., 1], 300.0)
    kept = [m for m in moved if nearest_and_farthest(m)[0] >= 10.0]
    assert len(kept) > 100
    assert objective(np.stack(kept)).min() >= objective(design) * (1.0 - 1e-6)


@pytest.mark.parametrize(
    ("companions", "others"),
    [(4, {"uniform": 4.5, "paper": 5.2}), (8, {"uniform": 4.23, "paper": 4.88})],
)
def test_the_track_at_table_1_s_own_geometry(companions: int, others: dict[str, float]) -> None:
    """Bounds at 12 s as found independently: see the objectives' tests for the 3 %.

    The paper's rule for even N puts nobody beside the reference and loses to a circle.
    """
    wanted = table_1(companions)
    objective = track(wanted, thin(table_1_trajectory(), 30))
    for name, metres in others.items():
        value = table_1_bound(DESIGNS[name](wanted, objective))
        assert value == pytest.approx(metres, rel=0.03)
    best = table_1_bound(optimal(wanted, objective))
    assert best < {4: 4.4, 8: 3.3}[companions]
    assert best <= table_1_bound(regression(wanted, objective)) * 1.001
