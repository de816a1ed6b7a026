"""Where a vehicle was at a measurement's epoch.

Positions arrive at 5-10 Hz with a delay, range differences carry their own epoch, and at
20 m/s a misalignment of 100 ms is 2 m. So every vehicle keeps a short history, and its position
is interpolated with the velocities' help: the cubic Hermite polynomial, whose error in the
middle of a gap h is at most ``j h³ / 96`` for a jerk up to j (its Peano kernel): 0.1 mm at 10 Hz
and 10 m/s³, 10 mm at 2 Hz.

Plain floats: this runs several hundred times a second, and arrays of three are ten times slower.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Collection

from swarmctl.errors import EstimationError
from swarmctl.units import Vector


class PositionHistory:
    """The recent positions and velocities of one vehicle.

    Args:
        history_s: How far back from the newest sample samples are kept, s.
        max_extrapolation_s: How far from the nearest sample a position is still given, s. It
            bounds extrapolation on either end, and the use of a gap.

    Raises:
        EstimationError: One of them is negative or not a number.
    """

    def __init__(self, history_s: float, max_extrapolation_s: float) -> None:
        if not (history_s >= 0.0 and max_extrapolation_s >= 0.0):
            raise EstimationError(
                "history_s and max_extrapolation_s must not be negative; they are "
                f"{history_s} and {max_extrapolation_s}."
            )
        self._history_s = history_s
        self._reach_s = max_extrapolation_s
        self._epochs: list[float] = []
        self._samples: list[tuple[Vector, Vector]] = []

    def __len__(self) -> int:
        return len(self._epochs)

    def add(self, epoch_s: float, position_enu: Vector, velocity_enu: Vector) -> None:
        """Keep a sample, in whatever order they come.

        A second sample of the same epoch is ignored, and so is one older than the history.

        Args:
            epoch_s: Epoch of the sample, s; finite.
            position_enu: Position, m; finite.
            velocity_enu: Velocity, m/s; finite.
        """
        epochs = self._epochs
        if not epochs or epoch_s > epochs[-1]:
            epochs.append(epoch_s)
            self._samples.append((position_enu, velocity_enu))
            oldest = epoch_s - self._history_s
            if epochs[0] < oldest:
                stale = bisect_left(epochs, oldest)
                del epochs[:stale], self._samples[:stale]
        elif epoch_s >= epochs[-1] - self._history_s:
            index = bisect_left(epochs, epoch_s)
            if epochs[index] != epoch_s:
                epochs.insert(index, epoch_s)
                self._samples.insert(index, (position_enu, velocity_enu))

    def brackets(self, epoch_s: float) -> bool:
        """Whether there are samples on both sides of an epoch (or one at it)."""
        epochs = self._epochs
        return bool(epochs) and epochs[0] <= epoch_s <= epochs[-1]

    def at(self, epoch_s: float) -> Vector | None:
        """Position at an epoch, m; None if the nearest sample is too far away.

        Between two samples the cubic Hermite polynomial, outside them the end's position and
        velocity.
        """
        epochs, reach = self._epochs, self._reach_s
        if not epochs:
            return None
        index = bisect_left(epochs, epoch_s)
        if index == len(epochs) or index == 0:
            end = max(index - 1, 0)
            dt = epoch_s - epochs[end]
            if abs(dt) > reach:
                return None
            (x, y, z), (vx, vy, vz) = self._samples[end]
            return (x + vx * dt, y + vy * dt, z + vz * dt)
        before, after = epochs[index - 1], epochs[index]
        if epoch_s - before > reach and after - epoch_s > reach:
            return None
        h = after - before
        s = (epoch_s - before) / h
        # Weights of the positions (they sum to 1) and of the velocities.
        b = s * s * (3.0 - 2.0 * s)
        a = 1.0 - b
        c = h * s * (1.0 - s) * (1.0 - s)
        d = h * s * s * (s - 1.0)
        (x0, y0, z0), (u0, v0, w0) = self._samples[index - 1]
        (x1, y1, z1), (u1, v1, w1) = self._samples[index]
        return (
            a * x0 + b * x1 + c * u0 + d * u1,
            a * y0 + b * y1 + c * v0 + d * v1,
            a * z0 + b * z1 + c * w0 + d * w1,
        )


class SwarmPositions:
    """The recent positions of all vehicles, and how long to wait for the next.

    Time is the samples' epochs only: what has come of one vehicle tells how long another's
    sample of the same time is overdue.

    Args:
        history_s: As for :class:`PositionHistory`.
        max_extrapolation_s: As for :class:`PositionHistory`.
        max_wait_s: How much newer the newest position of any vehicle may get before an epoch no
            longer waits for its own vehicles' next positions, s.

    Attributes:
        newest_s: Epoch of the newest sample of any vehicle, s; minus infinity before the first.
    """

    def __init__(self, history_s: float, max_extrapolation_s: float, max_wait_s: float) -> None:
        self._history_s = history_s
        self._reach_s = max_extrapolation_s
        self._max_wait_s = max_wait_s
        self._histories: dict[int, PositionHistory] = {}
        self.newest_s = -math.inf

    def add(self, vehicle: int, epoch_s: float, position_enu: Vector, velocity_enu: Vector) -> None:
        """Keep a vehicle's sample."""
        history = self._histories.get(vehicle)
        if history is None:
            history = self._histories[vehicle] = PositionHistory(self._history_s, self._reach_s)
        history.add(epoch_s, position_enu, velocity_enu)
        self.newest_s = max(self.newest_s, epoch_s)

    def at(self, vehicle: int, epoch_s: float) -> Vector | None:
        """Position of a vehicle at an epoch, m; None if it is not known."""
        history = self._histories.get(vehicle)
        return None if history is None else history.at(epoch_s)

    def are_past(self, epoch_s: float) -> bool:
        """Whether an epoch is farther back than positions are kept."""
        return epoch_s < self.newest_s - self._history_s

    def are_far_behind(self, epoch_s: float) -> bool:
        """Whether an epoch is farther ahead of all positions than positions are kept."""
        return epoch_s > self.newest_s + self._history_s

    def is_due(self, epoch_s: float, vehicles: Collection[int]) -> bool:
        """Whether waiting any longer for these vehicles' positions at an epoch is in vain.

        Positions that never come must not let measurements pile up: one far ahead of all
        positions is due at once, and comes to nothing.
        """
        if epoch_s < self.newest_s - self._max_wait_s or self.are_far_behind(epoch_s):
            return True
        if epoch_s > self.newest_s:
            return False
        histories = self._histories
        return all(
            vehicle in histories and histories[vehicle].brackets(epoch_s) for vehicle in vehicles
        )
