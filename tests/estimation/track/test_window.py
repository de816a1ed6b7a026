"""The most probable trajectory over a window of epochs."""

from __future__ import annotations

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.kernels.augmented import update
from swarmctl.estimation.model.motion import transition
from swarmctl.estimation.model.range_difference import range_differences
from swarmctl.estimation.model.receiver_errors import ReceiverErrors, predict
from swarmctl.estimation.model.rows import Rows, star
from swarmctl.estimation.track.window import Pull, Window
from swarmctl.units import Array
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


def test_the_noise_of_positions_is_averaged_as_all_white_noise_is() -> None:
    run = flight(np.random.default_rng(6), REAL, 15.9)
    window = Window(run.emitter[0], np.eye(4), REAL, np.zeros(2), 0.0, capacity=60)
    for k, rows in enumerate(run.rows):
        window.points.add(rows._replace(position_m=0.4), run.emitter[0], alone=k < 3)
    window.points.without(np.arange(len(window.points.table().rd)) != 4)
    for _ in range(2):
        table = window.points.table()
        np.testing.assert_allclose(
            table.position / np.diagonal(table.white), 0.4**2 / WHITE[0, 0], rtol=1e-9
        )
        window.points.compress(run.emitter[0])
    assert len(table.rd) <= 60


def test_of_positions_white_noise_counts_in_every_block_and_what_lasts_counts_once() -> None:
    """A line that hovers, and how far the noise of its positions tells a place from its mirror."""
    line = np.array([[0.0, 0.0], [0.0, 300.0], [0.0, 150.0], [0.0, -300.0]])
    modes = np.array([[900.0, 400.0, 0.0, 0.0], [-900.0, 400.0, 0.0, 0.0]])
    rd = range_differences(modes[0, :2], line[0], line[1:])
    of_white = 0.5**2 * (np.eye(3) + 1.0)

    def noise(position_m: float, errors: ReceiverErrors, epochs: int) -> float:
        window = Window(np.zeros(4), 1e6 * np.eye(4), errors, np.zeros(2), 0.0, block_s=0.2)
        C = 0.01 * (np.eye(3) + 1.0) + (position_m > 0.0) * of_white
        for k in range(epochs):
            window.points.add(star(0.1 * k, 0, line[0], [1, 2, 3], line[1:], rd, C, position_m))
        contrast = window.contrast(window.fit(modes, 0), 0, 1)
        assert contrast.found == pytest.approx(0.0, abs=1e-3)
        return float(contrast.noise)

    assert noise(0.5, ReceiverErrors(), 40) == pytest.approx(20.0 * noise(0.5, ReceiverErrors(), 2))
    lasting = ReceiverErrors(navigation_m=0.5, navigation_tau_s=1e6)
    # Beside navigation the other noise is small already in one block.
    assert noise(0.0, lasting, 2) == pytest.approx(noise(0.5, ReceiverErrors(), 2), rel=0.05)
    assert noise(0.0, lasting, 40) == pytest.approx(noise(0.0, lasting, 2), rel=0.05)


def test_modes_are_told_apart_by_as_much_as_the_rows_scatter_whatever_they_were_told() -> None:
    """Where no mode fits, that is. Told a third or a twentieth of all noise, all is the same."""
    run = flight(np.random.default_rng(7), ReceiverErrors(), 2.0)
    modes = np.stack([run.emitter[0], run.emitter[0] + [0.0, 30.0, 0.0, 0.0]])
    found, shares = [], []
    for told in (1.0 / 3.0, 1.0 / 20.0):
        window = Window(modes[0], np.eye(4), ReceiverErrors(), np.zeros(2), 0.0)
        for rows in run.rows:
            # So much that it matters between places as near to each other as these.
            window.points.add(
                rows._replace(covariance=told**2 * rows.covariance, position_m=300.0 * told)
            )
        fit = window.fit(modes, 0)
        found.append(window.evidence(fit, 0, 1))
        shares.append(window.contrast(fit, 0, 1).share)
    assert shares[0] < 0.95
    assert shares[1] > 0.99
    assert found[0] < -10.0
    assert found[1] == pytest.approx(found[0], rel=1e-2)


def test_a_window_without_rows_has_no_trajectory() -> None:
    with pytest.raises(EstimationError, match="without measurements"):
        Window(np.zeros(4), np.eye(4), REAL, PSD, 0.0).fit(np.zeros((1, 4)))
