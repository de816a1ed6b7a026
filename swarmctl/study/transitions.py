"""Does the swarm keep its limits while its formation changes? Seeded transitions.

The planner flies 4 to 13 simulated airframes in gusty wind, half of the flights at one altitude,
through everything that re-forms a formation: a first estimate, estimates that jump, waver, turn
round or lose their line of sight, a companion or the reference UAV that is lost and comes back.
Every limit is looked at on the true positions, every control period.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from importlib.resources import files
from typing import NamedTuple

import numpy as np
import yaml

from sim.autopilots.flight_tasks import FOLLOW_GAIN_PER_S
from sim.config import VehicleLimits
from sim.dynamics import Command, State, step
from sim.noise import GaussMarkov, Normals, generator
from swarmctl.errors import UsageError
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.mission.phases import OBSERVING, Phase
from swarmctl.mission.planner import PlannedMotion, Planner
from swarmctl.mission.target import Target
from swarmctl.study.executors import in_order
from swarmctl.units import Array

COMPANIONS = range(3, 13)
EVENTS = ("jump", "near", "turn", "unsure", "companion lost", "reference lost")
"""Each is a transition; forming up and each return of a lost vehicle are transitions too."""
PER_FLIGHT = 1 + len(EVENTS) + 2
PERIOD_S = 0.1
STEPS = 5
"""Steps of the airframes in a control period."""
WIND_MPS, GUST_MPS, GUST_TAU_S = 5.0, 1.0, 5.0
FORMED_M = 3.0
FORMING_LIMIT_S = 240.0
"""A formation that has not formed up by then counts as not formed."""
NEAREST_M = 900.0
"""Nearest range that an estimate jumps to, m: nearer, the swarm would have to retreat."""
SHARP_M, VAGUE_M = 30.0, 900.0
"""1-sigma of the estimate."""


class TransitionFlight(NamedTuple):
    """One flight through every transition.

    Attributes:
        seed: The flight's seed.
        companions: Number of companions.
        separation_m: Least 3-D distance between two vehicles in the air.
        reach_m: Greatest 3-D distance of a companion in formation from the reference UAV.
        not_formed: Transitions after which the swarm did not form up again in time.
        swaps: Companions that took another's slot for an estimate that only wavered.
    """

    seed: int
    companions: int
    separation_m: float
    reach_m: float
    not_formed: int
    swaps: int


@dataclass(frozen=True)
class Transitions:
    """All flights.

    Attributes:
        transitions: Number of transitions.
        flights: Number of flights.
        min_separation_m: Least separation the mission allows.
        separation_m: Least separation in any flight.
        d_max_m: Greatest distance from the reference UAV the mission allows.
        reach_m: Greatest distance in any flight.
        not_formed: Transitions after which the swarm did not form up in time.
        swaps: Companions that took another's slot without need.
        worst_seed: Seed of the flight with the least separation.
    """

    transitions: int
    flights: int
    min_separation_m: float
    separation_m: float
    d_max_m: float
    reach_m: float
    not_formed: int
    swaps: int
    worst_seed: int


def run_transitions(
    *,
    count: int = 1000,
    seed: int = 0,
    executor: Executor | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> Transitions:
    """Fly transitions, nine in a flight.

    Args:
        count: Transitions to fly, rounded up to whole flights.
        seed: The first flight's seed; the next flights have the seeds that follow.
        executor: Where the flights are flown; None for this process.
        on_progress: Is told how many flights are done, and of how many.

    Raises:
        UsageError: count is below 1.
    """
    if count < 1:
        raise UsageError(f"There must be at least 1 transition, not {count}.")
    seeds = range(seed, seed + math.ceil(count / PER_FLIGHT))
    flown = []
    for done, flight in enumerate(in_order(executor, fly_transitions, seeds), start=1):
        flown.append(flight)
        on_progress(done, len(seeds))
    limits = mission(COMPANIONS[0], 0, level=False).limits
    worst = min(flown, key=lambda flight: flight.separation_m)
    return Transitions(
        transitions=PER_FLIGHT * len(flown),
        flights=len(flown),
        min_separation_m=limits.min_separation_m,
        separation_m=worst.separation_m,
        d_max_m=limits.d_max_m,
        reach_m=max(flight.reach_m for flight in flown),
        not_formed=sum(flight.not_formed for flight in flown),
        swaps=sum(flight.swaps for flight in flown),
        worst_seed=worst.seed,
    )


def mission(companions: int, reference: int, *, level: bool) -> Mission:
    """The shipped demo with other vehicles.

    Args:
        companions: N.
        reference: Row of the reference UAV.
        level: Whether all fly at one altitude; else they are just apart enough.
    """
    step = 0 if level else 9
    raw = yaml.safe_load((files("missions") / "beacon_drift.yaml").read_text())
    raw["swarm"]["vehicles"] = [
        {"sysid": 1 + i, "altitude_amsl_m": 60 + step * i} for i in range(companions + 1)
    ]
    raw["swarm"]["reference"] = 1 + reference
    raw["limits"] |= {"ceiling_amsl_m": 250, "geofence_radius_m": 9000}
    return parse_mission(yaml.safe_dump(raw))


def fly_transitions(seed: int) -> TransitionFlight:
    """Fly one seed's transitions, in an order of its own."""
    flight = _Flight(seed)
    flight.form_up()
    flight.waver()
    for event in flight.rng.permutation(EVENTS).tolist():
        match event:
            case "jump":
                flight.jump()
            case "near":
                flight.near()
            case "turn":
                flight.turn()
            case "unsure":
                flight.go_on(25.0, VAGUE_M)
            case "companion lost":
                flight.lose(int(flight.rng.choice(flight.planner.companions)))
            case _:
                flight.lose(flight.planner.reference)
        flight.form_up()
    return flight.flown()


class _Flight:
    """Airframes that follow a planner, and how near they came to every limit."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self.rng = generator(seed, "transitions")
        n = int(self.rng.choice(COMPANIONS))
        self.mission = mission(n, int(self.rng.integers(n + 1)), level=seed % 2 == 1)
        self.planner = Planner(self.mission)
        launch = 20.0 * self.rng.permutation(n + 1)
        self.launch = np.column_stack((launch, np.zeros(n + 1)))
        altitudes = [vehicle.altitude_amsl_m for vehicle in self.mission.swarm.vehicles]
        self.states = [
            State((x, 0.0, z), on_ground=False) for x, z in zip(launch, altitudes, strict=True)
        ]
        self.airframe = VehicleLimits()
        toward = self.rng.uniform(-math.pi, math.pi)
        self.wind = WIND_MPS * np.array([math.cos(toward), math.sin(toward)])
        self.gusts = [
            GaussMarkov(GUST_MPS, GUST_TAU_S, PERIOD_S, Normals(generator(seed, "gust", row)))
            for row in range(n + 1)
        ]
        self.emitter = 2000.0 * _unit(self.rng.uniform(-math.pi, math.pi))
        self.phase = Phase.FORMING
        self.slots: Array | None = None
        self.plan: PlannedMotion | None = None
        self.separation_m = math.inf
        self.reach_m = 0.0
        self.not_formed = 0
        self.swaps = 0
        self.companions = n
        self.planner.begin(self.launch, self.target(SHARP_M))

    def target(self, sigma_m: float) -> Target:
        east, north = self.emitter.tolist()
        covariance = (sigma_m**2, 0.0, sigma_m**2)
        return Target((east, north, 0.0), (0.0, 0.0, 0.0), sigma_m, 0.1, covariance)

    @property
    def here(self) -> Array:
        """True horizontal positions, (n, 2), m."""
        return np.array([state.position_enu[:2] for state in self.states])

    def worst_m(self) -> float:
        """Greatest slot error of a companion, m."""
        if self.slots is None:
            return math.inf
        rows = list(self.planner.companions)
        return float(np.linalg.norm(self.slots[rows, :2] - self.here[rows], axis=1).max())

    def period(self, sigma_m: float = SHARP_M) -> None:
        """One control period: vehicles fly on the setpoints of the period before."""
        target = self.target(sigma_m)
        if self.phase in OBSERVING:
            near = self.planner.at_radius(target)
            self.phase = Phase.ORBITING if near else Phase.APPROACHING
        last = self.plan
        error = 0.0 if self.slots is None else self.worst_m()
        self.plan = self.planner.step(self.phase, target, error, self.launch, PERIOD_S)
        self.slots = self.plan.slots
        self._fly(last or self.plan)
        self._look()

    def _fly(self, plan: PlannedMotion) -> None:
        dt = PERIOD_S / STEPS
        for row, gust in enumerate(self.gusts):
            gust.advance()
            state = self.states[row]
            goal, velocity = plan.positions[row].tolist(), plan.velocities[row].tolist()
            east, north, up = gust.value
            air = (float(self.wind[0]) + east, float(self.wind[1]) + north, up)
            for k in range(STEPS):
                x, y, z = state.position_enu
                age = k * dt
                way = (
                    goal[0] + age * velocity[0] - x,
                    goal[1] + age * velocity[1] - y,
                    goal[2] - z,
                )
                command = Command(way, (velocity[0], velocity[1], 0.0), FOLLOW_GAIN_PER_S)
                state = step(state, command, air, self.airframe, -math.inf, dt)
            self.states[row] = state

    def _look(self) -> None:
        space = np.array([state.position_enu for state in self.states])
        gaps = np.linalg.norm(space[:, None] - space[None], axis=-1)
        apart = float(gaps[np.triu_indices(len(gaps), 1)].min())
        self.separation_m = min(self.separation_m, apart)
        if self.phase in OBSERVING:
            joined = [i for i in self.planner.companions if i not in self.planner.returning]
            reach = float(gaps[self.planner.reference, joined].max(initial=0.0))
            self.reach_m = max(self.reach_m, reach)

    def go_on(self, seconds: float, sigma_m: float = SHARP_M) -> None:
        """Fly on for a while."""
        for _ in range(round(seconds / PERIOD_S)):
            self.period(sigma_m)

    def form_up(self) -> None:
        """Fly until everyone is in his slot; then the observation goes on."""
        for _ in range(round(FORMING_LIMIT_S / PERIOD_S)):
            self.period()
            if self.worst_m() < FORMED_M and not self.planner.returning:
                break
        else:
            self.not_formed += 1
        if self.phase is Phase.FORMING:
            self.go_on(10.0)

    def waver(self) -> None:
        """Let the estimate waver; no companion should take another's slot for it."""
        before, true = self._slots_along(), self.emitter.copy()
        for _ in range(20):
            self.emitter = true + self.rng.normal(0.0, 2.0 * SHARP_M, 2)
            self.go_on(2.0)
        self.emitter = true
        self.go_on(20.0)
        # A design for another range may shift a slot a little, but not onto another one.
        moved = np.linalg.norm(self._slots_along()[:, None] - before, axis=-1)
        self.swaps += int((moved.argmin(axis=1) != np.arange(len(before))).sum())
        self.phase = Phase.APPROACHING

    def _slots_along(self) -> Array:
        """The companions' slots along and across the line to the emitter, (N, 2), m."""
        if self.slots is None:
            raise AssertionError("the flight has begun")
        reference = self.slots[self.planner.reference, :2]
        ahead = self.emitter - reference
        ahead = ahead / np.linalg.norm(ahead)
        offsets = self.slots[list(self.planner.companions), :2] - reference
        along: Array = offsets @ np.array([[ahead[0], -ahead[1]], [ahead[1], ahead[0]]])
        return along

    def jump(self) -> None:
        """The estimate jumps, but not into the swarm."""
        centre = self.here[self.planner.reference]
        moved = self.emitter + self.rng.normal(0.0, 200.0, 2)
        away = moved - centre
        self.emitter = centre + away * max(1.0, NEAREST_M / float(np.linalg.norm(away)))
        self.go_on(25.0)

    def near(self) -> None:
        """The emitter turns out to be half as far off."""
        centre = self.here[self.planner.reference]
        away = self.emitter - centre
        distance = float(np.linalg.norm(away))
        self.emitter = centre + away * max(0.5, NEAREST_M / distance)
        self.go_on(25.0)

    def turn(self) -> None:
        """The emitter turns out to be on another side, or behind."""
        centre = self.here[self.planner.reference]
        away = self.emitter - centre
        angle = math.atan2(away[1], away[0]) + self.rng.choice([-1, 1]) * self.rng.uniform(1, 3.1)
        self.emitter = centre + max(NEAREST_M, float(np.linalg.norm(away))) * _unit(angle)
        self.go_on(25.0)

    def lose(self, row: int) -> None:
        """A vehicle falls silent and hovers; half a minute later it comes back."""
        if row == self.planner.reference:
            self.planner.succeed(self.target(SHARP_M))
        else:
            self.planner.drop(row)
        self.form_up()
        self.go_on(10.0)
        self.planner.add(row, self.here[row])

    def flown(self) -> TransitionFlight:
        """The flight's results."""
        return TransitionFlight(
            self._seed,
            self.companions,
            self.separation_m,
            self.reach_m,
            self.not_formed,
            self.swaps,
        )


def _unit(angle_rad: float) -> Array:
    return np.array([math.cos(angle_rad), math.sin(angle_rad)])
