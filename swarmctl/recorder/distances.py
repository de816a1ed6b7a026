"""The least distances of a flight: between UAVs, and from the true emitter."""

from __future__ import annotations

import math
from collections import deque

from swarmctl.recorder.plot_series import FlightSeries, Series
from swarmctl.recorder.truth import TruthTrack
from swarmctl.units import Vector

AIRBORNE_M = 3.0
"""A UAV counts as airborne this far above its first reported altitude."""
MAX_AGE_S = 1.0
"""A position older than this is not extrapolated to another vehicle's epoch."""
_WAITING = 4096
"""Positions that may wait for the truth of their epoch; beyond it the oldest are dropped."""


class _Vehicle:
    __slots__ = ("airborne", "epoch_s", "ground_m", "position", "track", "velocity")

    def __init__(self, ground_m: float, track: Series) -> None:
        self.ground_m = ground_m
        self.track = track
        self.airborne = False
        self.epoch_s = -math.inf
        self.position: Vector = (0.0, 0.0, 0.0)
        self.velocity: Vector = (0.0, 0.0, 0.0)


class Distances:
    """Least separation and least stand-off of a flight, 3-D, between airborne vehicles only.

    Args:
        truth: The true emitter; call :meth:`settle` when it has grown.
        series: Where the vehicles' tracks, launch points and stand-offs are kept.
    """

    def __init__(self, truth: TruthTrack, series: FlightSeries) -> None:
        self._truth = truth
        self._series = series
        self._vehicles: dict[int, _Vehicle] = {}
        self._waiting: deque[tuple[float, float, Vector]] = deque(maxlen=_WAITING)
        self._least_separation_sq = math.inf
        self._least_standoff_m = math.inf

    @property
    def min_separation_m(self) -> float | None:
        """Least distance between two airborne UAVs, m; None if there never were two."""
        least = math.sqrt(self._least_separation_sq)
        return least if math.isfinite(least) else None

    @property
    def min_standoff_m(self) -> float | None:
        """Least distance of an airborne UAV from the true emitter, m; None without truth."""
        return self._least_standoff_m if math.isfinite(self._least_standoff_m) else None

    def add(
        self,
        sysid: int,
        time_s: float,
        epoch_s: float,
        position: Vector,
        velocity: Vector,
        alt_amsl_m: float,
    ) -> None:
        """Take a reported position.

        Args:
            sysid: System id.
            time_s: Mission time of its arrival, s.
            epoch_s: UTC of the sample, s.
            position: ENU, m.
            velocity: ENU, m/s.
            alt_amsl_m: Altitude, m.
        """
        me = self._vehicles.get(sysid)
        if me is None:
            track = self._series.tracks[sysid] = Series()
            self._series.launches[sysid] = position
            me = self._vehicles[sysid] = _Vehicle(alt_amsl_m, track)
        if time_s >= me.track.due_s:
            me.track.add((time_s, *position))
        me.airborne = alt_amsl_m > me.ground_m + AIRBORNE_M
        me.epoch_s, me.position, me.velocity = epoch_s, position, velocity
        if me.airborne:
            self._separate(me)
            self._waiting.append((epoch_s, time_s, position))

    def settle(self, until_s: float) -> None:
        """Compare with the truth all positions up to an epoch (UTC, s) that it covers."""
        waiting, truth_at = self._waiting, self._truth.at
        standoffs = self._series.standoffs
        while waiting and waiting[0][0] <= until_s:
            epoch_s, time_s, (x, y, z) = waiting.popleft()
            x0, y0, z0 = truth_at(epoch_s)
            dx, dy, dz = x - x0, y - y0, z - z0
            distance = math.sqrt(dx * dx + dy * dy + dz * dz)
            self._least_standoff_m = min(self._least_standoff_m, distance)
            standoffs.add(time_s, distance)

    def _separate(self, me: _Vehicle) -> None:
        x, y, z = me.position
        least = self._least_separation_sq
        for other in self._vehicles.values():
            if other is me or not other.airborne:
                continue
            dt = me.epoch_s - other.epoch_s
            if not -MAX_AGE_S <= dt <= MAX_AGE_S:
                continue
            (xo, yo, zo), (vx, vy, vz) = other.position, other.velocity
            dx, dy, dz = x - xo - vx * dt, y - yo - vy * dt, z - zo - vz * dt
            distance_sq = dx * dx + dy * dy + dz * dz
            least = min(least, distance_sq)
        self._least_separation_sq = least
