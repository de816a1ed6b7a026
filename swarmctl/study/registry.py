"""Filters and formations by name. A researcher adds his own and gets a row and a curve more.

A file given to ``swarmctl study ... --with FILE`` calls :func:`register_filter` or
:func:`register_formation`; see ``docs/how-to/study-a-filter.md``.
"""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from swarmctl.errors import SwarmError, UsageError
from swarmctl.study.filters import Filter, ekf, iterated_ekf, ncrkf, okf
from swarmctl.units import Array

_T = TypeVar("_T")

ProcessNoise = tuple[float, float]
"""Spectral density of the emitter's acceleration in the case under study, per axis, m²/s³."""

FilterFactory = Callable[[ProcessNoise], Filter]

D_MAX_M = 300.0
"""Distance of the companions from the reference UAV in Table 1."""

JUDGED = "NCRKF"
"""The filter of this system, which targets are set for."""

_filters: dict[str, FilterFactory] = {
    JUDGED: lambda q: ncrkf(process_noise=q),
    "NCRKF, the paper's": lambda _: ncrkf("paper"),
    "EKF, the paper's": lambda _: ekf(),
    "OKF": lambda _: okf(),
    "iterated EKF": lambda q: iterated_ekf(process_noise=q),
}
_formations: dict[str, tuple[tuple[float, float], ...]] = {
    "perpendicular": tuple((math.radians(a), D_MAX_M) for a in (-90.0, 0.0, 90.0)),
    "uniform": tuple((math.radians(a), D_MAX_M) for a in (-120.0, 0.0, 120.0)),
}


def register_filter(name: str, make: FilterFactory) -> None:
    """Add a filter to every study.

    Args:
        name: Its row and curve.
        make: Is given the case's process noise (a filter may ignore it) and makes the filter.

    Raises:
        UsageError: The name is taken.
    """
    _add(_filters, "filter", name, make)


def register_formation(name: str, slots: Sequence[tuple[float, float]]) -> None:
    """Add a formation to the studies that compare formations.

    Args:
        name: Its name.
        slots: Of each companion: angle from the line of sight, counter-clockwise, rad, and
            distance from the reference UAV, m.

    Raises:
        UsageError: The name is taken, or a slot is not two finite numbers.
    """
    array = np.asarray(slots, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 2 or not np.isfinite(array).all():
        raise UsageError(
            f"The formation {name!r} must be pairs of (angle rad, distance m), finite; it has "
            f"the shape {array.shape}."
        )
    _add(_formations, "formation", name, tuple((float(a), float(d)) for a, d in array))


def filters(process_noise: ProcessNoise) -> dict[str, Filter]:
    """All filters, by name."""
    return {name: make(process_noise) for name, make in _filters.items()}


def formations() -> dict[str, Array]:
    """All formations, by name: (N, 2) of (angle rad, distance m)."""
    return {name: np.array(slots) for name, slots in _formations.items()}


def load(paths: Iterable[Path]) -> None:
    """Import files that register filters or formations.

    Their folders become places to import from, so that worker processes find them by name.

    Raises:
        UsageError: A file does not exist, is no Python file, or fails.
    """
    for path in paths:
        if path.suffix != ".py" or not path.is_file() or not path.stem.isidentifier():
            raise UsageError(f"{path} is no Python file: --with takes one such as my_filter.py.")
        folder = str(path.resolve().parent)
        if folder not in sys.path:
            sys.path.insert(0, folder)
        try:
            module = importlib.import_module(path.stem)
        except SwarmError:
            raise
        except Exception as error:
            raise UsageError(f"{path} cannot be loaded: {error!r}.") from error
        if Path(getattr(module, "__file__", None) or "").resolve() != path.resolve():
            raise UsageError(
                f"{path} cannot be loaded: another module is called {path.stem}. Rename the file."
            )


def _add(table: dict[str, _T], kind: str, name: str, value: _T) -> None:
    if name in table:
        raise UsageError(f"There is a {kind} called {name!r} already; choose another name.")
    table[name] = value
