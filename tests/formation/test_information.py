"""The range differences' Fisher information: derivatives, symmetries, and what it predicts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.errors import FormationError
from swarmctl.estimation.bounds.pcrb import CramerRaoBound
from swarmctl.estimation.model.motion import ConstantVelocity
from swarmctl.estimation.model.range_difference import range_differences, rd_covariance
from swarmctl.formation.information import (
    fisher,
    noise_covariance,
    predicted_accuracy,
    slots_in_los_frame,
)
from swarmctl.formation.requirements import Noise
from swarmctl.units import Array

RANGE = 3000.0
D = 300.0
NOISE = Noise(0.7, 0.4, 0.3)
VARIANCE = 0.7**2 + 2.0 * 0.4**2


def design_of(*degrees: float) -> Array:
    return np.column_stack((np.radians(degrees), np.full(len(degrees), D)))


def some_designs(companions: int = 4, count: int = 50) -> Array:
    rng = np.random.default_rng(companions)
    theta = rng.uniform(-math.pi, math.pi, (count, companions))
    return np.stack([theta, rng.uniform(50.0, D, theta.shape)], axis=-1)


def covariance(companions: int) -> Array:
    """Of the RDs, written out: own receiver and position, reference's receiver and position."""
    C = np.full((companions, companions), 0.3 * 0.49 + 0.16)
    C[np.diag_indices(companions)] = VARIANCE
    return C


def test_the_noise_of_two_rds_has_the_reference_s_receiver_and_position_in_common() -> None:
    assert noise_covariance(4, NOISE) == pytest.approx(covariance(4), rel=1e-12)
    assert NOISE.rho_eff == pytest.approx(covariance(4)[0, 1] / VARIANCE, rel=1e-12)


def test_a_slot_s_x_is_along_the_line_of_sight_and_its_y_to_the_left() -> None:
    slots = slots_in_los_frame(np.array([[0.0, 5.0], [math.pi / 2.0, 7.0]]))
    assert slots == pytest.approx(np.array([[5.0, 0.0], [0.0, 7.0]]), abs=1e-15)


@pytest.mark.parametrize(
    ("heights", "drop"),
    [(None, 0.0), (np.array([0.0, 40.0, -60.0, 90.0]), 120.0), (None, 800.0)],
)
def test_it_is_the_derivative_of_the_slant_range_differences(
    heights: Array | None, drop: float
) -> None:
    step = 0.5
    for design in some_designs(count=10):
        slots = np.column_stack((slots_in_los_frame(design), np.zeros(4)))
        if heights is not None:
            slots[:, 2] = heights
        emitter = np.array([RANGE, 0.0, -drop])
        columns = []
        for axis in np.eye(3)[:2]:
            ahead, back = (
                range_differences(emitter + sign * step * axis, np.zeros(3), slots)
                for sign in (1.0, -1.0)
            )
            columns.append((ahead - back) / (2.0 * step))
        H = np.column_stack(columns)
        weight = np.linalg.inv(covariance(4))
        found = fisher(design, RANGE, NOISE, heights_m=heights, drop_m=drop)
        # The third derivative of a range D is at most 2/D², so that of an RD 4/D²; the rounding
        # of an RD is some 4 epsilon D.
        nearest = RANGE - D - 1.0
        error = step**2 / 6.0 * 4.0 / nearest**2 + 4.0 * 2.2e-16 * RANGE / step
        spread = math.sqrt(8.0) * error
        tolerance = np.linalg.norm(weight, 2) * (2.0 * np.linalg.norm(H) * spread + spread**2)
        assert np.linalg.norm(found - H.T @ weight @ H) <= tolerance
        assert tolerance < 1e-3 * np.linalg.norm(found)


def test_two_abeam_tell_the_range_together_and_the_bearing_against_each_other() -> None:
    """At +-90 deg the two RDs agree in what moves along the LOS and oppose in what moves across.

    So one eigenvalue of C, V (1 +- q), counts for each axis.
    """
    slant = math.hypot(RANGE, D)
    along, across = 1.0 - RANGE / slant, D / slant
    q = NOISE.rho_eff
    expected = [
        [2.0 * along**2 / (VARIANCE * (1.0 + q)), 0.0],
        [0.0, 2.0 * across**2 / (VARIANCE * (1.0 - q))],
    ]
    found = fisher(design_of(90.0, -90.0), RANGE, NOISE)
    # 1 - RANGE / slant is 0.005: it keeps all but two digits.
    assert found == pytest.approx(np.array(expected), rel=1e-12, abs=1e-18)


def test_neither_order_nor_side_matters() -> None:
    designs = some_designs()
    information = fisher(designs, RANGE, NOISE)
    assert information.shape == (50, 2, 2)
    assert fisher(designs[:, ::-1], RANGE, NOISE) == pytest.approx(information, rel=1e-9)
    mirrored = fisher(designs * [-1.0, 1.0], RANGE, NOISE)
    assert mirrored == pytest.approx(information * [[1.0, -1.0], [-1.0, 1.0]], rel=1e-9)
    assert fisher(designs[7], RANGE, NOISE) == pytest.approx(information[7], rel=1e-12)


def test_on_the_axis_behind_informs_as_ahead_at_any_range() -> None:
    """There u_j = u_0: the row is zero, and only the noise it shares with the others informs."""
    ahead, behind = design_of(90.0, -90.0, 0.0), design_of(90.0, -90.0, 180.0)
    information = fisher(ahead, 2.0 * D, NOISE)
    # sin 180 deg is 1e-16 in floating point.
    assert fisher(behind, 2.0 * D, NOISE) == pytest.approx(information, rel=1e-12, abs=1e-15)
    without = fisher(ahead[:2], 2.0 * D, NOISE)
    assert information[0, 0] > 1.2 * without[0, 0]


def test_off_the_axis_behind_informs_as_ahead_in_the_far_field() -> None:
    """A slot's row is -(s²/(D (D + R - a)), s/D), s across and a along, D between R -+ d.

    In units of d²/2R² and d/R its entries are within (R/(R + d))^k and (R/(R - d))^k, k = 2
    along and 1 across, and mirroring a may move them by no more than the difference.
    """
    far, designs = 1000.0 * D, some_designs()
    mirrored = designs.copy()
    mirrored[..., 0] = math.pi - designs[..., 0]
    unit = np.array([D**2 / (2.0 * far**2), D / far])
    scaled, other = (fisher(d, far, NOISE) / np.outer(unit, unit) for d in (designs, mirrored))

    most, least = far / (far - D), far / (far + D)
    moved = math.sqrt(4.0 * ((most**2 - least**2) ** 2 + (most - least) ** 2))
    rows = math.sqrt(4.0 * (most**4 + most**2))
    weight = 1.0 / (VARIANCE * (1.0 - NOISE.rho_eff))  # largest eigenvalue of C^-1
    bound = weight * (2.0 * rows * moved + moved**2)
    change = np.linalg.norm(scaled - other, axis=(-2, -1))
    assert (change <= bound).all()
    assert bound < 0.05 * weight * rows**2
    near = [fisher(d, 2.0 * D, NOISE) for d in (designs, mirrored)]
    assert (np.linalg.norm(near[0] - near[1], axis=(-2, -1)) > 0.1 * abs(near[0][:, 1, 1])).any()


def test_the_common_share_and_the_variance_are_all_that_counts_of_the_noise() -> None:
    receivers_only = Noise(math.sqrt(VARIANCE), 0.0, NOISE.rho_eff)
    designs = some_designs()
    information = fisher(designs, RANGE, NOISE)
    assert fisher(designs, RANGE, receivers_only) == pytest.approx(information, rel=1e-9)
    other_share = fisher(designs, RANGE, Noise(math.sqrt(VARIANCE), 0.0, 0.0))
    assert not np.allclose(other_share, information, rtol=0.1)


def test_a_slot_at_the_emitter_is_refused() -> None:
    with pytest.raises(FormationError, match="A UAV is at the emitter, 300 m along"):
        fisher(design_of(90.0, 0.0), D, NOISE)
    fisher(design_of(90.0, 0.0), D, NOISE, drop_m=100.0)  # above it


def test_what_cannot_be_is_refused() -> None:
    design = np.array([[1.5, 300.0], [-1.5, 300.0]])
    with pytest.raises(FormationError, match="A UAV is at the emitter, 0 m along"):
        fisher(design, 0.0, Noise())
    with pytest.raises(FormationError, match=r"A design must be \(..., N, 2\) with N >= 1"):
        fisher(design[:0], 5000.0, Noise())
    for time_s, rate_hz in ((-1.0, 1.0), (1.0, 0.0), (np.nan, 1.0)):
        with pytest.raises(FormationError, match="Time and rate must be above 0"):
            predicted_accuracy(design, 5000.0, Noise(), time_s=time_s, rate_hz=rate_hz)


def test_accuracy_is_the_inverse_of_what_all_epochs_tell() -> None:
    designs = some_designs(3)
    accuracy = predicted_accuracy(designs, RANGE, NOISE, time_s=8.0, rate_hz=5.0)
    covariances = np.linalg.inv(40.0 * fisher(designs, RANGE, NOISE))
    assert accuracy.along_m == pytest.approx(np.sqrt(covariances[:, 0, 0]), rel=1e-6)
    assert accuracy.cross_m == pytest.approx(np.sqrt(covariances[:, 1, 1]), rel=1e-6)
    assert (accuracy.along_m > accuracy.cross_m).mean() > 0.9  # range is the hard part


@pytest.mark.parametrize(("time_s", "rate_hz"), [(40.0, 1.0), (10.0, 4.0), (1.0, 40.0)])
def test_accuracy_goes_with_the_root_of_the_number_of_epochs(time_s: float, rate_hz: float) -> None:
    design = design_of(90.0, -90.0, 180.0)
    one = predicted_accuracy(design, RANGE, NOISE, time_s=1.0, rate_hz=1.0)
    many = predicted_accuracy(design, RANGE, NOISE, time_s=time_s, rate_hz=rate_hz)
    assert many.along_m == pytest.approx(one.along_m / math.sqrt(40.0), rel=1e-12)
    assert many.cross_m == pytest.approx(one.cross_m / math.sqrt(40.0), rel=1e-12)


@pytest.mark.parametrize(
    "unobserved",
    [
        design_of(90.0),
        design_of(37.0),
        design_of(0.0, 0.0, 0.0),
        design_of(0.0, 180.0),
        np.array([[0.0, 100.0], [0.0, 200.0], [math.pi, 300.0]]),
        design_of(50.0, 50.0, 50.0),
    ],
    ids=["one abeam", "one", "ahead", "on the axis", "along the axis", "all at one point"],
)
def test_what_does_not_observe_the_position_is_infinitely_inaccurate(unobserved: Array) -> None:
    accuracy = predicted_accuracy(unobserved, RANGE, NOISE, time_s=60.0, rate_hz=10.0)
    assert float(accuracy.along_m) == math.inf
    assert float(accuracy.cross_m) == math.inf


def test_among_many_designs_only_the_unobserved_are_infinite() -> None:
    designs = np.stack([design_of(90.0, -90.0), design_of(0.0, 180.0), design_of(60.0, 180.0)])
    accuracy = predicted_accuracy(designs, RANGE, NOISE, time_s=1.0, rate_hz=1.0)
    assert np.isfinite(accuracy.along_m).tolist() == [True, False, False]


def test_it_is_the_cramer_rao_bound_of_an_emitter_at_rest() -> None:
    """From a prior wide open, no motion; in a frame of the map, whatever the line of sight."""
    los, reference, epochs = 2.2, np.array([400.0, -250.0]), 25
    design = design_of(80.0, -95.0, 170.0)
    turn = np.array([[math.cos(los), -math.sin(los)], [math.sin(los), math.cos(los)]])
    wide = 1e6
    bound = CramerRaoBound(np.diag([wide**2, wide**2, 0.0, 0.0]), ConstantVelocity((0.0, 0.0)))
    for _ in range(epochs):
        bound.predict(0.2)
        bound.update(
            reference + turn @ [RANGE, 0.0],
            reference,
            reference + slots_in_los_frame(design) @ turn.T,
            rd_covariance(np.full(3, NOISE.sigma_r_m), NOISE.rho),
            NOISE.sigma_p_m,
        )
    in_los_frame = turn.T @ bound.covariance[:2, :2] @ turn
    accuracy = predicted_accuracy(design, RANGE, NOISE, time_s=5.0, rate_hz=5.0)
    # The prior takes off the share (sigma / wide)², some 1e-9.
    assert np.sqrt(in_los_frame[0, 0]) == pytest.approx(float(accuracy.along_m), rel=1e-6)
    assert np.sqrt(in_los_frame[1, 1]) == pytest.approx(float(accuracy.cross_m), rel=1e-6)


def test_estimates_by_least_squares_scatter_as_predicted() -> None:
    """10,000 trials of RDs averaged over an hour, where one step from the truth is exact.

    A sample variance of n Gaussian errors scatters by sqrt(2/n): 5 sigma is 7 %.
    """
    trials, epochs = 10_000, 36_000
    design = design_of(90.0, -90.0, 180.0)
    slots, emitter, reference = slots_in_los_frame(design), np.array([RANGE, 0.0]), np.zeros(2)
    rng = np.random.default_rng(12)
    scale = 1.0 / math.sqrt(epochs)
    dp_0, dp = rng.normal(0.0, 0.4 * scale, (trials, 2)), rng.normal(0.0, 0.4, (trials, 3, 2))
    common = rng.normal(0.0, math.sqrt(0.3) * 0.7, (trials, 1))
    own = rng.normal(0.0, math.sqrt(0.7) * 0.7, (trials, 3))
    rd = range_differences(emitter, reference, slots) + scale * (common + own)
    measured = reference + dp_0, slots + scale * dp
    residual = rd - range_differences(emitter, *measured)

    toward = emitter - slots
    H = toward / np.linalg.norm(toward, axis=1)[:, None] - np.array([1.0, 0.0])
    weight = np.linalg.inv(covariance(3))
    error = residual @ (np.linalg.inv(H.T @ weight @ H) @ H.T @ weight).T
    accuracy = predicted_accuracy(design, RANGE, NOISE, time_s=3600.0, rate_hz=10.0)
    within = 5.0 * math.sqrt(2.0 / trials)
    assert error[:, 0].var() == pytest.approx(float(accuracy.along_m) ** 2, rel=within)
    assert error[:, 1].var() == pytest.approx(float(accuracy.cross_m) ** 2, rel=within)
