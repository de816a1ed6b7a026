"""The filters and formations that a study compares, each under its name.

A researcher adds his own and gets a row and a curve more: ``swarmctl study ... --with FILE``
calls the file's ``register(registry)``; see ``docs/how-to/study-a-filter.md``.
"""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import ModuleType
from typing import TypeVar

import numpy as np

from swarmctl.errors import SwarmError, UsageError
from swarmctl.study.batch_filter import BatchFilter
from swarmctl.study.filterpy_filter import filterpy_ekf
from swarmctl.study.filters import ekf, iterated_ekf, ncrkf, okf
from swarmctl.units import Array

_T = TypeVar("_T")

ProcessNoise = tuple[float, float]
"""Spectral density of the emitter's acceleration in the case under study, per axis, m²/s³."""

FilterFactory = Callable[[ProcessNoise], BatchFilter]
"""Makes a filter for a case's process noise; it may ignore the noise."""

JUDGED = "NCRKF"
"""The filter of this system, which the studies hold to a tolerance."""

D_MAX_M = 300.0
"""Distance of the companions from the reference UAV in Table 1, m."""
PERPENDICULAR = tuple((math.radians(angle), D_MAX_M) for angle in (-90.0, 0.0, 90.0))
"""The paper's formation of N = 3, Eq. (29)."""
UNIFORM = tuple((math.radians(angle), D_MAX_M) for angle in (-120.0, 0.0, 120.0))
"""The companions evenly round the reference UAV."""


class Registry:
    """Filters and formations by name, in the order in which they were registered.

    It is empty at first; :func:`standard_registry` makes one with the entries of the paper and
    of this system.
    """

    def __init__(self) -> None:
        self._filters: dict[str, FilterFactory] = {}
        self._slow: set[str] = set()
        self._formations: dict[str, tuple[tuple[float, float], ...]] = {}

    def register_filter(self, name: str, make: FilterFactory, *, slow: bool = False) -> None:
        """Add a filter to every study.

        Args:
            name: Its row and curve.
            make: Makes the filter for the case's process noise.
            slow: Whether it flies the first chunk of a campaign only, to keep its cost in check.

        Raises:
            UsageError: The name is taken.
        """
        _add(self._filters, "filter", name, make)
        if slow:
            self._slow.add(name)

    def register_formation(self, name: str, slots: Sequence[tuple[float, float]]) -> None:
        """Add a formation to the studies that compare formations.

        Args:
            name: Its name.
            slots: For each companion its angle from the line of sight, counter-clockwise, rad,
                and its distance from the reference UAV, m.

        Raises:
            UsageError: The name is taken, or a slot is not two finite numbers.
        """
        array = np.asarray(slots, dtype=np.float64)
        if array.ndim != 2 or array.shape[1] != 2 or not np.isfinite(array).all():
            raise UsageError(
                f"The formation {name!r} must be pairs of (angle rad, distance m), finite; it has "
                f"the shape {array.shape}."
            )
        _add(self._formations, "formation", name, tuple((float(a), float(d)) for a, d in array))

    def filters(self, process_noise: ProcessNoise) -> dict[str, BatchFilter]:
        """All filters, made for a case's process noise, by name."""
        return {name: make(process_noise) for name, make in self._filters.items()}

    @property
    def slow(self) -> frozenset[str]:
        """Names of the filters that fly the first chunk of a campaign only."""
        return frozenset(self._slow)

    def formations(self) -> dict[str, Array]:
        """All formations by name, each (N, 2) of (angle rad, distance m)."""
        return {name: np.array(slots) for name, slots in self._formations.items()}


def standard_registry(files: Iterable[Path] = ()) -> Registry:
    """A new registry with the paper's and this system's entries, and those of files.

    The folders of the files become places to import from, so that worker processes find the
    files' classes by name.

    Args:
        files: Python files that define ``register(registry)``.

    Raises:
        UsageError: A file does not exist, is no Python file, has no ``register``, or fails.
    """
    registry = Registry()
    registry.register_filter(JUDGED, lambda q: ncrkf(process_noise=q))
    registry.register_filter("NCRKF, the paper's", lambda _: ncrkf("paper"))
    registry.register_filter("EKF, the paper's", lambda _: ekf())
    registry.register_filter("OKF", lambda _: okf())
    registry.register_filter("iterated EKF", lambda q: iterated_ekf(process_noise=q))
    registry.register_filter("filterpy_ekf", filterpy_ekf, slow=True)
    registry.register_formation("perpendicular", PERPENDICULAR)
    registry.register_formation("uniform", UNIFORM)
    for path in dict.fromkeys(files):
        _register_file(registry, path)
    return registry


def _register_file(registry: Registry, path: Path) -> None:
    module = _imported(path)
    register = getattr(module, "register", None)
    if not callable(register):
        raise UsageError(f"{path} must define register(registry), which adds its filters.")
    try:
        register(registry)
    except SwarmError:
        raise
    except Exception as error:
        raise UsageError(f"{path} cannot be used: register(registry) raised {error!r}.") from error


def _imported(path: Path) -> ModuleType:
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
    return module


def _add(table: dict[str, _T], kind: str, name: str, value: _T) -> None:
    if name in table:
        raise UsageError(f"There is a {kind} called {name!r} already; choose another name.")
    table[name] = value
