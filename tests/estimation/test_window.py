"""The most probable trajectory over a window of epochs."""

from __future__ import annotations

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import Array
from swarmctl.estimation.augmented import Rows, star, update
from swarmctl.estimation.motion import transition
from swarmctl.estimation.nuisance import ReceiverErrors, predict
from swarmctl.estimation.rd_model import range_differences
from swarmctl.estimation.window import Pull, Window
from tests.estimation.receivers import REAL, WHITE, flight

ALL = ReceiverErrors(9.0, 0.3, 1.5, 60.0, 0.4, 0.5)
PSD = np.array([50.0, 20.0])
NARROW = np.diag([1.0, 1.0, 0.2, 0.2])
"""So narrow a prior that lines of sight do not turn over it: all is linear."""


def filtered(rows: list[Rows], mean: Array, errors: ReceiverErrors) -> tuple[Array, Array]:
    """The state after all rows by the Kalman filter, receivers in the order 0, 1, 2, 3."""
    layout = errors.layout(2)
    places = {r: 4 + r * layout.size for r in range(4)}
    x: Array = np.concatenate([mean, np.zeros(4 * layout.size)])
    P: Array = np.zeros((x.size, x.size))
    P[:4, :4] = NARROW
    P[4:, 4:] = np.diag(np.tile(errors.variance(2), 4))
    for k, epoch in enumerate(rows):
        if k:
            dt = epoch.epoch_s - rows[k - 1].epoch_s
            x, P = predict(x, P, dt, PSD, errors, layout)
        x, P, _ = update(x, P, epoch, places, layout)
    return x, P


@pytest.mark.parametrize(
    "errors",
    [
        ReceiverErrors(bias_m=9.0),
        ReceiverErrors(bias_m=9.0, drift_mps=0.3),
        ReceiverErrors(navigation_m=1.5, navigation_tau_s=2.0),
        ReceiverErrors(colour_m=0.4, colour_tau_s=0.5),
        ALL,
    ],
)
def test_where_all_is_linear_it_is_the_kalman_filter(errors: ReceiverErrors) -> None:
    run = flight(np.random.default_rng(3), errors, 2.0)
    mean = run.emitter[0] + [0.7, -0.5, 0.1, 0.2]
    window = Window(mean, NARROW, errors, PSD, 0.0, block_s=0.01)
    for rows in run.rows:
        window.points.add(rows)
    fit = window.fit(mean[None])
    assert window.points.receivers == [0, 1, 2, 3]
    x, P = window.condense(fit, 0, run.rows[-1].epoch_s)
    wanted_x, wanted_P = filtered(run.rows, mean, errors)
    sigma = np.sqrt(np.diag(wanted_P))
    assert np.abs((x - wanted_x) / sigma).max() < 1e-2
    assert np.abs((P - wanted_P) / np.outer(sigma, sigma)).max() < 1e-2


def test_epochs_averaged_into_blocks_tell_the_same() -> None:
    run = flight(np.random.default_rng(4), REAL, 15.9)
    prior = np.diag([666.0**2, 666.0**2, 200.0**2, 200.0**2])
    found = []
    for block_s, capacity in ((0.01, 1000), (0.5, 1000), (0.5, 60)):
        window = Window(
            run.emitter[0], prior, REAL, np.zeros(2), 0.0, block_s=block_s, capacity=capacity
        )
        for rows in run.rows:
            window.points.add(rows, run.emitter[0] + [30.0, 20.0, 1.0, 1.0])
        window.points.compress(run.emitter[0])
        fit = window.fit(run.emitter[:1], 10)
        if capacity < 1000:
            assert fit.residual.shape[1] <= capacity
        found.append(window.condense(fit, 0, run.rows[-1].epoch_s))
    sigma = np.sqrt(np.diag(found[0][1])[:2])
    for x, P in found[1:]:
        assert np.abs((x - found[0][0])[:2] / sigma).max() < 0.3
        np.testing.assert_allclose(np.sqrt(np.diag(P)[:2]), sigma, rtol=0.1)


def test_a_window_that_grows_goes_on_where_it_was() -> None:
    """Around an emitter whose walk takes it a range away from any straight line."""
    rng = np.random.default_rng(8)
    psd = np.array([20.0, 20.0])
    step = np.kron([[1.0 / 3.0, 1.0 / 2.0], [1.0 / 2.0, 1.0]], np.diag(psd))
    root = np.linalg.cholesky(step)
    emitter = np.array([0.0, 0.0, 5.0, 0.0])
    window = Window(emitter, np.diag([1e4, 1e4, 1e2, 1e2]), ReceiverErrors(), psd, 0.0)
    theta, pull = emitter[None], Pull(np.zeros(0), np.zeros((1, 0, 2)))
    slots = 300.0 * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    for k in range(60):
        at = emitter[:2] + 1500.0 * np.array([np.cos(0.02 * k), np.sin(0.02 * k)]) + slots
        rd = range_differences(emitter[:2], at[0], at[1:])
        rd = rd + np.linalg.cholesky(WHITE) @ rng.standard_normal(3)
        window.points.add(star(float(k), 0, at[0], [1, 2, 3], at[1:], rd, WHITE), theta[0])
        fit = window.fit(theta, 3, pull)
        theta, pull = fit.theta, window.pull(fit)
        emitter = transition(1.0, 2) @ emitter + root @ rng.standard_normal(4)
    strayed = float(np.linalg.norm(fit.bend[0, -1]))
    assert strayed > 1000.0
    thoroughly = window.fit(theta, 50, pull)
    off = thoroughly.theta[0] - theta[0]
    assert off @ fit.information[0] @ off < 0.1**2
    assert np.linalg.norm(thoroughly.bend - fit.bend, axis=-1).max() < 0.01 * 1500.0
    # The line and its bend end where the state is.
    x, _ = window.condense(thoroughly, 0, 59.0)
    end: Array = transition(59.0, 2)[:2] @ thoroughly.theta[0] + thoroughly.bend[0, -1]
    np.testing.assert_allclose(x[:2], end, atol=0.01 * strayed)
    # No step is needed to be there, and a straight line is not.
    assert window.fit(theta, 0, pull).objective[0] < thoroughly.objective[0] + 0.01
    assert window.fit(theta, 3).objective[0] > thoroughly.objective[0] + 1.0


def test_the_worst_row_is_the_echo_and_can_be_dropped() -> None:
    run = flight(np.random.default_rng(5), REAL, 0.7)
    echo = run.rows[4]._replace(rd=run.rows[4].rd + np.array([0.0, 60.0, 0.0]))
    prior = np.diag([600.0**2, 600.0**2, 200.0**2, 200.0**2])
    window = Window(run.emitter[0], prior, REAL, np.zeros(2), 0.0)
    for k, rows in enumerate(run.rows):
        window.points.add(echo if k == 4 else rows, alone=True)
    fit = window.fit(run.emitter[:1], 20)
    row, sigmas = window.worst(fit, 0)
    assert row == 4 * 3 + 1
    assert sigmas > 30.0
    window.points.without(np.arange(24) != row)
    assert window.points.measurements == 23
    # The greatest of 23 unit normal numbers exceeds 4.5 once in 6000 times.
    assert window.worst(window.fit(fit.theta, 20), 0)[1] < 4.5


@pytest.mark.parametrize(("last_s", "stretched"), [(162.0, False), (164.0, True)])
def test_a_walk_that_bends_the_line_within_a_block_ends_the_window(
    last_s: float, stretched: bool
) -> None:
    window = Window(np.zeros(4), np.eye(4), REAL, np.array([0.03, 0.0]), 100.0, block_s=100.0)
    rows = flight(np.random.default_rng(0), REAL, 0.1).rows[0]
    for epoch_s in np.linspace(100.0, last_s, 1000).tolist():
        window.points.add(rows._replace(epoch_s=epoch_s))
    # sqrt(0.03 t³ / 3) = 0.1 t^1.5: 50 m after 63 s, 5 % of a kilometre.
    assert window.is_stretched(1000.0) == stretched


def test_a_window_without_rows_has_no_trajectory() -> None:
    with pytest.raises(EstimationError, match="without measurements"):
        Window(np.zeros(4), np.eye(4), REAL, PSD, 0.0).fit(np.zeros((1, 4)))
