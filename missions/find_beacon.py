"""Find a drifting beacon with four simulated UAVs, in about ten lines of Python.

Run it with ``python -m missions.find_beacon``. For vehicles of your own, leave ``simulated``
out and give ``fly`` your mission file.
"""

import asyncio
from pathlib import Path

from swarmctl.ops.live import fly
from swarmctl.ops.simulation import simulated

MISSION = Path(__file__).with_name("beacon_drift.yaml")


async def find_beacon(mission: Path = MISSION, speedup: float = 12.0) -> dict[str, object]:
    """Fly a mission file against its simulation; returns the summary."""
    async with simulated(mission, speedup=speedup):
        return await fly(
            mission,
            speedup=speedup,
            on_snapshot=lambda s: print(f"{s.elapsed_s:5.0f} s  {s.phase:<11} {s.progress}"),
        )


if __name__ == "__main__":
    summary = asyncio.run(find_beacon())
    print(f"{summary['result']}: {summary['detail']}, {summary['final_error_m']:.1f} m off")
