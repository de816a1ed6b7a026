"""The estimate inside the controller: feeds the track, and says what guidance may rely on."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from swarmctl import decisions
from swarmctl.decisions import Decision, HealthChanged, ReceiverEstimate
from swarmctl.errors import EstimationError
from swarmctl.estimation.estimate import Counts, Estimate
from swarmctl.estimation.feed.measurement_queue import MeasurementQueue
from swarmctl.estimation.integrity.health import Verdict, sentence
from swarmctl.events import ArrivalTime, RangeDifferences, VehiclePosition
from swarmctl.mission.accuracy_limit import accuracy_limit
from swarmctl.mission.estimate_projections import recorded, target_of
from swarmctl.mission.filter_settings import emitter_prior, new_track, receiver_errors
from swarmctl.mission.mission_file import Mission
from swarmctl.units import Vector

HISTORY_S = 5.0
"""Measurements up to this late are used, s."""
RATE_WINDOW_S = 5.0
"""The measurement rate is an average over this long."""
REPORT_S = 1.0
"""The receivers' errors are reported this often, s."""


class EmitterTracking:
    """The track of the emitter, driven by observations.

    Args:
        mission: The mission; its prior, filter and frame are used.
        hiccup_s: How much later than the positions this computer may read the measurements of
            the same time, s.

    Attributes:
        leader: System id of the UAV whose arrival times the others' are differenced against
            where it heard the burst.
        believed: The estimate at the instant last given to :meth:`predict`.
        target: What guidance is given of it.
        last: The last update; None before any.
        last_used_s: When a range difference was last used, controller's time; None before.
        restarted: Whether the track was lost and begun again.
        rereferences: Whether the feed outlives the loss of the reference UAV.
    """

    def __init__(self, mission: Mission, hiccup_s: float) -> None:
        self._track = new_track(mission)
        self._queue = MeasurementQueue(
            self._track,
            vehicles=mission.swarm.sysids,
            sigma_p_m=mission.filter.sigma_p_m,
            history_s=HISTORY_S + hiccup_s,
        )
        self._layout = receiver_errors(mission).layout(3)
        self._sysids = mission.swarm.sysids
        self._said = self._track.verdict
        self._reported_s = -math.inf
        self._recent: deque[tuple[float, int]] = deque()
        self.leader = mission.swarm.reference
        self.last: decisions.EstimateMade | None = None
        self.last_used_s: float | None = None
        self.restarted = False
        self.rereferences = False
        self.believed = Estimate(-math.inf, *emitter_prior(mission))
        self.target = target_of(self.believed)

    @property
    def verdict(self) -> Verdict:
        """The health of the track."""
        return self._said

    @property
    def counts(self) -> Counts:
        """What became of the range differences and arrival times."""
        return self._queue.counts

    def position(self, report: VehiclePosition, position_enu: Vector) -> None:
        """Take a vehicle's position; one without an epoch is of no use to the track."""
        if report.epoch_utc_s is not None:
            self._queue.add_position(
                report.sysid, report.epoch_utc_s, position_enu, report.velocity_enu
            )

    def range_differences(self, event: RangeDifferences) -> None:
        """Take one epoch's range differences."""
        self._queue.add_range_differences(
            event.epoch_utc_s,
            event.reference,
            [item.receiver for item in event.items],
            [item.rd_m for item in event.items],
            [item.sigma_m for item in event.items],
            event.rho,
        )

    def arrival(self, event: ArrivalTime) -> None:
        """Take one receiver's arrival time of a burst."""
        self.rereferences = True
        self._queue.add_arrival(
            event.receiver, event.burst, event.toa_s, event.toa_frac_s, event.sigma_s
        )

    def complaints(self) -> list[str]:
        """Drain what the operator should be told about arrival times that do not fit."""
        complaints = list(self._queue.complaints)
        self._queue.complaints.clear()
        return complaints

    def process(self, now: float) -> list[Decision]:
        """Update the track with every measurement whose vehicles' positions are known.

        Returns:
            An :class:`~swarmctl.decisions.EstimateMade` for each, and what changed about the
            track besides. A track that has diverged is begun again from the prior.
        """
        made: list[Decision] = []
        used = self._track.counts.used
        for update in self._queue.process(self.leader):
            self.last = recorded(update, now)
            made.append(self.last)
        used = self._track.counts.used - used
        if used:
            self.last_used_s = now
            self._recent.append((now, used))
        while self._recent and self._recent[0][0] < now - RATE_WINDOW_S:
            self._recent.popleft()
        made += self._examine(now)
        if made and self._layout.size and now - self._reported_s >= REPORT_S:
            self._reported_s = now
            made += self._receivers(now)
        return made

    def _examine(self, now: float) -> list[Decision]:
        """What is new about the track's health."""
        verdict, said = self._track.verdict, self._said
        self._said = verdict
        if (verdict.status, verdict.cause) == (said.status, said.cause):
            return []
        if verdict.status == "diverged":
            self._track.restart()
            self.restarted = True
        return [
            HealthChanged(
                at_s=now, status=verdict.status, cause=verdict.cause, detail=sentence(verdict)
            )
        ]

    def _receivers(self, now: float) -> list[Decision]:
        """What the receivers' errors are believed to be, against the leader's."""
        layout = self._layout
        found: list[Decision] = []
        for receiver in self._sysids:
            if receiver == self.leader:
                continue
            try:
                errors, covariance = self._track.relative(receiver, self.leader)
            except EstimationError:  # one of the two has not been heard yet
                continue
            sigma = np.sqrt(np.diagonal(covariance))

            clock_m, clock_sigma_m = _part(errors, sigma, layout.bias)
            drift_mps, drift_sigma_mps = _part(errors, sigma, layout.drift)
            first = layout.navigation
            axes = [_part(errors, sigma, None if first is None else first + k) for k in range(3)]
            found.append(
                ReceiverEstimate(
                    at_s=now,
                    epoch_utc_s=self._track.epoch_s,
                    receiver=receiver,
                    relative_to=self.leader,
                    clock_m=clock_m,
                    clock_sigma_m=clock_sigma_m,
                    drift_mps=drift_mps,
                    drift_sigma_mps=drift_sigma_mps,
                    navigation_enu=(axes[0][0], axes[1][0], axes[2][0]),
                    navigation_sigma_enu=(axes[0][1], axes[1][1], axes[2][1]),
                )
            )
        return found

    def limit(self) -> str:
        """What limits the accuracy now: one word, or a few."""
        return accuracy_limit(self._track, self.believed.P)

    def predict(self, utc_s: float | None) -> None:
        """Predict :attr:`target` to an instant; without the time it stays what it was."""
        if utc_s is None:
            return
        self.believed = self._track.believed_at(utc_s)
        self.target = target_of(self.believed)

    def rate_hz(self) -> float:
        """Range differences used per second, over the last seconds."""
        return sum(count for _, count in self._recent) / RATE_WINDOW_S


def _part(errors: np.ndarray, sigma: np.ndarray, place: int | None) -> tuple[float, float]:
    """One of a receiver's errors and its 1-sigma; 0 and 0 if it is not modelled."""
    return (0.0, 0.0) if place is None else (float(errors[place]), float(sigma[place]))
