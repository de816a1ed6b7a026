"""A recording of a TDOA system: receivers, range differences (RDs) of any pairs, the truth.

``receivers``     ``receiver,east_m,north_m,up_m[,time_s]``; with times, moving ones
``measurements``  ``time_s,receiver_i,receiver_j,rd_m[,sigma_m]``, one line or many per epoch
``truth``         ``time_s,east_m,north_m,up_m``

``rd_m`` is the distance to j minus the distance to i, ``sigma_m`` the 1-sigma of its white noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swarmctl.datasets.csv_tables import Line, lines
from swarmctl.errors import UsageError
from swarmctl.estimation.model.rows import Rows
from swarmctl.units import Array

_POSITION = ("east_m", "north_m", "up_m")
_FARTHEST_M = 1e9
"""What is further away is a slip of the pen, or in other units."""
_LATEST_S = 1e11
"""What is later, be it of Unix time, is in other units: milliseconds or less."""
LARGEST_RHO = 0.495
"""Where pairs close a loop (ab, bc, ac), a hundredth of the variance is each row's own: with
all of it the arrivals', the covariance is singular."""


@dataclass(frozen=True)
class Path3D:
    """Positions at times, with straight lines between them.

    Attributes:
        times: (T,), s, increasing; empty for what stands still.
        positions: (T, 3), or (1, 3) for what stands still, m.
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
class Receivers:
    """Who measured, and where it was.

    Attributes:
        names: In the order of the file; a receiver's id is its place here.
        paths: The path of each.
    """

    names: tuple[str, ...]
    paths: tuple[Path3D, ...]


@dataclass(frozen=True, slots=True)
class Measurement:
    """One line of the measurements.

    Attributes:
        first: Id of receiver i.
        second: Id of receiver j.
        rd_m: Distance to j minus distance to i.
        sigma_m: 1-sigma of its white noise.
    """

    first: int
    second: int
    rd_m: float
    sigma_m: float


@dataclass(frozen=True)
class Epoch:
    """Everything measured at one time.

    Attributes:
        epoch_s: s.
        measurements: At least one.
    """

    epoch_s: float
    measurements: tuple[Measurement, ...]


# --- Reading -----------------------------------------------------------------------------


def read_receivers(path: Path) -> Receivers:
    """Read the receivers' positions.

    Raises:
        UsageError: As :func:`~swarmctl.datasets.csv_tables.lines`; or a number is none, times of
            a receiver do not increase, a receiver that stands still is there twice, or there is
            only one.
    """
    found: dict[str, list[tuple[float, Array]]] = {}
    moving = False
    for line in lines(path, ("receiver", *_POSITION), ("time_s",)):
        moving = "time_s" in line.cells
        own = found.setdefault(line.name_in("receiver"), [])
        if own and not moving:
            raise line.wrong(
                f"receiver {line.cells['receiver']!r} is there twice; one line each, or a column"
                " time_s for receivers that move, would be right."
            )
        time_s = line.number_in("time_s", largest=_LATEST_S) if moving else 0.0
        if own:
            _check_later(line, time_s, own[-1][0], f" of receiver {line.cells['receiver']!r}")
        own.append((time_s, _position(line)))
    if len(found) < 2:
        raise UsageError(f"{path}: there is one receiver; two or more make a range difference.")
    paths = tuple(
        Path3D(
            np.array([time_s for time_s, _ in own] if moving else []),
            np.stack([at for _, at in own]),
        )
        for own in found.values()
    )
    return Receivers(tuple(found), paths)


def read_epochs(path: Path, receivers: Receivers, sigma_m: float) -> Iterator[Epoch]:
    """Read the measurements, epoch by epoch.

    Args:
        path: The file.
        receivers: Who may have measured.
        sigma_m: 1-sigma of the white noise where the file has no column ``sigma_m``, m.

    Raises:
        UsageError: As :func:`~swarmctl.datasets.csv_tables.lines`; or times decrease, a receiver
            is unknown or paired with itself, a pair is there twice in an epoch, or a number is
            none.
    """
    ids = {name: k for k, name in enumerate(receivers.names)}
    now_s = -math.inf
    gathered: list[Measurement] = []
    pairs: dict[frozenset[int], int] = {}
    for line in lines(path, ("time_s", "receiver_i", "receiver_j", "rd_m"), ("sigma_m",)):
        time_s = line.number_in("time_s", largest=_LATEST_S)
        if time_s < now_s:
            raise line.wrong(
                f"time_s is {time_s:.15g} after {now_s:.15g}; lines sorted by time would be right."
            )
        if time_s > now_s:
            if gathered:
                yield Epoch(now_s, tuple(gathered))
            now_s, gathered, pairs = time_s, [], {}
        measurement = _measurement(line, ids, sigma_m)
        pair = frozenset((measurement.first, measurement.second))
        if pair in pairs:
            raise line.wrong(
                f"the pair of receivers {line.cells['receiver_i']!r} and"
                f" {line.cells['receiver_j']!r} at time_s {time_s:.15g} is already in line"
                f" {pairs[pair]}; a pair once per time would be right."
            )
        pairs[pair] = line.number
        gathered.append(measurement)
    yield Epoch(now_s, tuple(gathered))


def read_truth(path: Path) -> Path3D:
    """Read where the emitter really was.

    Raises:
        UsageError: As :func:`~swarmctl.datasets.csv_tables.lines`; or a number is none, or times
            do not increase.
    """
    times: list[float] = []
    positions: list[Array] = []
    for line in lines(path, ("time_s", *_POSITION)):
        time_s = line.number_in("time_s", largest=_LATEST_S)
        if times:
            _check_later(line, time_s, times[-1], "")
        times.append(time_s)
        positions.append(_position(line))
    return Path3D(np.array(times), np.stack(positions))


def _position(line: Line) -> Array:
    return np.array([line.number_in(column, largest=_FARTHEST_M) for column in _POSITION])


def _check_later(line: Line, time_s: float, before_s: float, whose: str) -> None:
    if time_s == before_s:
        raise line.wrong(
            f"time_s {time_s:.15g}{whose} is there twice; one line per time would be right."
        )
    if time_s < before_s:
        raise line.wrong(
            f"time_s{whose} is {time_s:.15g} after {before_s:.15g};"
            " lines sorted by time would be right."
        )


def _measurement(line: Line, ids: dict[str, int], sigma_m: float) -> Measurement:
    pair = []
    for column in ("receiver_i", "receiver_j"):
        name = line.name_in(column)
        if name not in ids:
            known = ", ".join(list(ids)[:12]) + (", ..." if len(ids) > 12 else "")
            raise line.wrong(f"{column} {name!r} is not among the receivers; there are {known}.")
        pair.append(ids[name])
    if pair[0] == pair[1]:
        raise line.wrong(
            f"receiver_i and receiver_j are both {line.cells['receiver_i']!r};"
            " two different receivers would be right."
        )
    if "sigma_m" in line.cells:
        sigma_m = line.number_in("sigma_m", positive=True, largest=_FARTHEST_M)
    rd_m = line.number_in("rd_m", largest=_FARTHEST_M)
    return Measurement(pair[0], pair[1], rd_m, sigma_m)


# --- What the estimator takes ------------------------------------------------------------


def pair_covariance(first: list[int], second: list[int], sigma_m: Array, rho: float = 0.5) -> Array:
    """Covariance of the white noise of an epoch's RDs.

    The noise of receiver r's arrival has the share ``rho`` of an RD's variance, the rest is the
    pair's own. So the pairs (a, b) and (c, d) have

        sigma_ab sigma_cd [rho (d_ac - d_ad - d_bc + d_bd) + (1 - 2 rho) d_ab,cd]

    which for equal receivers, rho = ½, is all the arrivals', of variance sigma²/2 each.

    Args:
        first: Receiver i of each row, K of them.
        second: Receiver j.
        sigma_m: 1-sigma of each RD, (K,), m.
        rho: 0 (every row by itself) to ½. Where the pairs close a loop, at most 0.495.

    Returns:
        (K, K), m², positive definite.
    """
    i, j = np.array(first), np.array(second)
    ids = np.unique(np.concatenate([i, j]))
    signs = (j[:, None] == ids).astype(float) - (i[:, None] == ids)
    if np.linalg.matrix_rank(signs) < len(i):
        rho = min(rho, LARGEST_RHO)
    shares = rho * (signs @ signs.T) + (1.0 - 2.0 * rho) * np.eye(len(i))
    covariance: Array = shares * np.outer(sigma_m, sigma_m)
    return covariance


def rows_of(epoch: Epoch, receivers: Receivers, rho: float) -> tuple[Rows | None, int]:
    """An epoch as the estimator takes it.

    Args:
        epoch: What was measured.
        receivers: Where from.
        rho: As for :func:`pair_covariance`.

    Returns:
        The rows, None if there are none, and how many had to be left out because a receiver's
        position is not recorded at that time.
    """
    at = {
        receiver: receivers.paths[receiver].at(epoch.epoch_s)
        for m in epoch.measurements
        for receiver in (m.first, m.second)
    }
    known = {receiver: position for receiver, position in at.items() if position is not None}
    good = [m for m in epoch.measurements if m.first in known and m.second in known]
    left_out = len(epoch.measurements) - len(good)
    if not good:
        return None, left_out
    first, second = [m.first for m in good], [m.second for m in good]
    return Rows(
        epoch.epoch_s,
        first,
        second,
        np.stack([known[r] for r in first]),
        np.stack([known[r] for r in second]),
        np.array([m.rd_m for m in good]),
        pair_covariance(first, second, np.array([m.sigma_m for m in good]), rho),
    ), left_out
