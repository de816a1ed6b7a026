"""What flying costs the controller's process on each backend: native and MAVSDK.

``make bench`` flies the short mission with four simulated PX4 vehicles over real sockets on each,
and prints, per second of the mission: the share of one core that the whole process takes, every
thread of MAVSDK's included; how many messages came from a vehicle and how many setpoints went to
it; and the slot error.
"""

from __future__ import annotations

import asyncio
import socket
import tempfile
import time
from pathlib import Path

from swarmctl.ops.live import fly
from swarmctl.ops.simulation import simulated
from tests.brokers import free_port
from tests.missions import short_mission_text

SPEEDUP = 6.0


async def measure(backend: str, directory: Path) -> str:
    """One line of figures."""
    mission = directory / f"{backend}.yaml"
    mission.write_text(
        short_mission_text(
            swarm__backend=backend,
            swarm__autopilot="px4",
            swarm__link=f"udpin://127.0.0.1:{free_port(socket.SOCK_DGRAM)}",
            feed__broker=f"mqtt://127.0.0.1:{free_port()}",
            sim__autopilot="px4",
        )
    )
    async with simulated(mission, speedup=SPEEDUP):
        began_s = time.process_time()
        summary = await fly(mission, speedup=SPEEDUP)
        used_s = time.process_time() - began_s
    vehicles, mission_s = 4, summary.duration_s
    return (
        f"{backend:8} {summary.result}: {used_s / mission_s / vehicles:.2%} of one core,"
        f" {summary.mavlink_messages_in / mission_s / vehicles:.1f} messages/s and"
        f" {summary.setpoints_out / mission_s / vehicles:.1f} setpoints/s a vehicle,"
        f" slot error {summary.slot_error_rms_m:.2f} m RMS"
    )


def main() -> None:
    """Fly on both, one after the other."""
    with tempfile.TemporaryDirectory() as directory:
        for backend in ("native", "mavsdk"):
            print(asyncio.run(measure(backend, Path(directory))))


if __name__ == "__main__":
    main()
