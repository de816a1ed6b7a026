"""What dog-legs buy in closed loop: ``python -m tests.benchmarks.bench_dogleg [--runs 12]``.

The shipped demo with N companions and a goal, on paired seeds, with dog-legs and without: time
from the start of the approach until the larger 1-sigma axis is below 25 m; mean difference and
its 95 % interval by the t distribution. And what one comparison of courses takes.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import yaml
from scipy import stats

from swarmctl.formation import dogleg
from swarmctl.formation.dogleg import DogLegs, Situation, Terms
from swarmctl.formation.requirements import Noise
from swarmctl.mission.snapshot import Snapshot
from swarmctl.ops.in_memory import fly_in_memory
from swarmctl.study.formation import CONVERGED_SIGMA_M, LOOK_EVERY_S, mission_text

CELLS = ((1, 5.0), (2, 5.0), (2, 25.0), (3, 5.0), (4, 5.0))
"""Companions, and the mission's goal.sigma_m."""


def converged_s(companions: int, goal_m: float, seed: int) -> float:
    """Time from the start of the approach until the estimate is sharp, s; infinite if never."""
    raw = yaml.safe_load(mission_text("optimal", companions))
    raw["formation"]["min_companions"] = raw["sim"]["receivers"]["min_companions"] = 1
    raw["goal"]["sigma_m"] = goal_m
    seen: list[tuple[float, bool]] = []

    def over(snapshot: Snapshot) -> bool:
        if snapshot.phase in {"approaching", "orbiting"}:
            sharp = snapshot.estimate.sigma_major_m < CONVERGED_SIGMA_M
            seen.append((snapshot.elapsed_s, sharp))
            return sharp
        return snapshot.phase == "returning"

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mission.yaml"
        path.write_text(yaml.safe_dump(raw))
        fly_in_memory(path, seed=seed, snapshot_every_s=LOOK_EVERY_S, until=over)
    return seen[-1][0] - seen[0][0] if seen[-1][1] else math.inf


def compare(companions: int, goal_m: float, runs: int) -> None:
    """Print one line: with dog-legs, without, and the difference."""
    bent = np.array([converged_s(companions, goal_m, seed) for seed in range(runs)])
    angles, dogleg.ANGLES_RAD = dogleg.ANGLES_RAD, ()
    try:
        straight = np.array([converged_s(companions, goal_m, seed) for seed in range(runs)])
    finally:
        dogleg.ANGLES_RAD = angles
    delta = bent - straight
    half = stats.t.ppf(0.975, runs - 1) * delta.std(ddof=1) / math.sqrt(runs)
    print(
        f"N = {companions}, goal {goal_m:4.0f} m: straight {straight.mean():6.1f} s,"
        f" dog-legs {bent.mean():6.1f} s, {delta.mean():+6.1f} +- {half:.1f} s,"
        f" worst {delta.max():+.1f} s",
        flush=True,
    )


def comparison_ms() -> float:
    """Median processor time of one comparison for 12 companions, ms."""
    angles = 2.0 * math.pi * np.arange(12) / 12.0
    now = Situation(
        np.zeros(2),
        np.array([2500.0, 0.0, 0.0, 0.0]),
        np.diag([4e4, 4e2, 1.0, 1.0]),
        285.0 * np.column_stack((np.cos(angles), np.sin(angles))),
        425.0,
        7.0,
    )
    terms = Terms(Noise(3.0, 0.5, 0.5), 10.0, 4e-4, 10.0, 5.0, 60.0, 3700.0)
    return 1e3 * float(
        np.median([_timed(lambda: DogLegs(terms).follow(now, 0.1)) for _ in range(50)])
    )


def _timed(call: Callable[[], object]) -> float:
    began = time.process_time()
    call()
    return time.process_time() - began


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=12)
    runs = parser.parse_args().runs
    print(f"one comparison for N = 12: {comparison_ms():.1f} ms")
    for companions, goal_m in CELLS:
        compare(companions, goal_m, runs)
