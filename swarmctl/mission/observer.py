"""The estimate inside the controller: feeds the tracker, and says what guidance may rely on."""

from __future__ import annotations

from collections import deque

import numpy as np

from swarmctl.estimation.consistency import ellipse
from swarmctl.estimation.tracker import Tracker
from swarmctl.events import ArrivalTime, Estimate, RangeDifferences, VehiclePosition
from swarmctl.frames import Vector
from swarmctl.mission.model import Mission
from swarmctl.mission.target import Target

HISTORY_S = 5.0
"""Measurements up to this late are used, s."""
RATE_WINDOW_S = 5.0
"""The measurement rate is an average over this long."""
HORIZONTAL = (0, 1, 3, 4)
"""Rows of the horizontal position and velocity in the track's state."""
VERTICAL_SPEED_SIGMA_MPS = 0.001
"""The emitter floats or stands: what moves it vertically in the mission's frame is the sea, which
curves away below it by 0.4 mm in a metre of drift at 2.5 km."""


class Observer:
    """The tracker, driven by observations.

    Args:
        mission: The mission; its prior, filter and frame are used.
        hiccup_s: How much later than the positions this computer may read the measurements of
            the same time, s.

    Attributes:
        leader: System id of the UAV whose arrival times the others' are differenced against
            where it heard the burst.
        target: The estimate at the instant last given to :meth:`predict`.
        covariance: Its 6 x 6 covariance.
        last: The last update; None before any.
        last_used_s: When a range difference was last used, controller's time; None before.
        used: Range differences used.
        rereferences: Whether the feed outlives the loss of the reference UAV.
    """

    def __init__(self, mission: Mission, hiccup_s: float) -> None:
        model = mission.filter
        mean, covariance = emitter_prior(mission)
        self._tracker = Tracker(
            mean,
            covariance,
            vehicles=mission.swarm.sysids,
            sigma_p_m=model.sigma_p_m,
            process_noise=process_noise(mission),
            history_s=HISTORY_S + hiccup_s,
        )
        self._recent: deque[tuple[float, int]] = deque()
        self.leader = mission.swarm.reference
        self.last: Estimate | None = None
        self.last_used_s: float | None = None
        self.used = 0
        self.rereferences = False
        self.covariance = covariance
        self.target = _target(mean, covariance)

    @property
    def dropped(self) -> int:
        """Range differences and arrival times that could not be used."""
        dropped = self._tracker.dropped
        return dropped.total() - dropped["invalid_position"]

    @property
    def guard_firings(self) -> int:
        """Updates in which the filter had to keep its covariance positive by force."""
        return self._tracker.guard_firings

    def position(self, report: VehiclePosition, position_enu: Vector) -> None:
        """Take a vehicle's position; one without an epoch is of no use to the tracker."""
        if report.epoch_utc_s is not None:
            self._tracker.add_position(
                report.sysid, report.epoch_utc_s, position_enu, report.velocity_enu
            )

    def range_differences(self, event: RangeDifferences) -> None:
        """Take one epoch's range differences."""
        self._tracker.add_range_differences(
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
        self._tracker.add_arrival(
            event.receiver, event.burst, event.toa_s, event.toa_frac_s, event.sigma_s
        )

    def complaints(self) -> list[str]:
        """Drain what the operator should be told about arrival times that do not fit."""
        complaints = list(self._tracker.complaints)
        self._tracker.complaints.clear()
        return complaints

    def process(self, now: float) -> list[Estimate]:
        """Update the track with every measurement whose vehicles' positions are known."""
        estimates = []
        for update in self._tracker.process(self.leader):
            self.last = Estimate(
                at_s=now,
                epoch_utc_s=update.epoch_s,
                position_enu=update.position,
                velocity_enu=update.velocity,
                covariance=tuple(update.covariance.ravel().tolist()),
                nis=update.nis,
                rd_count=update.rd_count,
            )
            estimates.append(self.last)
            self.used += update.rd_count
            self.last_used_s = now
            self._recent.append((now, update.rd_count))
        while self._recent and self._recent[0][0] < now - RATE_WINDOW_S:
            self._recent.popleft()
        return estimates

    def predict(self, utc_s: float | None) -> None:
        """Predict :attr:`target` to an instant; without the time it stays what it was."""
        if utc_s is None:
            return
        state, covariance = self._tracker.predict_to(utc_s)
        self.covariance = covariance
        self.target = _target(state, covariance)

    def rate_hz(self) -> float:
        """Range differences used per second, over the last seconds."""
        return sum(count for _, count in self._recent) / RATE_WINDOW_S


def _target(state: np.ndarray, covariance: np.ndarray) -> Target:
    east, north, up, v_east, v_north, v_up = state.tolist()
    return Target(
        (east, north, up),
        (v_east, v_north, v_up),
        float(ellipse(covariance[:3, :3]).major),
        float(ellipse(covariance[3:, 3:]).major),
        (float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1])),
        covariance[np.ix_(HORIZONTAL, HORIZONTAL)],
    )


def emitter_prior(mission: Mission) -> tuple[np.ndarray, np.ndarray]:
    """Mean (6,) and covariance (6, 6) of the mission's prior on the emitter, ENU, SI."""
    prior = mission.emitter
    mean = np.zeros(6)
    mean[:3] = mission.frame.to_enu(*prior.geodetic)
    sigma = np.array(
        [
            prior.sigma_m,
            prior.sigma_m,
            prior.altitude_sigma_m,
            prior.speed_sigma_mps,
            prior.speed_sigma_mps,
            VERTICAL_SPEED_SIGMA_MPS,
        ]
    )
    return mean, np.diag(sigma**2)


def process_noise(mission: Mission) -> tuple[float, float, float]:
    """Power spectral density of the emitter's acceleration, east, north, up, m²/s³."""
    density = mission.filter.process_noise_mps_per_sqrt_s**2
    return (density, density, 0.0)
