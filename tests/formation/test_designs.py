"""The designs against the paper's equations and under their constraints."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmctl.errors import FormationError
from swarmctl.formation.designs import DESIGNS, perpendicular, uniform
from swarmctl.formation.slots import slot_offsets

ninety = math.pi / 2.0


def test_three_companions_stand_as_in_equation_29_with_the_odd_one_behind() -> None:
    design = perpendicular(3, 300.0, 10.0)
    assert design[:, 0] == pytest.approx([ninety, -ninety, math.pi])
    assert design[:, 1] == pytest.approx([300.0, 300.0, 300.0])


def test_four_companions_stand_as_in_equation_31_spread_by_the_separation() -> None:
    design = perpendicular(4, 300.0, 10.0)
    assert design[:, 0] == pytest.approx([ninety, -ninety, ninety, -ninety])
    assert design[:, 1] == pytest.approx([300.0, 300.0, 290.0, 290.0])


def test_table_1s_uniform_formation() -> None:
    design = uniform(3, 300.0, 10.0)
    assert np.degrees(design[:, 0]) == pytest.approx([-120.0, 0.0, 120.0])


@given(
    name=st.sampled_from(sorted(DESIGNS)),
    companions=st.integers(1, 12),
    los=st.floats(-math.pi, math.pi),
)
def test_slots_keep_the_separation_and_the_range(name: str, companions: int, los: float) -> None:
    offsets = slot_offsets(DESIGNS[name](companions, 285.0, 8.0), los)
    assert np.hypot(*offsets.T).max() <= 285.0 + 1e-9
    swarm = np.vstack((offsets, np.zeros(2)))
    apart = np.hypot(*(swarm[:, None] - swarm[None]).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    assert apart.min() >= 8.0 - 1e-9


@given(companions=st.integers(1, 12))
def test_nobody_stands_nearer_to_the_emitter_than_the_reference(companions: int) -> None:
    # The perpendicular rule keeps all slots at or behind the line through the reference.
    offsets = slot_offsets(perpendicular(companions, 285.0, 8.0), 0.0)
    assert offsets[:, 0].max() <= 1e-9


@pytest.mark.parametrize("name", sorted(DESIGNS))
def test_no_companion_is_no_formation(name: str) -> None:
    with pytest.raises(FormationError, match="at least one companion, not 0"):
        DESIGNS[name](0, 300.0, 10.0)


@pytest.mark.parametrize("name", sorted(DESIGNS))
def test_too_many_for_the_range_names_the_numbers(name: str) -> None:
    with pytest.raises(FormationError, match="12 companions"):
        DESIGNS[name](12, 20.0, 15.0)
