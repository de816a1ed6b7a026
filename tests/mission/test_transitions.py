"""Seeded transitions of the formation, vehicles that lag and wind that pushes them.

``TRANSITIONS=100 pytest tests/mission/test_transitions.py`` flies more of them.
"""

from __future__ import annotations

import math
import os

import numpy as np
import pytest

from swarmctl.mission.loading import parse_mission
from swarmctl.mission.phases import Phase
from swarmctl.mission.planner import Planned, Planner, Target
from tests.missions import short_mission_text

RUNS = int(os.environ.get("TRANSITIONS", "15"))
DT = 0.1
LAG_S = 0.4
"""A vehicle's first-order lag behind its planned position and velocity."""
GUST_M, GUST_TAU_S = 0.7, 4.0
"""1-sigma and time constant of the wind's displacement, per axis."""


class Swarm:
    """Vehicles that follow a planner, and the least they kept of every limit."""

    def __init__(self, seed: int, step_m: float = 9.0) -> None:
        self.rng = np.random.default_rng(seed)
        n = int(self.rng.integers(3, 13))
        vehicles = [{"sysid": 1 + i, "altitude_amsl_m": 30 + step_m * i} for i in range(n + 1)]
        self.mission = parse_mission(
            short_mission_text(
                swarm__vehicles=vehicles,
                swarm__reference=int(self.rng.integers(1, n + 2)),
                limits__d_max_m=300,
                limits__ceiling_amsl_m=200,
            )
        )
        self.reference = self.mission.swarm.reference - 1
        spread = self.rng.permutation(n + 1)
        self.here = np.column_stack((20.0 * spread, np.zeros(n + 1)))
        self.gust = np.zeros_like(self.here)
        self.planner = Planner(self.mission)
        self.lost: list[int] = []
        self.least_separation = math.inf
        self.farthest = 0.0
        self.formed = False
        bearing = self.rng.uniform(-math.pi, math.pi)
        self.emitter = 2000.0 * np.array([math.cos(bearing), math.sin(bearing)])
        self.planner.begin(self.here, self.target())

    def target(self, sigma_m: float = 30.0) -> Target:
        covariance = (sigma_m**2, 0.0, sigma_m**2)
        east, north = self.emitter.tolist()
        return Target((east, north, 0.0), (0.0, 0.0, 0.0), sigma_m, 0.1, covariance)

    def fly(self, seconds: float, phase: Phase, sigma_m: float = 30.0) -> Planned:
        """Plan and follow; every limit is looked at every period."""
        for _ in range(round(seconds / DT)):
            plan = self.planner.step(phase, self.target(sigma_m), self.worst(), self.here, DT)
            kick = self.rng.standard_normal(self.gust.shape)
            self.gust += -self.gust * DT / GUST_TAU_S + kick * GUST_M * math.sqrt(
                2 * DT / GUST_TAU_S
            )
            ahead = plan.positions[:, :2] + LAG_S * plan.velocities[:, :2]
            self.here += (ahead + self.gust - self.here) * DT / LAG_S
            self.slots = plan.slots
            self.look(plan)
        return plan

    def worst(self) -> float:
        """Greatest slot error of those in the formation, m."""
        members = list(self.planner.companions)
        slots = getattr(self, "slots", None)
        if slots is None:
            return 0.0
        return float(np.linalg.norm(slots[members, :2] - self.here[members], axis=1).max())

    def look(self, plan: Planned) -> None:
        present = [i for i in range(len(self.here)) if i not in self.lost]
        space = np.column_stack((self.here, plan.positions[:, 2]))[present]
        gaps = np.linalg.norm(space[:, None] - space[None], axis=-1)
        self.least_separation = min(
            self.least_separation, gaps[np.triu_indices(len(gaps), 1)].min()
        )
        if self.formed:
            reach = gaps[present.index(self.reference)]
            reach[[present.index(i) for i in self.planner.returning]] = 0.0
            self.farthest = max(self.farthest, float(reach.max()))


def turned(vector: np.ndarray, angle_rad: float) -> np.ndarray:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    result: np.ndarray = np.array([[c, -s], [s, c]]) @ vector
    return result


@pytest.mark.parametrize(
    ("seed", "step_m"),
    [(seed, 9.0) for seed in range(RUNS)] + [(seed, 0.0) for seed in range(0, RUNS, 3)],
)
def test_no_transition_breaks_a_limit(seed: int, step_m: float) -> None:
    """Forming up, a new estimate, a lost companion and its return, flown in a random order.

    With altitudes all different, and all the same.
    """
    swarm = Swarm(seed, step_m)
    limits = swarm.mission.limits
    swarm.fly(90.0, Phase.FORMING)
    assert swarm.worst() < 3.0, "it has formed up"
    swarm.formed = True
    for event in swarm.rng.permutation(["jump", "turn", "lose", "unsure", "near"]):
        if event == "jump":
            swarm.emitter = swarm.emitter + swarm.rng.normal(0.0, 200.0, 2)
        elif event == "turn":
            away = swarm.emitter - swarm.here[swarm.reference]
            swarm.emitter = swarm.here[swarm.reference] + turned(away, swarm.rng.uniform(1.8, 3.1))
        elif event == "lose" and len(swarm.planner.companions) > 2:
            gone = int(swarm.rng.choice(swarm.planner.companions))
            swarm.planner.drop(gone)
            swarm.lost.append(gone)
            swarm.fly(30.0, Phase.APPROACHING)
            swarm.planner.add(gone, swarm.here[gone])
            swarm.lost.remove(gone)
            swarm.fly(90.0, Phase.APPROACHING)
            assert not swarm.planner.returning
        swarm.fly(25.0, Phase.APPROACHING, sigma_m=900.0 if event == "unsure" else 30.0)
    assert swarm.least_separation >= limits.min_separation_m
    assert swarm.farthest <= limits.d_max_m


@pytest.mark.parametrize("seed", range(RUNS))
def test_nobody_swaps_slots_for_a_wavering_estimate(seed: int) -> None:
    swarm = Swarm(seed)
    swarm.fly(90.0, Phase.FORMING)

    def angles() -> np.ndarray:
        offsets = swarm.slots[list(swarm.planner.companions), :2] - swarm.here[swarm.reference]
        los = math.atan2(*(swarm.emitter - swarm.here[swarm.reference])[::-1])
        theta: np.ndarray = np.arctan2(offsets[:, 1], offsets[:, 0]) - los
        return theta

    before, true = angles(), swarm.emitter.copy()
    for _ in range(20):
        swarm.emitter = true + swarm.rng.normal(0.0, 60.0, 2)
        swarm.fly(2.0, Phase.FORMING)
    swarm.emitter = true
    swarm.fly(20.0, Phase.FORMING)
    # A swap is at least the angle between two neighbours; the LOS comes back to 1 mrad.
    change = np.abs((angles() - before + math.pi) % (2.0 * math.pi) - math.pi)
    members = list(swarm.planner.companions)
    reach = np.linalg.norm(swarm.slots[members, :2] - swarm.here[swarm.reference], axis=1)
    assert (change * reach < 0.6 * swarm.mission.limits.min_separation_m).all()
