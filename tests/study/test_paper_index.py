"""The paper's L_p: the exact forms by other routes, each approximation where it holds and not.

Every index of independent companions is a sum over pairs of ``w_i w_j`` times something that
does not depend on R, with ``w_j = 1/R_j > 0``. Where an approximation changes no R_j by more
than the share e, it changes L_p by no more than (1 + e)² - 1: the tolerances below.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from swarmctl.errors import FormationError
from swarmctl.formation.information import fisher, slots_in_los_frame
from swarmctl.formation.requirements import Noise
from swarmctl.study import paper_filters, paper_index
from swarmctl.study.paper_index import (
    exact_correlated,
    exact_correlated_unknown_range,
    exact_independent,
    far_field,
    far_field_exact_positions,
    least_over_los,
    least_tangent_variance,
    measurement_covariance,
    perpendicular_limit,
    perpendicular_limit_by_pairs,
    tangent_variance,
)
from swarmctl.units import Array

RANGE = 5000.0
D = 300.0
TABLE_1 = Noise(0.5, 0.5, 0.5)
NO_POSITION_NOISE = Noise(0.5, 0.0, 0.5)
ROUNDING = 1e-9


def design_of(*degrees: float) -> Array:
    return np.column_stack((np.radians(degrees), np.full(len(degrees), D)))


EQUATION_29 = design_of(90.0, -90.0, 0.0)
EQUATION_31 = design_of(90.0, -90.0, 90.0, -90.0)
UNIFORM = design_of(-120.0, 0.0, 120.0)


def some_designs(companions: int = 4, count: int = 500) -> Array:
    rng = np.random.default_rng(companions)
    theta = rng.uniform(-math.pi, math.pi, (count, companions))
    return np.stack([theta, rng.uniform(50.0, D, theta.shape)], axis=-1)


def range_difference(theta: Array, d: Array) -> Array:
    rd: Array = np.hypot(RANGE - d * np.cos(theta), d * np.sin(theta)) - RANGE
    return rd


def information_of_the_linear_model(design: Array, weight: Array) -> Array:
    """Hᵀ M H of the paper's rows h_j, 3 x 3, for one design."""
    rows = paper_filters.rows(slots_in_los_frame(design), range_difference(*design.T))
    information: Array = rows.T @ weight @ rows
    return information


def assert_within(ratio: Array, share: float | Array) -> None:
    """Ratio is in 1 ... (1 + share)², rounding aside."""
    assert (ratio >= 1.0 - ROUNDING).all()
    assert (ratio <= (1.0 + share) ** 2 + ROUNDING).all()


# The exact forms.


def test_equation_16_is_the_determinant_of_13_with_the_paper_s_own_rows_and_variances() -> None:
    for design in some_designs(count=20):
        rd = range_difference(*design.T)
        R = paper_filters.uncertainty(slots_in_los_frame(design), rd, np.full(4, 0.25), 0.5).R
        expected = np.linalg.det(information_of_the_linear_model(design, np.diag(1.0 / R))[:2, :2])
        assert exact_independent(design, RANGE, TABLE_1) == pytest.approx(expected, rel=1e-9)


def test_the_covariance_of_v_is_exact_by_quadrature_over_all_that_is_random() -> None:
    """Products v_i v_j are of degree 4 in nine Gaussians: three nodes per axis leave no rest."""
    noise, design = Noise(3.0, 2.0, 0.3), np.array([[0.4, 20.0], [2.0, 9.0]])  # squares matter
    nodes, weights = np.polynomial.hermite_e.hermegauss(3)
    z = np.array(list(itertools.product(nodes, repeat=9)))
    p = np.array(list(itertools.product(weights / weights.sum(), repeat=9))).prod(axis=-1)

    dp = noise.sigma_p_m * z[:, :6].reshape(-1, 3, 2)
    dm = dp[:, 1:] - dp[:, :1]
    own, common = math.sqrt(1.0 - noise.rho), math.sqrt(noise.rho)
    dr = noise.sigma_r_m * (own * z[:, 6:8] + common * z[:, 8:])
    m, r = slots_in_los_frame(design), range_difference(*design.T)
    y = (r + dr) ** 2 - np.square(m + dm).sum(-1)
    v = y - p @ y
    covariance = (v * p[:, None]).T @ v

    assert measurement_covariance(design, RANGE, noise) == pytest.approx(covariance, rel=1e-9)


def test_with_the_full_covariance_it_is_the_determinant_by_the_linear_model() -> None:
    for design in some_designs(count=20):
        weight = np.linalg.inv(measurement_covariance(design, RANGE, TABLE_1))
        expected = np.linalg.det(information_of_the_linear_model(design, weight)[:2, :2])
        assert exact_correlated(design, RANGE, TABLE_1) == pytest.approx(expected, rel=1e-9)


def test_with_the_range_unknown_it_is_the_inverse_of_the_position_s_own_covariance() -> None:
    for design in some_designs(count=20):
        weight = np.linalg.inv(measurement_covariance(design, RANGE, TABLE_1))
        J = information_of_the_linear_model(design, weight)
        expected = 1.0 / np.linalg.det(np.linalg.inv(J)[:2, :2])
        index = exact_correlated_unknown_range(design, RANGE, TABLE_1)
        assert index == pytest.approx(expected, rel=1e-12 * np.linalg.cond(J))
        assert index <= exact_correlated(design, RANGE, TABLE_1)


def test_two_companions_say_nothing_of_the_position_when_the_range_is_unknown() -> None:
    two = some_designs(2)
    known = exact_correlated(two, RANGE, TABLE_1)
    assert (exact_correlated_unknown_range(two, RANGE, TABLE_1) <= 1e-20 * known.max()).all()


@pytest.mark.parametrize(
    "index", [exact_independent, exact_correlated, exact_correlated_unknown_range]
)
def test_companions_at_the_reference_itself_say_nothing(
    index: Callable[[Array, float, Noise], Array],
) -> None:
    # All RDs are zero, so there is nothing to take the range's part out of.
    assert index(np.zeros((3, 2)), RANGE, TABLE_1) == 0.0


def test_nothing_shared_makes_the_full_covariance_the_paper_s() -> None:
    designs, alone = some_designs(), Noise(0.5, 0.0, 0.0)
    ratio = exact_correlated(designs, RANGE, alone) / exact_independent(designs, RANGE, alone)
    assert ratio == pytest.approx(np.ones(len(designs)), rel=1e-9)


# The approximations: where they hold, and where not.


def test_21_holds_where_position_noise_outweighs_the_bend_of_the_wavefront() -> None:
    """|r_j + d cos theta| <= d²/2(R - d), so R_j changes by 4 sigma_r² d³/(R - d) at most.

    R_j is 8 sigma_p² d² at least.
    """
    designs = some_designs()
    share = TABLE_1.sigma_r_m**2 / (2.0 * TABLE_1.sigma_p_m**2) * D / (RANGE - D)
    assert share < 0.04
    exact, ratio = exact_independent(designs, RANGE, TABLE_1), far_field(designs, TABLE_1)
    ratio = ratio / exact
    assert (ratio <= (1.0 - share) ** -2).all()
    assert (ratio >= (1.0 + share) ** -2).all()
    assert abs(ratio - 1.0).max() > share / 10.0  # and no tighter than it has to be


def test_21_without_position_noise_overrates_29_by_what_20_leaves_out() -> None:
    r = math.hypot(RANGE, D) - RANGE
    assert r == pytest.approx(D**2 / (2.0 * RANGE), rel=1e-2)
    ratio = far_field(EQUATION_29, NO_POSITION_NOISE)
    ratio = ratio / exact_independent(EQUATION_29, RANGE, NO_POSITION_NOISE)
    assert ratio == pytest.approx(1.0 + 2.0 * (r / 0.5) ** 2, rel=1e-9)
    assert ratio > 600.0


def left_out_by_22(design: Array, noise: Noise) -> Array:
    x, d = slots_in_los_frame(design)[..., 0], design[..., 1]
    kept = 2.0 * noise.sigma_r_m**2 * (2.0 * x * x + noise.sigma_r_m**2)
    share: Array = 8.0 * noise.sigma_p_m**2 * (d * d + 2.0 * noise.sigma_p_m**2) / kept
    return share


def test_24_holds_where_positions_are_far_better_known_than_the_rd() -> None:
    designs, noise = some_designs(), Noise(0.5, 1e-4, 0.5)
    share = left_out_by_22(designs, noise).max(axis=-1)
    assert np.median(share) < 1e-3
    ratio = far_field_exact_positions(designs, noise) / far_field(designs, noise)
    assert_within(ratio, share)


def test_24_s_sigma_p_much_less_than_1_is_false_in_table_1() -> None:
    share = left_out_by_22(EQUATION_29, TABLE_1)
    assert share == pytest.approx([1.44e6, 1.44e6, 2.0], rel=1e-4)
    ratio = far_field_exact_positions(EQUATION_29, TABLE_1) / far_field(EQUATION_29, TABLE_1)
    assert ratio == pytest.approx((1.0 + share[0]) * (1.0 + share[2]), rel=1e-4)


def test_25_holds_where_no_cosine_is_small() -> None:
    designs = some_designs()
    designs = designs[(abs(np.cos(designs[..., 0])) > 0.3).all(axis=-1)]
    assert len(designs) > 50
    share = (0.5 / (designs[..., 1] * np.cos(designs[..., 0]))) ** 2 / 2.0
    ratio = tangent_variance(designs, TABLE_1) / far_field_exact_positions(designs, TABLE_1)
    assert_within(ratio, share.max(axis=-1))


def test_25_grows_without_bound_towards_29_where_24_does_not() -> None:
    offsets = (1e-1, 1e-3, 1e-5)
    near = np.stack([design_of(90.0, -90.0, 0.0)] * 3)
    near[:, 0, 0] -= offsets
    near[:, 1, 0] += offsets
    overrated = tangent_variance(near, TABLE_1) / far_field_exact_positions(near, TABLE_1)
    # (24) has 1 / (4 sigma_r² cos² (1 + share)) where (25) has 1 / (4 sigma_r² cos²): once in the
    # two pairs with the companion on the axis, twice in the pair of the arms.
    share = (0.5 / D / np.sin(offsets)) ** 2 / 2.0
    expected = 6.0 / (2.0 / (1.0 + share) + 4.0 / (1.0 + share) ** 2)
    assert overrated == pytest.approx(expected, rel=1e-5)  # the axis' own share is 1e-6
    assert overrated[0] < 1.001
    assert overrated[2] > 1e4


def test_31_the_optimum_of_25_for_even_n_has_no_information_at_all() -> None:
    assert tangent_variance(EQUATION_31, TABLE_1) > 1e30
    best = exact_independent(design_of(90.0, -90.0, 0.0, 180.0), RANGE, TABLE_1)
    for index in (exact_independent, exact_correlated, exact_correlated_unknown_range):
        # cos 90 deg is 6e-17 in floating point, and the determinant is of its square.
        assert index(EQUATION_31, RANGE, TABLE_1) <= 1e-30 * best
    assert far_field(EQUATION_31, TABLE_1) <= 1e-30 * best


def test_28_is_the_least_of_25_over_the_last_angle() -> None:
    designs = some_designs()
    least = least_tangent_variance(designs, TABLE_1)
    assert (tangent_variance(designs, TABLE_1) >= least * (1.0 - ROUNDING)).all()
    at_the_mean = designs.copy()
    at_the_mean[:, -1, 0] = np.arctan(np.tan(designs[:, :-1, 0]).mean(axis=-1))  # (26)
    ratio = tangent_variance(at_the_mean, TABLE_1) / least
    assert ratio == pytest.approx(np.ones(len(designs)), rel=1e-9)


def test_30_has_n_less_2_over_n_less_1_squared() -> None:
    n, pair, odd = 6, np.array([0.7, 1.1]), 0.4
    angles = np.array([pair[0], -pair[0], pair[1], -pair[1], odd, 0.0])
    design = np.column_stack((angles, np.full(n, D)))
    t = np.tan(angles)
    bracket = (t[:-2] ** 2).sum() / (n - 1) + (n - 2) / (n - 1) ** 2 * t[-2] ** 2
    expected = n * (n - 1) / TABLE_1.sigma_r_m**4 * bracket
    assert least_tangent_variance(design, TABLE_1) == pytest.approx(expected, rel=1e-12)


def test_28_needs_another_companion() -> None:
    with pytest.raises(FormationError, match="N is 1"):
        least_tangent_variance(design_of(90.0), TABLE_1)


def test_32_holds_where_all_cosines_are_tiny() -> None:
    rng = np.random.default_rng(32)
    designs = some_designs()
    side = np.where(designs[..., 0] > 0.0, 0.5, -0.5) * math.pi
    designs[..., 0] = side + rng.uniform(-1e-4, 1e-4, side.shape)
    share = 2.0 * (designs[..., 1] * np.cos(designs[..., 0]) / 0.5) ** 2
    assert share.max() < 0.01
    ratio = perpendicular_limit(designs, TABLE_1) / far_field_exact_positions(designs, TABLE_1)
    # (32) takes the difference of two nearly equal products: some 1e-16 of (cos)^-2 = 1e8.
    assert (ratio >= 1.0 - 1e-6).all()
    assert (ratio <= (1.0 + share.max(axis=-1)) ** 2 + 1e-6).all()


def test_32_is_off_by_the_fourth_power_of_d_over_sigma_r_elsewhere() -> None:
    on_axis_and_beside = design_of(0.0, 45.0)
    ratio = perpendicular_limit(on_axis_and_beside, TABLE_1)
    ratio = ratio / far_field_exact_positions(on_axis_and_beside, TABLE_1)
    d_over_sigma = D / 0.5
    expected = (1.0 + 2.0 * d_over_sigma**2) * (1.0 + d_over_sigma**2)
    assert ratio == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("companions", [2, 3, 8])
def test_34_is_32_with_each_pair_once_and_all_companions(companions: int) -> None:
    designs = some_designs(companions)
    by_pairs = perpendicular_limit_by_pairs(designs, TABLE_1)
    difference = by_pairs - perpendicular_limit(designs, TABLE_1)
    # Rounding in (32) is of its terms, which may be far larger than their difference.
    terms = 4.0 / TABLE_1.sigma_r_m**8 * (designs[..., 1] ** 2).sum(axis=-1) ** 2
    assert (abs(difference) <= 1e-14 * terms).all()


# What the index is worth.


def test_table_1_puts_the_uniform_circle_above_29_on_the_paper_s_own_objective() -> None:
    def ratio(index: Callable[[Array, float, Noise], Array]) -> float:
        return float(index(EQUATION_29, RANGE, TABLE_1) / index(UNIFORM, RANGE, TABLE_1))

    assert ratio(exact_independent) == pytest.approx(0.91, abs=0.005)
    assert ratio(exact_correlated) < 1.0
    # The range differences themselves say otherwise, and so does L_p with the range unknown.
    truth = np.linalg.det(fisher(np.stack([EQUATION_29, UNIFORM]), RANGE, TABLE_1))
    assert truth[0] > 2.0 * truth[1]
    assert ratio(exact_correlated_unknown_range) > 2.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_least_over_the_los_is_that_of_a_closed_form(side: float) -> None:
    """(25) for two: (t_1 - t_2)²/sigma_r⁴ is least with the LOS midway: 4 tan²(half between)."""
    one, other = 0.31, 1.02
    design = np.array([[side * one, D], [side * other, D]])
    half = (other - one) / 2.0
    least = 4.0 * math.tan(half) ** 2 / TABLE_1.sigma_r_m**4
    found = least_over_los(lambda d: tangent_variance(d, TABLE_1), design, 0.8, steps=161)
    # About its least it is least x (1 + 2 x² / cos² half + ...) with x the LOS from midway.
    step = 1.6 / 160
    assert least * (1.0 - ROUNDING) <= found
    assert found <= least * (1.0 + 1.01 * 2.0 * (step / 2.0 / math.cos(half)) ** 2)


def test_a_sector_of_no_width_is_the_design_as_it_stands() -> None:
    designs = some_designs(count=6).reshape(2, 3, 4, 2)
    least = least_over_los(lambda d: far_field(d, TABLE_1), designs, 0.0, steps=3)
    assert (least == far_field(designs, TABLE_1)).all()


def test_the_paper_s_min_over_one_angle_is_not_the_worst_line_of_sight() -> None:
    design = design_of(80.0, -80.0, 0.0)
    printed = least_tangent_variance(design, TABLE_1)
    assert printed == pytest.approx(tangent_variance(design, TABLE_1))  # the last is at its worst
    turned = least_over_los(
        lambda d: tangent_variance(d, TABLE_1), design, math.radians(30.0), steps=61
    )
    angles = np.radians([50.0, -110.0, -30.0])
    assert turned == pytest.approx(9.0 / 0.5**4 * np.tan(angles).var(), rel=1e-9)
    assert turned < 0.1 * printed


INDICES: dict[str, Callable[[Array], Array]] = {
    "exact_independent": lambda d: exact_independent(d, RANGE, TABLE_1),
    "exact_correlated": lambda d: exact_correlated(d, RANGE, TABLE_1),
    "exact_correlated_unknown_range": lambda d: exact_correlated_unknown_range(d, RANGE, TABLE_1),
    **{
        f.__name__: lambda d, f=f: f(d, TABLE_1)  # type: ignore[misc]
        for f in (
            far_field,
            far_field_exact_positions,
            tangent_variance,
            least_tangent_variance,
            perpendicular_limit,
            perpendicular_limit_by_pairs,
        )
    },
    "least_over_los": lambda d: least_over_los(lambda e: far_field(e, TABLE_1), d, 0.5, steps=11),
}


@pytest.mark.parametrize("name", sorted(INDICES))
def test_a_stack_of_designs_is_each_of_them(name: str) -> None:
    assert hasattr(paper_index, name)
    designs = some_designs(count=6).reshape(2, 3, 4, 2)
    stacked = INDICES[name](designs)
    assert stacked.shape == (2, 3)
    alone = [[float(INDICES[name](design)) for design in row] for row in designs]
    assert stacked == pytest.approx(np.array(alone), rel=1e-9)
