"""A shipped mission flown over many seeds, and the columns of what came of it."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from swarmctl import FlightSummary, fly_in_memory

MISSIONS = Path(__file__).parents[2] / "missions"
Flights = list[FlightSummary]


def _fly(path: Path, seed: int) -> FlightSummary:
    return fly_in_memory(path, seed=seed)


def fly_seeds(path: Path, seeds: Sequence[int], columns: Sequence[str]) -> Flights:
    """Fly a mission once for each seed on both cores, and print the columns of the summaries."""
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(partial(_fly, path), seeds))
    print("\nseed " + " ".join(f"{name.removesuffix('_m'):>14.14}" for name in columns))
    for seed, flight in zip(seeds, found, strict=True):
        print(f"{seed:4} " + " ".join(f"{getattr(flight, name):14.3f}" for name in columns))
    return found


def column(flights: Flights, name: str) -> np.ndarray:
    """One figure of every flight."""
    return np.array([getattr(flight, name) for flight in flights])
