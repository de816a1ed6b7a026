"""The constant-velocity model."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from swarmctl.errors import EstimationError
from swarmctl.estimation.motion import predict, process_noise, transition, transport

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
