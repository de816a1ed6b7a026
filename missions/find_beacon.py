"""Find a drifting beacon with four simulated UAVs, in about ten lines of Python.

Run it with ``python -m missions.find_beacon``. For vehicles of your own, leave ``simulated``
out and give ``fly`` your mission file.
"""

import asyncio
from pathlib import Path

import swarmctl

MISSION = Path(__file__).with_name("beacon_drift.yaml")


async def find_beacon(mission: Path = MISSION, speedup: float = 12.0) -> swarmctl.FlightSummary:
    """Fly a mission file against its simulation; returns the summary."""
    async with swarmctl.simulated(mission, speedup=speedup):
        return await swarmctl.fly(
            mission,
            speedup=speedup,
            on_snapshot=lambda s: print(f"{s.elapsed_s:5.0f} s  {s.phase:<11} {s.progress}"),
        )


def in_words(summary: swarmctl.FlightSummary) -> str:
    """How the flight ended and, where the true position is known, how far off the estimate is."""
    error_m = summary.final_error_m
    off = "" if error_m is None else f", {error_m:.1f} m off"
    return f"{summary.result}: {summary.detail}{off}"


if __name__ == "__main__":
    print(in_words(asyncio.run(find_beacon())))
