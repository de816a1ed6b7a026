"""Slots in space and who takes them."""

import itertools
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmctl.errors import FormationError
from swarmctl.formation.slots import assign, level_design


def test_levelled_slots_keep_their_distance_in_three_dimensions() -> None:
    design = np.array([[0.3, 285.0], [-0.4, 200.0]])
    heights = np.array([36.0, -24.0])
    level = level_design(design, heights)
    assert np.hypot(level[:, 1], heights) == pytest.approx(design[:, 1])


def test_a_slot_that_is_too_high_is_refused() -> None:
    with pytest.raises(FormationError, match="a slot 30 m from the reference cannot be flown 36 m"):
        level_design(np.array([[0.0, 30.0]]), np.array([36.0]))


points = st.lists(
    st.tuples(st.floats(-300, 300), st.floats(-300, 300)), min_size=4, max_size=4, unique=True
)


@given(positions=points, slots=points)
def test_the_assignment_has_the_least_squared_path(
    positions: list[tuple[float, float]], slots: list[tuple[float, float]]
) -> None:
    p, s = np.array(positions), np.array(slots)
    taken = assign(p, s)
    assert sorted(taken) == [0, 1, 2, 3]

    def cost(order: Sequence[int]) -> float:
        return float(((p - s[list(order)]) ** 2).sum())

    best = min(cost(order) for order in itertools.permutations(range(4)))
    assert cost(taken) == pytest.approx(best)
