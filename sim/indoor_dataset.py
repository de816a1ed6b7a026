"""Makes an indoor (UWB) TDOA data set: an emitter in a room with eight receivers in its corners.

Receiver pairs are measured in turn. A range difference has the errors of a radio (UWB) system:
white noise, multipath that is correlated over half a second, and gross outliers. A hard room adds
errors that a filter is seldom told about: one that depends on the direction of the signal at each
receiver, and a receiver that somebody stands in front of. The files have the columns that
``swarmctl track`` reads;

    python -m sim.indoor_dataset DIRECTORY [--seed 0] [--seconds 20] [--bias 0] [--blocked 5 6 10]

writes them. Without options they are the files that the tests use.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sim.noise import generator

SIZE_M = (7.0, 8.0, 3.0)
RATE_HZ = 200.0
SIGMA_M = 0.1
"""1-sigma of the white error of a range difference, m."""
COLOUR_M, TAU_S = 0.2, 0.5
"""1-sigma of the correlated error of a range difference, m, and its correlation time, s."""
OUTLIERS = 0.15
FARTHEST_M = 150.0
"""Share of gross outliers, and the greatest of them, m."""
BLOCKED_M = 1.5
"""Detour of the signal to a blocked receiver, m."""
_WAVES, _WAVES_PER_RAD = 3, 2.0
"""A receiver's directional error: number of waves over the sphere of directions, and their wave
number, 1/rad (an antenna's pattern, and reflections from the walls nearby)."""
_TRUTH_HZ = 20.0


Point = tuple[float, float, float]


class IndoorDataset(NamedTuple):
    """A data set as the contents of three files.

    Attributes:
        receivers: ``receiver,east_m,north_m,up_m``.
        measurements: ``time_s,receiver_i,receiver_j,rd_m``.
        truth: ``time_s,east_m,north_m,up_m``.
    """

    receivers: str
    measurements: str
    truth: str


def emitter(t: float) -> Point:
    """Position of the emitter at a time (s), m: on the floor for a second, then in the air."""
    away = 1.0 - math.exp(-0.3 * max(t - 1.0, 0.0) ** 2)
    return (
        3.5 + away * 2.2 * math.sin(0.7 * (t - 1.0)),
        4.0 + away * 2.5 * math.sin(0.5 * (t - 1.0)),
        0.1 + away * (1.2 + 0.6 * math.sin(0.4 * t)),
    )


class Directional:
    """An error of a receiver that depends on the direction of the emitter.

    Args:
        rng: Source of its random draws.
        sigma_m: 1-sigma over all directions, m.
    """

    def __init__(self, rng: np.random.Generator, sigma_m: float) -> None:
        self._waves = _WAVES_PER_RAD * rng.standard_normal((_WAVES, 3))
        self._phases = rng.uniform(0.0, 2.0 * math.pi, _WAVES)
        self._amplitude = sigma_m * math.sqrt(2.0 / _WAVES)

    def __call__(self, emitter: Point, receiver: Point) -> float:
        """The error for an emitter and a receiver at two places (m), m."""
        sight = np.subtract(emitter, receiver)
        sight /= np.linalg.norm(sight)
        return self._amplitude * float(np.cos(self._waves @ sight + self._phases).sum())


def simulate(
    seed: int,
    duration_s: float,
    *,
    bias_m: float = 0.0,
    blocked: tuple[int, float, float] | None = None,
) -> IndoorDataset:
    """Simulate an emitter that flies about the room.

    Args:
        seed: Seed of all errors.
        duration_s: Length of the data set, s.
        bias_m: 1-sigma of a range difference's directional error, m.
        blocked: Index of a blocked receiver, and the times between which it is blocked, s.
    """
    rng = generator(seed, "room")
    width, depth, height = SIZE_M
    corners = [(x, y, z) for x in (0.0, width) for y in (0.0, depth) for z in (0.2, height - 0.2)]
    names = [f"{place}{level}" for place in ("sw", "nw", "se", "ne") for level in ("-low", "-top")]
    sigma = COLOUR_M / math.sqrt(2.0)
    keep = math.exp(-1.0 / (RATE_HZ * TAU_S))
    colour = sigma * rng.standard_normal(len(corners))
    of_directions = generator(seed, "room directions")
    biases = [Directional(of_directions, bias_m / math.sqrt(2.0)) for _ in corners]
    rows = []
    for k in range(round(duration_s * RATE_HZ)):
        t = k / RATE_HZ
        i, j = k % len(corners), (k + 1 + int(rng.integers(len(corners) - 1))) % len(corners)
        e = emitter(t)
        rd = math.dist(e, corners[j]) + colour[j] - math.dist(e, corners[i]) - colour[i]
        rd += biases[j](e, corners[j]) - biases[i](e, corners[i])
        if blocked is not None and blocked[1] <= t < blocked[2]:
            rd += BLOCKED_M * ((j == blocked[0]) - (i == blocked[0]))
        rd += SIGMA_M * rng.standard_normal()
        if rng.random() < OUTLIERS:
            rd += rng.choice((-1.0, 1.0)) * rng.uniform(1.0, FARTHEST_M)
        rows.append(f"{t:.3f},{names[i]},{names[j]},{rd:.3f}")
        refreshed = math.sqrt(1.0 - keep * keep) * sigma
        colour = keep * colour + refreshed * rng.standard_normal(len(corners))
    truth = [
        "{:.2f},{:.4f},{:.4f},{:.4f}".format(k / _TRUTH_HZ, *emitter(k / _TRUTH_HZ))
        for k in range(round(duration_s * _TRUTH_HZ) + 1)
    ]
    receivers = [
        f"{name},{x:g},{y:g},{z:g}" for name, (x, y, z) in zip(names, corners, strict=True)
    ]
    return IndoorDataset(
        _file("receiver,east_m,north_m,up_m", receivers),
        _file("time_s,receiver_i,receiver_j,rd_m", rows),
        _file("time_s,east_m,north_m,up_m", truth),
    )


def write(dataset: IndoorDataset, directory: Path) -> None:
    """Write a data set as ``receivers.csv``, ``measurements.csv`` and ``truth.csv``."""
    directory.mkdir(parents=True, exist_ok=True)
    for name, content in dataset._asdict().items():
        (directory / f"{name}.csv").write_text(content, encoding="utf-8")


def _file(header: str, rows: list[str]) -> str:
    return "\n".join([header, *rows]) + "\n"


def main() -> None:
    """Write the data set that the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m sim.indoor_dataset")
    parser.add_argument("directory", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--bias", type=float, default=0.0, help="directional error, 1-sigma, m")
    parser.add_argument(
        "--blocked", type=float, nargs=3, metavar=("RECEIVER", "FROM", "UNTIL"), help="s"
    )
    asked = parser.parse_args()
    blocked = (int(asked.blocked[0]), *asked.blocked[1:]) if asked.blocked else None
    write(simulate(asked.seed, asked.seconds, bias_m=asked.bias, blocked=blocked), asked.directory)


if __name__ == "__main__":
    main()
