"""Epochs averaged into blocks."""

from __future__ import annotations

import numpy as np
import pytest

from swarmctl.estimation.model.range_difference import range_differences
from swarmctl.estimation.model.rows import Rows, star
from swarmctl.estimation.track.window_blocks import NormalPoints
from swarmctl.units import Array

EMITTER = np.array([0.0, 0.0, 12.0, 5.0])
SLOTS = np.array([[0.0, 0.0], [300.0, 0.0], [0.0, 300.0], [-300.0, 0.0]])
"""The reference UAV and three companions."""


def at(time_s: float) -> Array:
    """Where the receivers are, flying past the emitter at 600 m."""
    places: Array = np.array([-600.0, -200.0]) + np.array([0.0, 40.0]) * time_s + SLOTS
    return places


def rds(time_s: float) -> Array:
    """Exact range differences."""
    receivers = at(time_s)
    return range_differences(EMITTER[:2] + time_s * EMITTER[2:], receivers[0], receivers[1:])


def epoch(time_s: float) -> Rows:
    """What is heard at a time."""
    receivers = at(time_s)
    return star(time_s, 0, receivers[0], [1, 2, 3], receivers[1:], rds(time_s), np.eye(3))


def test_a_geometry_that_bends_within_a_block_leaves_no_error_in_it() -> None:
    blunt, sharp = (NormalPoints(2, 0.0, 10.0, 100) for _ in range(2))
    for k in range(20):
        blunt.add(epoch(0.5 * k))
        sharp.add(epoch(0.5 * k), EMITTER)
    table = sharp.table()
    np.testing.assert_allclose(table.time, 4.75)
    np.testing.assert_allclose(table.span, 10.0)
    np.testing.assert_allclose(table.at[1], at(4.75)[1:])
    np.testing.assert_allclose(table.rd, rds(4.75), atol=1e-9)
    np.testing.assert_allclose(table.white, np.eye(3) / 20.0)
    assert np.abs(blunt.table().rd - rds(4.75)).max() > 1.0


def test_merged_blocks_are_averaged_about_the_same_trajectory() -> None:
    points = NormalPoints(2, 0.0, 2.0, 9)
    elsewhere = EMITTER + np.array([50.0, -30.0, 1.0, 2.0])
    for k in range(20):
        points.add(epoch(0.5 * k), elsewhere)
    assert points.table().time.size == 15
    points.compress(EMITTER)
    table = points.table()
    assert table.time.size <= 9
    assert points.measurements == 60
    assert np.unique(table.block).size == table.time.size / 3
    for row, time_s in enumerate(table.time.tolist()):
        # Within 2 s about a trajectory some 60 m off, the geometry bends by decimetres.
        assert table.rd[row] == pytest.approx(rds(time_s)[row % 3], abs=0.2)


def test_rows_of_each_pair_stand_where_its_receivers_do() -> None:
    points = NormalPoints(2, 0.0, 1.0, 100)
    points.add(epoch(0.0)._replace(first=[7, 7, 7], second=[5, 9, 2]))
    points.add(epoch(0.5)._replace(first=[5, 7, 7], second=[9, 9, 2]))
    assert points.receivers == [7, 5, 9, 2]
    table = points.table()
    np.testing.assert_array_equal(
        table.signs, [[-1, -1, -1, 0], [1, 0, 0, -1], [0, 1, 0, 1], [0, 0, 1, 0]]
    )
    np.testing.assert_allclose(table.time, [0.0, 0.25, 0.25, 0.5])
    np.testing.assert_allclose(np.diag(table.white), [1.0, 0.5, 0.5, 1.0])
