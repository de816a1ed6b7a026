"""The Table 1 campaign, timed, and the memory of a long one: ``make bench``.

The campaign is the paper's: 200 runs x 2 formations x 3 filters x 801 steps. Memory is that of
a process of its own, at 2,000 and at 20,000 runs of short flights: results are reduced as they
come, so it must not grow.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time

from swarmctl.study.campaign import Campaign, run_campaign
from swarmctl.study.registry import standard_registry
from swarmctl.study.starts import DrawnEstimate

STEPS = 801

FLIGHT = """
import resource, sys
from swarmctl.study.campaign import Campaign, run_campaign
from swarmctl.study.engagement import Engagement
from swarmctl.study.registry import standard_registry
from swarmctl.study.starts import DrawnEstimate
runs = int(sys.argv[1])
registry = standard_registry()
one = {"perpendicular": registry.formations()["perpendicular"]}
short = Engagement(duration_s=0.4)
filters = registry.filters((0.0, 0.0))
run_campaign(Campaign(DrawnEstimate(), filters, one, runs, 0, engagement=short))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()

    registry = standard_registry()
    every = registry.filters((0.0, 0.0))
    paper = {name: every[name] for name in ("NCRKF, the paper's", "EKF, the paper's", "OKF")}
    times = []
    for _ in range(arguments.rounds):
        start = time.perf_counter()
        run_campaign(Campaign(DrawnEstimate(), paper, registry.formations(), 200, 0))
        times.append(time.perf_counter() - start)
    steps = 200 * 2 * 3 * STEPS
    print(f"Table 1 campaign, best of {len(times)}: {min(times):.2f} s (all: ", end="")
    print(", ".join(f"{t:.2f}" for t in times), end="); ")
    print(f"{min(times) / steps * 1e6:.2f} us per trial-step, bounds and tallies included")

    peaks = {}
    for runs in (2_000, 20_000):
        command = [sys.executable, "-c", FLIGHT, str(runs)]
        peaks[runs] = float(subprocess.run(command, check=True, capture_output=True).stdout)
        print(f"peak memory at {runs} runs: {peaks[runs]:.0f} MB")
    print(f"ratio of the two: {peaks[20_000] / peaks[2_000]:.3f}")


if __name__ == "__main__":
    main()
