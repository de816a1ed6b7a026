"""The rows of an epoch: where their receivers were, and how their noise covaries."""

from __future__ import annotations

import numpy as np
import pytest

from swarmctl.datasets.pair_covariance import pair_covariance, rows_of
from swarmctl.datasets.reading import Epoch, Measurement, ReceiverPositions, Trajectory

TIMES = np.array([0.0, 2.0])
MOVING = ReceiverPositions(
    ("A", "B"),
    (
        Trajectory(TIMES, np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 2.0]])),
        Trajectory(TIMES, np.array([[10.0, 0.0, 0.0], [10.0, 6.0, 0.0]])),
    ),
)


def test_rows_have_the_receivers_positions_at_their_epoch() -> None:
    rows, left_out = rows_of(Epoch(0.5, (Measurement(1, 0, 1.0, 0.7),)), MOVING, 0.5)
    assert rows is not None
    assert left_out == 0
    assert rows.first_at.tolist() == [[10.0, 1.5, 0.0]]
    assert rows.second_at.tolist() == [[1.0, 0.0, 0.5]]
    assert rows.covariance == pytest.approx(np.array([[0.49]]))


@pytest.mark.parametrize("time_s", [-0.1, 2.1])
def test_measurements_without_a_receivers_position_are_left_out_and_counted(time_s: float) -> None:
    assert rows_of(Epoch(time_s, (Measurement(0, 1, 1.0, 0.3),)), MOVING, 0.5) == (None, 1)


@pytest.mark.parametrize("rho", [0.0, 0.2, 0.5])
def test_pairs_covary_by_the_receivers_they_share(rho: float) -> None:
    """sigma² [rho (d_ac - d_ad - d_bc + d_bd) + (1 - 2 rho) d_same], entry by entry."""
    pairs = [(0, 1), (0, 2), (3, 0), (2, 4), (5, 6)]
    found = pair_covariance([a for a, _ in pairs], [b for _, b in pairs], np.full(5, 0.6), rho)
    for row, (a, b) in enumerate(pairs):
        for column, (c, d) in enumerate(pairs):
            shared = (a == c) - (a == d) - (b == c) + (b == d)
            expected = 0.36 * (rho * shared + (1.0 - 2.0 * rho) * (row == column))
            assert found[row, column] == pytest.approx(expected), (row, column)


def test_one_sigma_per_row_is_that_row_s_own() -> None:
    found = pair_covariance([0, 0], [1, 2], np.array([0.5, 2.0]))
    assert found == pytest.approx(np.array([[0.25, 0.5], [0.5, 4.0]]))


def test_pairs_that_close_a_loop_have_a_covariance_that_is_one() -> None:
    found = pair_covariance([0, 1, 0], [1, 2, 2], np.full(3, 0.5))
    assert np.linalg.eigvalsh(found).min() > 1e-3 * 0.25
    assert np.diag(found) == pytest.approx(np.full(3, 0.25))
