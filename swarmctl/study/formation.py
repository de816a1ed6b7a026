"""Which formation finds the emitter soonest? Whole missions, closed loop, on paired seeds.

Every design flies the same missions: the shipped demo with as many vehicles, the same truth, wind
and noise. A flight ends once the estimate's larger 1-sigma axis is below 25 m; what counts is how
long that took from forming up, and how large the error then was.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

from swarmctl.errors import UsageError
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.mission.snapshot import Snapshot
from swarmctl.ops.in_memory import fly_in_memory
from swarmctl.study.executors import in_order
from swarmctl.units import Array

DESIGNS = ("uniform", "paper", "optimal")
COMPANIONS = (3, 4, 6)
CONVERGED_SIGMA_M = 25.0
LOOK_EVERY_S = 0.5
"""How often a flight is asked whether it is over, mission s."""
RESAMPLES = 2000
"""Samples of the bootstrap."""
ALTITUDE_STEP_M = 12.0


class MissionOutcome(NamedTuple):
    """How one mission ended.

    Attributes:
        converged_s: Time from forming up until the 1-sigma was below 25 m; infinite if never.
        error_m: Error of the estimate then.
    """

    converged_s: float
    error_m: float


@dataclass(frozen=True)
class Cell:
    """One design with one number of companions.

    Attributes:
        design: The design's name.
        companions: Number of companions.
        mean_s: Mean time to converge.
        rmse_m: Root mean square of the error then.
        lost: Flights that did not converge; the figures are over the others.
        of_best: Mean time over that of the best design with as many companions.
        of_best_95: 95 % interval of that ratio, by bootstrap over the paired seeds.
    """

    design: str
    companions: int
    mean_s: float
    rmse_m: float
    lost: int
    of_best: float
    of_best_95: tuple[float, float]


def run_formation(
    *,
    runs: int = 100,
    seed: int = 0,
    designs: Sequence[str] = DESIGNS,
    companions: Sequence[int] = COMPANIONS,
    executor: Executor | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Cell]:
    """Fly every design with every number of companions through the same missions.

    Args:
        runs: Missions of each design with each number of companions.
        seed: The first mission's seed; the next missions have the seeds that follow.
        designs: Names of designs that a mission file knows.
        companions: Numbers of companions.
        executor: Where the missions are flown; None for this process.
        on_progress: Is told how many missions are done, and of how many.

    Raises:
        UsageError: runs is below 2.
        MissionFileError: A design is unknown.
        SwarmError: A mission cannot be flown.
    """
    if runs < 2:
        raise UsageError(f"A study needs at least 2 runs, not {runs}.")
    for design in designs:
        # An unknown design is refused before the first flight, in the mission file's own words.
        parse_mission(mission_text(design, companions[0]))
    work = [(design, n, seed + k) for n in companions for design in designs for k in range(runs)]
    flights: dict[tuple[str, int], list[MissionOutcome]] = {}
    for done, ((design, n, _), flight) in enumerate(
        zip(work, in_order(executor, fly_mission, work), strict=True), start=1
    ):
        flights.setdefault((design, n), []).append(flight)
        on_progress(done, len(work))
    rng = np.random.default_rng(seed)
    return [
        cell
        for n in companions
        for cell in _cells(n, {design: flights[design, n] for design in designs}, rng)
    ]


def fly_mission(work: tuple[str, int, int]) -> MissionOutcome:
    """Fly one mission: a design's name, the number of companions, a seed."""
    design, companions, seed = work
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mission.yaml"
        path.write_text(mission_text(design, companions))
        summary = fly_in_memory(path, seed=seed, snapshot_every_s=LOOK_EVERY_S, until=_is_over)
    if summary.converged_s is None or summary.final_error_m is None:
        return MissionOutcome(np.inf, np.inf)
    return MissionOutcome(summary.converged_s, summary.final_error_m)


def mission_text(design: str, companions: int) -> str:
    """The shipped demo's mission file with another design and number of companions."""
    raw = yaml.safe_load((files("missions") / "beacon_drift.yaml").read_text())
    first = raw["swarm"]["vehicles"][0]["altitude_amsl_m"]
    raw["swarm"]["vehicles"] = [
        {"sysid": 1 + i, "altitude_amsl_m": first + ALTITUDE_STEP_M * i}
        for i in range(companions + 1)
    ]
    top = first + ALTITUDE_STEP_M * companions
    raw["limits"]["ceiling_amsl_m"] = max(raw["limits"]["ceiling_amsl_m"], top + 10.0)
    raw["formation"]["design"] = design
    return str(yaml.safe_dump(raw))


def _is_over(snapshot: Snapshot) -> bool:
    flying = snapshot.phase in {"approaching", "orbiting"}
    return flying and snapshot.estimate.sigma_major_m < CONVERGED_SIGMA_M


def _cells(
    companions: int, flights: dict[str, list[MissionOutcome]], rng: np.random.Generator
) -> list[Cell]:
    times = {name: np.array([flight.converged_s for flight in f]) for name, f in flights.items()}
    # The designs are compared on the same missions: those in which every design converged.
    common = np.isfinite(np.array(list(times.values()))).all(0)
    times = {name: t[common] for name, t in times.items()}
    means = {name: float(t.mean()) for name, t in times.items()}
    best = min(means, key=lambda name: means[name])
    picks = rng.integers(0, common.sum(), (RESAMPLES, common.sum()))
    cells = []
    for name, found in flights.items():
        errors = np.array([flight.error_m for flight in found])[common]
        low, high = np.quantile(_ratio(times[name], times[best], picks), [0.025, 0.975])
        cells.append(
            Cell(
                name,
                companions,
                means[name],
                float(np.sqrt(np.square(errors).mean())),
                int(np.sum(~np.isfinite([flight.converged_s for flight in found]))),
                means[name] / means[best],
                (float(low), float(high)),
            )
        )
    return cells


def _ratio(times: Array, best: Array, picks: np.ndarray) -> Array:
    ratio: Array = times[picks].mean(1) / best[picks].mean(1)
    return ratio
