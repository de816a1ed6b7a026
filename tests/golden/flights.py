"""What a golden flight is, how it is flown, and how its recording is kept small.

A golden flight is a stretch of a shipped mission, flown in memory. Kept of it are every decision
and every command in full, and of everything else (each MAVLink frame in either direction, each
observation) a digest per second of mission time, so that a flight that comes out differently is
known to the second even where the controller decided the same.
"""

from __future__ import annotations

import hashlib
import json
import lzma
import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import msgspec
import numpy as np
from mcap.reader import make_reader

from swarmctl.ops.in_memory import UTC_START_S, fly_in_memory

HERE = Path(__file__).parent
MISSIONS = HERE.parents[1] / "missions"
TLOG_TIME_BYTES = 8
MAVLINK_2, MAVLINK_1 = 0xFD, 0xFE


@dataclass(frozen=True)
class GoldenFlight:
    """A stretch of a mission.

    Attributes:
        mission: Name of a shipped mission.
        seed: Its seed.
        begin_s: Mission time from which it is compared, s.
        end_s: Mission time at which the flight is cut, s.
    """

    mission: str
    seed: int
    begin_s: float
    end_s: float

    @property
    def path(self) -> Path:
        """Where its recording is kept."""
        return HERE / f"{self.mission}-{self.seed}.jsonl.xz"

    def __str__(self) -> str:
        return f"{self.mission}-{self.seed}"


FLIGHTS = (
    # Checks, launch, the first estimates and the formation as it is taken up.
    GoldenFlight("beacon_drift", 1, 0.0, 60.0),
    GoldenFlight("beacon_real_clocks", 1, 30.0, 90.0),
    GoldenFlight("table1", 1, 0.0, 60.0),
    GoldenFlight("sitl_px4", 1, 0.0, 60.0),
)
LONG_FLIGHTS = (
    # The orbit's end and the way home; modes and window with real clocks; the approach's
    # beginning; the orbit's beginning.
    GoldenFlight("beacon_drift", 2, 350.0, 400.0),
    GoldenFlight("beacon_real_clocks", 2, 130.0, 180.0),
    GoldenFlight("table1", 2, 60.0, 110.0),
    GoldenFlight("sitl_px4", 2, 190.0, 240.0),
)


def fly(flight: GoldenFlight, directory: Path) -> list[str]:
    """Fly it and give its lines: JSON, one for each decision, command and second.

    Args:
        flight: What to fly.
        directory: A new directory for the recording.
    """
    ticks = iter(range(1, 1_000_000))
    with patch("swarmctl.recorder.plots.write_plots"):  # plots take longer than the flight
        fly_in_memory(
            MISSIONS / f"{flight.mission}.yaml",
            directory,
            seed=flight.seed,
            snapshot_every_s=1.0,
            until=lambda _: next(ticks) > flight.end_s,
        )
    return [arithmetic(), *_lines(flight, directory)]


def arithmetic() -> str:
    """A fingerprint of this machine's floating-point arithmetic, as a JSON line.

    BLAS and numpy choose their kernels by the processor, and kernels differ in the last bit.
    """
    numbers = np.random.default_rng(0)
    a = numbers.standard_normal((12, 12))
    spd = a @ a.T + np.eye(12)
    w = numbers.standard_normal(64)
    parts = [
        a @ a,
        np.linalg.solve(spd, a),
        np.linalg.cholesky(spd),
        np.linalg.eigh(spd)[0],
        np.array(np.linalg.slogdet(spd)),
        np.einsum("ij,jk,kl->il", a, spd, a),
        np.exp(w),
        np.log(np.abs(w)),
        np.sin(w),
        np.cos(w),
        np.hypot(w, w[::-1]),
        np.array([math.atan2(x, 0.3) * math.sin(x) for x in w]),
    ]
    digest = hashlib.blake2s(b"".join(part.tobytes() for part in parts), digest_size=8)
    return json.dumps({"numpy": np.__version__, "arithmetic": digest.hexdigest()})


def _lines(flight: GoldenFlight, directory: Path) -> Iterator[str]:
    digests: dict[tuple[int, str], hashlib.blake2s] = defaultdict(
        lambda: hashlib.blake2s(digest_size=8)
    )
    for time_us, frame in _frames(directory / "vehicles.tlog"):
        second = math.floor(time_us / 1e6 - UTC_START_S)
        digests[second, "mavlink"].update(frame)
    with (directory / "mission.mcap").open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            at_s = message.log_time / 1e9 - UTC_START_S
            if channel.topic.startswith(("/decision/", "/command/")):
                if flight.begin_s <= at_s < flight.end_s:
                    content = msgspec.json.decode(message.data)
                    yield json.dumps({"topic": channel.topic, **content})
            else:
                family = channel.topic.split("/")[1]
                digests[math.floor(at_s), family].update(message.data)
    for (second, family), digest in sorted(digests.items()):
        if flight.begin_s <= second < flight.end_s:
            yield json.dumps({"second": second, "of": family, "digest": digest.hexdigest()})


def _frames(path: Path) -> Iterator[tuple[int, bytes]]:
    """Time, us, and frame of everything in a ``.tlog``."""
    data = path.read_bytes()
    at = 0
    while at < len(data):
        begin = at + TLOG_TIME_BYTES
        length = data[begin + 1]
        if data[begin] == MAVLINK_2:
            size = 12 + length + (13 if data[begin + 2] & 1 else 0)
        else:
            assert data[begin] == MAVLINK_1, f"no frame at {begin} of {path}"
            size = 8 + length
        yield int.from_bytes(data[at:begin], "big"), data[begin : begin + size]
        at = begin + size


def load(flight: GoldenFlight) -> list[str]:
    """The lines as they were recorded."""
    return lzma.decompress(flight.path.read_bytes()).decode().splitlines()


def save(flight: GoldenFlight, lines: list[str]) -> None:
    """Keep the lines."""
    flight.path.write_bytes(lzma.compress("\n".join(lines).encode(), preset=9))
