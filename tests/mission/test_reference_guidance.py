"""Where the reference UAV wants to go, before any limit of place or acceleration."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.mission.formation_in_flight import HOLD_RAD, FormationInFlight
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.mission_file_loading import load_mission
from swarmctl.mission.phases import Phase
from swarmctl.mission.reference_guidance import ASIDE_RAD, LEASH_M, RANGE_GUARD, ReferenceGuidance
from swarmctl.mission.target import Target
from tests.missions import DEMO

DT = 0.1
EAST = 2500.0
STARTS = np.array([[0.0, 0.0], [20.0, 0.0], [0.0, 20.0], [0.0, -20.0]])


class Lead:
    """A reference UAV at the origin that leads a formation towards an emitter in the east."""

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.shape = FormationInFlight(mission)
        self.shape.begin(STARTS, np.array([EAST, 0.0]))
        speeds = [mission.limits.max_speed_mps] * len(mission.swarm.vehicles)
        self.guidance = ReferenceGuidance(mission, self.shape, speeds)

    def velocity(
        self, aim: Target, phase: Phase = Phase.APPROACHING, *, worst_error_m: float = 0.0
    ) -> tuple[float, float]:
        return self.guidance.velocity(phase, aim, np.zeros(2), worst_error_m, DT)


@pytest.fixture
def lead() -> Lead:
    return Lead(load_mission(DEMO))


def target(
    east: float = EAST,
    north: float = 0.0,
    *,
    sigma_m: float = 2.0,
    drift: tuple[float, float] = (0.0, 0.0),
    speed_sigma_mps: float = 0.1,
) -> Target:
    covariance = (sigma_m**2, 0.0, sigma_m**2)
    return Target((east, north, 0.0), (*drift, 0.0), sigma_m, speed_sigma_mps, covariance)


def test_it_stands_while_the_formation_forms(lead: Lead) -> None:
    assert lead.velocity(target(), Phase.FORMING) == (0.0, 0.0)


def test_it_flies_straight_to_an_emitter_far_away_at_cruise_speed(lead: Lead) -> None:
    east, north = lead.velocity(target())
    assert east == pytest.approx(lead.mission.limits.cruise_speed_mps, rel=1e-3)
    assert north == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 1.0])
def test_it_slows_down_as_the_worst_slot_error_grows(lead: Lead, share: float) -> None:
    slack, stop = LEASH_M
    full = lead.velocity(target())
    waits = lead.velocity(target(), worst_error_m=stop - share * (stop - slack))
    assert waits == pytest.approx((share * full[0], share * full[1]), abs=1e-9)


def test_no_error_however_large_turns_it_back(lead: Lead) -> None:
    assert lead.velocity(target(), worst_error_m=1000.0) == (0.0, 0.0)
    assert lead.velocity(target(), worst_error_m=0.0) == lead.velocity(
        target(), worst_error_m=LEASH_M[0]
    )


def test_it_waits_for_a_formation_that_faces_another_way(lead: Lead) -> None:
    def speed(aside_rad: float, sigma_m: float = 2.0) -> float:
        aim = target(EAST * math.cos(aside_rad), EAST * math.sin(aside_rad), sigma_m=sigma_m)
        return math.hypot(*lead.velocity(aim))

    slack, stop = ASIDE_RAD
    assert speed(slack - 0.01) == pytest.approx(speed(0.0))
    assert speed(0.5 * (slack + stop)) == pytest.approx(0.5 * speed(0.0), rel=1e-6)
    assert speed(stop + 0.01) == 0.0
    # Nobody turns after a line of sight that is not known, so there is nothing to wait for.
    assert speed(stop + 0.01, 1.01 * HOLD_RAD * EAST) > 0.0


def test_it_comes_no_nearer_than_the_estimate_is_sharp(lead: Lead) -> None:
    """On the wider circle it goes round; with a sharp estimate it goes on inwards."""
    away = 2.0 * lead.shape.orbit_m
    inwards, _ = lead.velocity(target(away))
    assert inwards > 0.5 * lead.mission.limits.cruise_speed_mps
    inwards, across = lead.velocity(target(away, sigma_m=away / RANGE_GUARD))
    assert inwards == pytest.approx(0.0, abs=0.1)
    assert abs(across) > 1.0
    # Nor does it retreat from an estimate that is blunter still.
    inwards, _ = lead.velocity(target(away, sigma_m=away))
    assert inwards == pytest.approx(0.0, abs=0.1)


def test_the_orbit_moves_with_an_emitter_whose_velocity_is_trusted(lead: Lead) -> None:
    radius = lead.shape.orbit_m
    still = lead.velocity(target(radius), Phase.ORBITING)
    drifting = lead.velocity(target(radius, drift=(2.0, 0.0)), Phase.ORBITING)
    doubtful = lead.velocity(target(radius, drift=(2.0, 0.0), speed_sigma_mps=5.0), Phase.ORBITING)
    assert still[0] == pytest.approx(0.0, abs=0.1)
    assert drifting[0] == pytest.approx(2.0, abs=0.1)
    assert doubtful == still
