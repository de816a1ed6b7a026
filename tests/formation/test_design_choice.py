"""Designs chosen in flight: by range, by how sure the line of sight is, with hysteresis."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.formation.design_choice import STEP, SURE_RAD, UNSURE_RAD, DesignChoice, least_range
from swarmctl.units import Array

D_M = 285.0


class Maker:
    """Ends at arccos(d/R), or at 90° if the line of sight is unsure; notes the ranges."""

    def __init__(self) -> None:
        self.made: list[float] = []
        self.made_unsure: list[float] = []

    def sure(self, range_m: float) -> Array:
        self.made.append(range_m)
        return leaning(math.acos(D_M / range_m))

    def unsure(self, range_m: float) -> Array:
        self.made_unsure.append(range_m)
        return leaning(math.pi / 2.0)


def leaning(theta_rad: float) -> Array:
    return np.array([[theta_rad, D_M], [-theta_rad, D_M], [math.pi, D_M]])


def book(maker: Maker, *, nearest_m: float = 430.0, stand_off_m: float = 412.5) -> DesignChoice:
    return DesignChoice(
        maker.sure,
        maker.unsure,
        first_m=430.0,
        farthest_m=2500.0,
        nearest_m=nearest_m,
        stand_off_m=stand_off_m,
    )


def made_for(design: Array) -> float:
    """Range a (sure) design was made for, m."""
    return D_M / math.cos(design[0, 0])


def test_the_design_is_made_for_about_the_range_it_is_flown_at() -> None:
    designs = book(Maker(), stand_off_m=0.0)
    for range_m in np.geomspace(2500.0, 430.0, 200):
        ratio = made_for(designs.choose(float(range_m), 0.0)) / range_m
        # Half a step and the hysteresis, either way.
        assert STEP**-0.81 < ratio < STEP**0.81


def test_an_estimate_that_wavers_does_not_change_the_design() -> None:
    designs = book(Maker(), stand_off_m=0.0)
    first = designs.choose(1000.0, 0.0)
    rng = np.random.default_rng(1)
    middle = made_for(first)
    for wobble in rng.uniform(-0.75, 0.75, 500):
        assert designs.choose(middle * STEP**wobble, 0.0) is first
    assert designs.choose(middle * STEP**0.9, 0.0) is not first


def test_an_unsure_line_of_sight_has_a_design_of_its_own_until_it_is_sure() -> None:
    designs = book(Maker())
    nominal = designs.choose(2500.0, 0.0)
    between = 0.5 * (SURE_RAD + UNSURE_RAD)
    assert designs.choose(2500.0, between) is nominal
    wide = designs.choose(2500.0, 1.01 * UNSURE_RAD)
    assert wide[0, 0] == math.pi / 2.0
    assert designs.choose(2500.0, between) is wide
    assert designs.choose(2500.0, 0.99 * SURE_RAD) is nominal


def nearest(design: Array, range_m: float) -> float:
    """Distance of the nearest slot to the emitter, m."""
    along, cross = design[:, 1] * np.cos(design[:, 0]), design[:, 1] * np.sin(design[:, 0])
    return float(np.hypot(along - range_m, cross).min())


def test_no_design_comes_nearer_to_the_emitter_than_the_stand_off() -> None:
    """On the orbit the ends of the best design would stand at sqrt(R² - d²), 322 m."""
    maker = Maker()
    designs = book(maker)
    assert nearest(maker.sure(430.0), 430.0) == pytest.approx(math.sqrt(430.0**2 - D_M**2))
    assert designs.orbit_m == 430.0
    for range_m in (2500.0, 1000.0, 600.0, 430.0, 100.0):
        assert nearest(designs.choose(range_m, 0.0), 430.0) >= 412.5


def test_a_formation_with_a_slot_ahead_orbits_farther_off() -> None:
    ahead = np.array([[0.0, D_M], [2.0, D_M], [-2.0, D_M]])
    designs = DesignChoice(
        lambda range_m: ahead,
        lambda range_m: leaning(0.0),
        first_m=430.0,
        farthest_m=2500.0,
        nearest_m=430.0,
        stand_off_m=412.5,
    )
    assert designs.orbit_m == pytest.approx(412.5 + D_M)
    assert nearest(ahead, designs.orbit_m) == pytest.approx(412.5)
    assert least_range(ahead[1:], 412.5) < 430.0
    # And as far off as the design that is flown asks for.
    ahead[:, 0] = math.pi
    assert designs.orbit_m == 430.0
    designs.choose(2500.0, 1.0)
    assert designs.orbit_m == pytest.approx(412.5 + D_M)


def test_the_pages_are_made_before_the_flight_and_the_unsure_one_once() -> None:
    maker = Maker()
    designs = book(maker)
    made = len(maker.made)
    for range_m in np.linspace(3000.0, 300.0, 100):
        designs.choose(float(range_m), 0.0)
    assert maker.made_unsure == []
    for range_m in np.linspace(3000.0, 300.0, 100):
        designs.choose(float(range_m), 1.0)
    assert len(maker.made) == made
    assert maker.made_unsure == [maker.made[-1]]
