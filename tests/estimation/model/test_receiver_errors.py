"""The receivers' errors in time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.model.motion import process_noise, transition
from swarmctl.estimation.model.receiver_errors import ReceiverErrors, predict

ALL = ReceiverErrors(9.0, 0.3, 1.5, 60.0, 0.4, 0.5)


@pytest.mark.parametrize("d", [2, 3])
def test_a_step_is_that_of_the_matrices_written_out(d: int) -> None:
    dt, psd = 0.7, np.arange(1.0, d + 1.0)
    layout = ALL.layout(d)
    n = 2 * d + 2 * layout.size
    F, Q = np.zeros((n, n)), np.zeros((n, n))
    F[: 2 * d, : 2 * d] = transition(dt, d)
    Q[: 2 * d, : 2 * d] = process_noise(dt, psd)
    navigation, colour = math.exp(-dt / 60.0), math.exp(-dt / 0.5)
    for k in range(2 * d, n, layout.size):
        own = slice(k, k + layout.size)
        F[own, own] = np.diag([1.0, 1.0, *[navigation] * d, colour])
        F[k, k + 1] = dt
        fresh = [0.0, 0.0, *[1.5**2 * (1 - navigation**2)] * d, 0.4**2 * (1 - colour**2)]
        Q[own, own] = np.diag(fresh)
    rng = np.random.default_rng(0)
    x, root = rng.standard_normal(n), rng.standard_normal((n, n))
    P = root @ root.T
    found_x, found_P = predict(x, P, dt, psd, ALL, layout)
    np.testing.assert_allclose(found_x, F @ x, rtol=1e-12)
    np.testing.assert_allclose(found_P, F @ P @ F.T + Q, rtol=1e-10, atol=1e-10)
    assert ALL.variance(d).size == layout.size


def test_parts_without_a_sigma_take_no_states() -> None:
    assert ReceiverErrors().layout(3).size == 0
    layout = ReceiverErrors(navigation_m=1.0, colour_m=0.1).layout(2)
    assert (layout.bias, layout.navigation, layout.colour, layout.size) == (None, 0, 2, 3)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"bias_m": -1.0}, "bias_m"),
        ({"navigation_m": math.nan}, "navigation_m"),
        ({"colour_tau_s": 0.0}, "colour_tau_s"),
        ({"drift_mps": 1.0}, "drifts"),
    ],
)
def test_a_model_that_cannot_be_is_refused(wrong: dict[str, float], named: str) -> None:
    with pytest.raises(EstimationError, match=named):
        ReceiverErrors(**wrong)
