"""The formation designs, timed and compared: ``python -m tests.benchmarks.bench_designs``.

Table 1's distances and noise (equal receivers). The track is a straight approach of 12 s at
50 Hz, thinned to 30 epochs. The search of ``optimal`` and ``worst_case`` is many small steps:
on a machine with other work to do, ``OPENBLAS_NUM_THREADS=1`` keeps threads from waiting for
each other in each of them.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from swarmctl.formation.design_search import worst
from swarmctl.formation.designs import DESIGNS
from swarmctl.formation.objectives import Objective, approach, determinant, rms, track
from swarmctl.formation.requirements import Requirements
from swarmctl.study.starts import CV, table_1_covariance

RANGE_M = 5000.0
COMPANIONS = (3, 4, 8, 12)


def objectives(requirements: Requirements) -> dict[str, Objective]:
    prior = table_1_covariance()[np.ix_(CV, CV)]
    flight = approach(RANGE_M, 270.0, 12.0, 50.0, prior)
    return {
        "determinant": determinant(requirements),
        "rms": rms(requirements),
        "track": track(requirements, flight),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds

    print(f"best of {rounds}; ratios to optimal: as designed, and the worst over +-30 deg")
    print(f"{'objective':12} {'N':>3} {'design':11} {'ms':>8} {'m':>9} {'ratio':>6} {'worst':>6}")
    for companions in COMPANIONS:
        requirements = Requirements(companions, 300.0, 10.0, RANGE_M)
        sector = np.linspace(-requirements.sector_rad, requirements.sector_rad, 31)
        for name, objective in objectives(requirements).items():
            best = float(objective(DESIGNS["optimal"](requirements, objective)))
            for design_name, design in DESIGNS.items():
                times = []
                for _ in range(rounds):
                    start = time.perf_counter()
                    found = design(requirements, objective)
                    times.append(time.perf_counter() - start)
                value = float(objective(found))
                off = float(worst(objective, found, sector))
                print(f"{name:12} {companions:3} {design_name:11} {min(times) * 1e3:8.2f}", end="")
                print(f" {value:9.3f} {value / best:6.3f} {off / best:6.3f}")


if __name__ == "__main__":
    main()
