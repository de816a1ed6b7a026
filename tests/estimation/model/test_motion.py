"""The constant-velocity and the constant-acceleration model."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given
from hypothesis import strategies as st

from swarmctl.errors import EstimationError
from swarmctl.estimation.model.motion import (
    ConstantAcceleration,
    ConstantVelocity,
    Motion,
    predict,
    process_noise,
    transition,
    transport,
)

PSD = np.array([0.04, 0.09, 0.0])


def some_state(rng: np.random.Generator, *batch: int) -> tuple[np.ndarray, np.ndarray]:
    root = rng.normal(0.0, 5.0, (*batch, 6, 6))
    return rng.normal(0.0, 100.0, (*batch, 6)), root @ np.swapaxes(root, -1, -2)


def test_prediction_agrees_with_filterpy() -> None:
    x, P = some_state(np.random.default_rng(3))
    judge = KalmanFilter(dim_x=6, dim_z=3)
    judge.x, judge.P = x.copy(), P.copy()
    judge.F, judge.Q = transition(0.7, 3), process_noise(0.7, PSD)
    judge.predict()
    x, P = predict(x, P, 0.7, PSD)
    np.testing.assert_allclose(x, judge.x, rtol=1e-9)
    np.testing.assert_allclose(P, judge.P, rtol=1e-9)


def test_two_steps_are_one_long_one() -> None:
    """Holds only for the exact integral of the white acceleration."""
    x, P = some_state(np.random.default_rng(4))
    twice = predict(*predict(x, P, 0.3, PSD), 1.1, PSD)
    once = predict(x, P, 1.4, PSD)
    np.testing.assert_allclose(twice[0], once[0], rtol=1e-12)
    np.testing.assert_allclose(twice[1], once[1], rtol=1e-12)


def test_the_velocity_walks_by_the_root_of_the_density_each_second() -> None:
    Q = process_noise(1.0, PSD)
    np.testing.assert_allclose(np.diag(Q), [*(PSD / 3.0), *PSD])


def test_transport_there_and_back_changes_nothing() -> None:
    x, P = some_state(np.random.default_rng(5))
    back = transport(*transport(x, P, 4.0), -4.0)
    np.testing.assert_allclose(back[0], x, rtol=1e-12)
    np.testing.assert_allclose(back[1], P, rtol=1e-9)


def test_a_batch_is_a_loop() -> None:
    x, P = some_state(np.random.default_rng(6), 3, 2)
    batch_x, batch_P = predict(x, P, 0.4, PSD)
    for i in np.ndindex(3, 2):
        one_x, one_P = predict(x[i], P[i], 0.4, PSD)
        np.testing.assert_allclose(batch_x[i], one_x, rtol=1e-13)
        np.testing.assert_allclose(batch_P[i], one_P, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("dt", "psd", "message"),
    [
        (-0.1, [0.0, 0.0], "dt must be"),
        (np.nan, [0.0, 0.0], "dt must be"),
        (0.1, [0.0, -1.0], "process noise must be"),
        (0.1, [0.0, np.nan], "process noise must be"),
        (0.1, [[0.0, 0.1]], "process noise must be"),
    ],
)
def test_a_step_that_cannot_be_is_refused(dt: float, psd: list[float], message: str) -> None:
    with pytest.raises(EstimationError, match=message):
        process_noise(dt, np.array(psd))


# --- Models as objects -----------------------------------------------------------------


def test_constant_velocity_is_the_functions() -> None:
    model: Motion = ConstantVelocity(PSD.tolist())
    F, Q = model.step(0.7)
    assert model.size == 6
    np.testing.assert_array_equal(F, transition(0.7, 3))
    np.testing.assert_array_equal(Q, process_noise(0.7, PSD))


@pytest.mark.parametrize("dt", [0.02, 0.7])
def test_constant_acceleration_is_equation_7_with_table_1_s_noise(dt: float) -> None:
    """Q is in the acceleration alone, and the same for a short step and a long one."""
    model: Motion = ConstantAcceleration((0.01, 0.02))
    F, Q = model.step(dt)
    one, none = np.eye(2), np.zeros((2, 2))
    assert model.size == 6
    np.testing.assert_allclose(
        F,
        np.block([[one, dt * one, dt**2 / 2 * one], [none, one, dt * one], [none, none, one]]),
        rtol=1e-15,
    )
    np.testing.assert_array_equal(Q, np.diag([0.0, 0.0, 0.0, 0.0, 0.01, 0.02]))


@given(
    a=st.floats(-100.0, 100.0),
    b=st.floats(-100.0, 100.0),
    axes=st.integers(1, 4),
    order=st.integers(1, 4),
)
def test_two_transitions_are_one_over_the_sum(a: float, b: float, axes: int, order: int) -> None:
    both = transition(a, axes, order) @ transition(b, axes, order)
    # Rounding is relative to the terms added up, not to what cancels.
    bound = transition(abs(a), axes, order) @ transition(abs(b), axes, order)
    assert (np.abs(both - transition(a + b, axes, order)) <= 1e-14 * bound + 1e-300).all()


@pytest.mark.parametrize(
    ("model", "name"), [(ConstantVelocity, "process noise"), (ConstantAcceleration, "variance")]
)
def test_a_model_that_cannot_be_is_refused(
    model: type[ConstantVelocity] | type[ConstantAcceleration], name: str
) -> None:
    for values in ([0.1, -0.1], [0.1, np.nan], [np.inf, 0.1], []):
        with pytest.raises(EstimationError, match=f"{name} must be"):
            model(values)
    for dt in (-0.1, np.nan, np.inf):
        with pytest.raises(EstimationError, match="dt must be"):
            model((0.1, 0.1)).step(dt)
