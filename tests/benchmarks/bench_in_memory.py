"""How much faster than real time the demo flies in memory, on one core, recording included.

``make bench`` prints one line per flight and the median.
"""

from __future__ import annotations

import os
import statistics
import tempfile
from pathlib import Path

from swarmctl.ops.in_memory import fly_in_memory
from tests.missions import DEMO

FLIGHTS = 5


def main() -> None:
    """Fly the demo a few times."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    ratios = []
    for seed in range(1, FLIGHTS + 1):
        with tempfile.TemporaryDirectory() as out:
            summary = fly_in_memory(DEMO, Path(out), seed=seed)
        mission_s, wall_s = summary.duration_s, summary.wall_s
        ratios.append(mission_s / wall_s)
        print(f"seed {seed}: {mission_s:.0f} s of mission in {wall_s:.1f} s: {ratios[-1]:.0f} x")
    print(f"median {statistics.median(ratios):.0f} x real time")


if __name__ == "__main__":
    main()
