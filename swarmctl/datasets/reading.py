"""A data set of any TDOA system, read from CSV files.

``receivers``     ``receiver,east_m,north_m,up_m[,time_s]``; with times, receivers that move
``measurements``  ``time_s,receiver_i,receiver_j,rd_m[,sigma_m]``, one line or many per epoch
``truth``         ``time_s,east_m,north_m,up_m``

``rd_m`` is a range difference (RD): the distance to receiver j minus the distance to receiver i.
``sigma_m`` is the 1-sigma of its white noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swarmctl.datasets.csv_tables import Line, lines
from swarmctl.errors import UsageError
from swarmctl.units import Array

_POSITION = ("east_m", "north_m", "up_m")
_FARTHEST_M = 1e9
"""A coordinate beyond this is a slip of the pen, or in other units, m."""
_LATEST_S = 1e11
"""A time beyond this, Unix time included, is in other units: milliseconds or less."""


@dataclass(frozen=True)
class Trajectory:
    """Positions at times, with straight lines between them.

    Attributes:
        times: (T,), s, increasing; empty if it stands still.
        positions: (T, 3), or (1, 3) if it stands still, m.
    """

    times: Array
    positions: Array

    def at(self, epoch_s: float) -> Array | None:
        """Position, (3,), m; None before the first and after the last time."""
        if not self.times.size:
            still: Array = self.positions[0]
            return still
        if not self.times[0] <= epoch_s <= self.times[-1]:
            return None
        return np.array([np.interp(epoch_s, self.times, axis) for axis in self.positions.T])


@dataclass(frozen=True)
class ReceiverPositions:
    """The receivers of a data set, and where each was.

    Attributes:
        names: Names in the order of the file; a receiver's id is its place here.
        trajectories: Where each receiver was, in the same order.
    """

    names: tuple[str, ...]
    trajectories: tuple[Trajectory, ...]


@dataclass(frozen=True, slots=True)
class Measurement:
    """One line of the measurements: one range difference.

    Attributes:
        first: Id of receiver i.
        second: Id of receiver j.
        rd_m: Distance to j minus distance to i, m.
        sigma_m: 1-sigma of its white noise, m.
    """

    first: int
    second: int
    rd_m: float
    sigma_m: float


@dataclass(frozen=True)
class Epoch:
    """Everything measured at one time.

    Attributes:
        epoch_s: The time, s.
        measurements: What was measured then; at least one.
    """

    epoch_s: float
    measurements: tuple[Measurement, ...]


# --- Reading -----------------------------------------------------------------------------


def read_receivers(path: Path) -> ReceiverPositions:
    """Read the receivers' positions.

    Raises:
        UsageError: As for :func:`~swarmctl.datasets.csv_tables.lines`; or a cell is no number,
            a receiver's times do not increase, a receiver that stands still is there twice, or
            there is only one receiver.
    """
    found: dict[str, list[tuple[float, Array]]] = {}
    moving = False
    for line in lines(path, ("receiver", *_POSITION), ("time_s",)):
        moving = "time_s" in line.cells
        own = found.setdefault(line.name_in("receiver"), [])
        if own and not moving:
            raise line.error(
                f"receiver {line.cells['receiver']!r} is there twice; one line each, or a column"
                " time_s for receivers that move, would be right."
            )
        time_s = line.number_in("time_s", largest=_LATEST_S) if moving else 0.0
        if own:
            _check_later(line, time_s, own[-1][0], f" of receiver {line.cells['receiver']!r}")
        own.append((time_s, _position(line)))
    if len(found) < 2:
        raise UsageError(f"{path}: there is one receiver; two or more make a range difference.")
    trajectories = tuple(
        Trajectory(
            np.array([time_s for time_s, _ in own] if moving else []),
            np.stack([at for _, at in own]),
        )
        for own in found.values()
    )
    return ReceiverPositions(tuple(found), trajectories)


def read_epochs(path: Path, receivers: ReceiverPositions, sigma_m: float) -> Iterator[Epoch]:
    """Read the measurements, epoch by epoch, as they are asked for.

    Args:
        path: The file.
        receivers: The receivers that may be named.
        sigma_m: 1-sigma of the white noise where the file has no column ``sigma_m``, m.

    Raises:
        UsageError: As for :func:`~swarmctl.datasets.csv_tables.lines`; or times decrease, a
            receiver is unknown or paired with itself, a pair is there twice in an epoch, or a
            cell is no number.
    """
    ids = {name: k for k, name in enumerate(receivers.names)}
    now_s = -math.inf
    gathered: list[Measurement] = []
    pairs: dict[frozenset[int], int] = {}
    for line in lines(path, ("time_s", "receiver_i", "receiver_j", "rd_m"), ("sigma_m",)):
        time_s = line.number_in("time_s", largest=_LATEST_S)
        if time_s < now_s:
            raise line.error(
                f"time_s is {time_s:.15g} after {now_s:.15g}; lines sorted by time would be right."
            )
        if time_s > now_s:
            if gathered:
                yield Epoch(now_s, tuple(gathered))
            now_s, gathered, pairs = time_s, [], {}
        measurement = _measurement(line, ids, sigma_m)
        pair = frozenset((measurement.first, measurement.second))
        if pair in pairs:
            raise line.error(
                f"the pair of receivers {line.cells['receiver_i']!r} and"
                f" {line.cells['receiver_j']!r} at time_s {time_s:.15g} is already in line"
                f" {pairs[pair]}; a pair once per time would be right."
            )
        pairs[pair] = line.number
        gathered.append(measurement)
    yield Epoch(now_s, tuple(gathered))


def read_truth(path: Path) -> Trajectory:
    """Read where the emitter really was.

    Raises:
        UsageError: As for :func:`~swarmctl.datasets.csv_tables.lines`; or a cell is no number, or
            times do not increase.
    """
    times: list[float] = []
    positions: list[Array] = []
    for line in lines(path, ("time_s", *_POSITION)):
        time_s = line.number_in("time_s", largest=_LATEST_S)
        if times:
            _check_later(line, time_s, times[-1], "")
        times.append(time_s)
        positions.append(_position(line))
    return Trajectory(np.array(times), np.stack(positions))


def _position(line: Line) -> Array:
    return np.array([line.number_in(column, largest=_FARTHEST_M) for column in _POSITION])


def _check_later(line: Line, time_s: float, before_s: float, whose: str) -> None:
    if time_s == before_s:
        raise line.error(
            f"time_s {time_s:.15g}{whose} is there twice; one line per time would be right."
        )
    if time_s < before_s:
        raise line.error(
            f"time_s{whose} is {time_s:.15g} after {before_s:.15g};"
            " lines sorted by time would be right."
        )


def _measurement(line: Line, ids: dict[str, int], sigma_m: float) -> Measurement:
    pair = []
    for column in ("receiver_i", "receiver_j"):
        name = line.name_in(column)
        if name not in ids:
            known = ", ".join(list(ids)[:12]) + (", ..." if len(ids) > 12 else "")
            raise line.error(f"{column} {name!r} is not among the receivers; there are {known}.")
        pair.append(ids[name])
    if pair[0] == pair[1]:
        raise line.error(
            f"receiver_i and receiver_j are both {line.cells['receiver_i']!r};"
            " two different receivers would be right."
        )
    if "sigma_m" in line.cells:
        sigma_m = line.number_in("sigma_m", positive=True, largest=_FARTHEST_M)
    rd_m = line.number_in("rd_m", largest=_FARTHEST_M)
    return Measurement(pair[0], pair[1], rd_m, sigma_m)
