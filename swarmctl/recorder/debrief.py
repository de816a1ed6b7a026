"""The debrief: the figures of a flight, accumulated while it flies. No I/O, no clock.

The controller never sees the true emitter. The debrief does where a simulator publishes it;
figures that need it are None without it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from swarmctl.decisions import (
    Decision,
    EstimateMade,
    HealthChanged,
    MissionEnded,
    PhaseChanged,
    Plan,
    ReceiverEstimate,
)
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.events import (
    ArrivalTime,
    EmitterTruth,
    Observation,
    RangeDifferences,
    ReceiverTruth,
    Record,
    VehiclePosition,
)
from swarmctl.frames import LocalFrame
from swarmctl.recorder.distances import Distances
from swarmctl.recorder.estimate_accuracy import Accuracy, Outcome
from swarmctl.recorder.plot_series import Extremes, FlightSeries, Series
from swarmctl.recorder.summary import FlightFigures
from swarmctl.recorder.truth import MAX_EXTRAPOLATION_S, TruthTrack
from swarmctl.units import Vector


@dataclass(frozen=True)
class DebriefSettings:
    """What the debrief has to know about the mission.

    Attributes:
        frame: The mission's local frame.
        reference: System id of the reference UAV.
        observing_phases: Names of the phases that count for accuracy and formation keeping.
        prior_mean: Prior position of the emitter, ENU, m.
        prior_covariance: Covariance of the prior on (position, velocity), (6, 6), SI.
        process_noise: Power spectral density of the emitter's acceleration that the track
            assumes, per axis, (3,), m²/s³.
        sigma_p_m: White 1-sigma of a reported UAV position per axis, m.
        errors: The receivers' errors that the track assumes besides.
        d_max_m: Limit of a follower's distance from the reference UAV, m.
        stand_off_m: Limit of any UAV's distance from the emitter, m.
    """

    frame: LocalFrame
    reference: int
    observing_phases: frozenset[str]
    prior_mean: Vector
    prior_covariance: ArrayLike
    process_noise: Sequence[float]
    sigma_p_m: float
    errors: ReceiverErrors
    d_max_m: float
    stand_off_m: float


class Debrief:
    """Accumulates the figures and series of one flight, record by record.

    Args:
        settings: What it has to know about the mission.

    Attributes:
        settings: As given.
        series: The series that the plots are drawn from.
    """

    def __init__(self, settings: DebriefSettings) -> None:
        self.settings = settings
        self.series = FlightSeries()
        self._truth = TruthTrack()
        self._accuracy = Accuracy(
            reference=settings.reference,
            prior_covariance=settings.prior_covariance,
            process_noise=settings.process_noise,
            sigma_p_m=settings.sigma_p_m,
            errors=settings.errors,
            truth=self._truth,
            series=self.series,
        )
        self._distances = Distances(self._truth, self.series)
        self._began_s: float | None = None
        self._last_s = 0.0
        self._observing = False
        self._formed_at_s: float | None = None
        self._slot_error_sq_sum = 0.0
        self._slot_errors = 0
        self._max_slot_error_m: float | None = None
        self._max_range_m: float | None = None
        self._rd_measurements = 0
        self._estimates = 0
        self._end: MissionEnded | None = None
        self._takers: dict[type[Record], Callable[[Any, float], None]] = {
            VehiclePosition: self._position,
            RangeDifferences: self._range_differences,
            ArrivalTime: self._arrival_time,
            EstimateMade: self._estimate,
            Plan: self._plan,
            EmitterTruth: self._emitter,
            PhaseChanged: self._phase,
            MissionEnded: self._mission_ended,
            ReceiverEstimate: self._receiver_estimate,
            ReceiverTruth: self._receiver_truth,
            HealthChanged: self._health_changed,
        }

    def record(self, record: Record) -> None:
        """Take the next record, in the order in which the core saw or made them.

        Commands are ignored: they carry no time and nothing that the debrief needs.
        """
        if isinstance(record, Observation):
            now = record.received_s
        elif isinstance(record, Decision):
            now = record.at_s
        else:
            return
        if self._began_s is None:
            self._began_s = now
        self._last_s = now
        take = self._takers.get(type(record))
        if take is not None:
            take(record, now - self._began_s)

    @property
    def duration_s(self) -> float:
        """Mission time from the first record to the end of the mission, or the last, s."""
        if self._began_s is None:
            return 0.0
        return (self._last_s if self._end is None else self._end.at_s) - self._began_s

    @property
    def health_spans(self) -> list[tuple[float, float, str]]:
        """Begin and end (mission time, s) of each status of the track; the last ends the flight."""
        changes = self.series.health
        ends = [*(begin for begin, _ in changes[1:]), self.duration_s]
        return [(begin, end, status) for (begin, status), end in zip(changes, ends, strict=False)]

    @property
    def final_estimate(self) -> EstimateMade | None:
        """The last estimate of the observing phases, or of the flight if it never observed."""
        return self._accuracy.final_estimate

    @property
    def final(self) -> Outcome | None:
        """The outcome of :attr:`final_estimate`; None without truth at its epoch."""
        self._settle(self._truth.latest_s + MAX_EXTRAPOLATION_S)
        return self._accuracy.final

    def figures(self) -> FlightFigures:
        """The figures of the flight so far.

        May be called at any time, and again; truth may come up to 2 s short of the end.
        """
        accuracy, final, end = self._accuracy, self.final, self._end
        health: dict[str, float] = {}
        for begin_s, end_s, status in self.health_spans:
            health[status] = health.get(status, 0.0) + end_s - begin_s
        converged_s = None
        if accuracy.converged_at_s is not None and self._formed_at_s is not None:
            converged_s = max(0.0, accuracy.converged_at_s - self._formed_at_s)
        return FlightFigures(
            result=None if end is None else end.result,
            detail=None if end is None else end.detail,
            duration_s=self.duration_s,
            final_error_m=None if final is None else final.error_m,
            final_sigma_m=accuracy.final_sigma_m,
            final_range_m=None if final is None else final.range_m,
            pcrb_final_m=None if final is None else final.bound_m,
            nees_final=None if final is None else final.nees,
            nees_mean=accuracy.nees_mean,
            converged_s=converged_s,
            slot_error_rms_m=(
                math.sqrt(self._slot_error_sq_sum / self._slot_errors)
                if self._slot_errors
                else None
            ),
            max_slot_error_m=self._max_slot_error_m,
            max_reference_range_m=self._max_range_m,
            min_separation_m=self._distances.min_separation_m,
            min_standoff_m=self._distances.min_standoff_m,
            d_max_m=self.settings.d_max_m,
            stand_off_m=self.settings.stand_off_m,
            rd_measurements=self._rd_measurements,
            estimates=self._estimates,
            health=health or None,
        )

    def _position(self, record: VehiclePosition, time_s: float) -> None:
        epoch_s = record.epoch_utc_s
        if epoch_s is None:
            return
        alt = record.alt_amsl_m
        position = self.settings.frame.to_enu(record.lat_rad, record.lon_rad, alt)
        velocity = record.velocity_enu
        self._accuracy.add_position(record.sysid, epoch_s, position, velocity)
        self._distances.add(record.sysid, time_s, epoch_s, position, velocity, alt)

    def _range_differences(self, record: RangeDifferences, _time_s: float) -> None:
        self._rd_measurements += len(record.items)

    def _arrival_time(self, _record: ArrivalTime, _time_s: float) -> None:
        self._rd_measurements += 1

    def _estimate(self, record: EstimateMade, time_s: float) -> None:
        self._estimates += 1
        self._accuracy.add_estimate(record, time_s, observing=self._observing)

    def _phase(self, record: PhaseChanged, time_s: float) -> None:
        self._observing = record.phase in self.settings.observing_phases
        self.series.phases.append((time_s, record.phase))

    def _mission_ended(self, record: MissionEnded, _time_s: float) -> None:
        self._end = record

    def _receiver_estimate(self, record: ReceiverEstimate, time_s: float) -> None:
        if record.receiver == record.relative_to:
            return
        east, north, _ = record.navigation_enu
        sigma_east, sigma_north, _ = record.navigation_sigma_enu
        self.series.receivers.setdefault(record.receiver, Series()).add(
            (
                *(time_s, record.epoch_utc_s, record.relative_to),
                *(record.clock_m, east, north),
                *(record.clock_sigma_m, sigma_east, sigma_north),
            )
        )

    def _receiver_truth(self, record: ReceiverTruth, _time_s: float) -> None:
        east, north, _ = record.navigation_enu
        self.series.receiver_truths.setdefault(record.receiver, Series()).add(
            (record.epoch_utc_s, record.clock_m, east, north)
        )

    def _health_changed(self, record: HealthChanged, time_s: float) -> None:
        self.series.health.append((time_s, record.status))

    def _emitter(self, record: EmitterTruth, time_s: float) -> None:
        position = self.settings.frame.to_enu(record.lat_rad, record.lon_rad, record.alt_amsl_m)
        self._truth.add(record.epoch_utc_s, position, record.velocity_enu)
        self.series.truth.add((time_s, *position))
        self._settle(record.epoch_utc_s)

    def _settle(self, until_s: float) -> None:
        self._accuracy.settle(until_s)
        self._distances.settle(until_s)

    def _plan(self, plan: Plan, time_s: float) -> None:
        if plan.formed and self._formed_at_s is None:
            self._formed_at_s = time_s
        references = self.series.references
        if not references or references[-1][1] != plan.reference:
            references.append((time_s, plan.reference))
            self._accuracy.reference = plan.reference
        counts = plan.formed and self._observing
        for slot in plan.slots:
            if slot.sysid == plan.reference:
                continue
            error, reach = slot.error_m, slot.range_to_reference_m
            if error is not None:
                _greatest(self.series.slot_errors, slot.sysid).add(time_s, error)
            if reach is not None:
                _greatest(self.series.ranges, slot.sysid).add(time_s, reach)
            if not (counts and slot.joined):
                continue
            if error is not None:
                self._slot_error_sq_sum += error * error
                self._slot_errors += 1
                self._max_slot_error_m = max(self._max_slot_error_m or 0.0, error)
            if reach is not None:
                self._max_range_m = max(self._max_range_m or 0.0, reach)


def _greatest(group: dict[int, Extremes], sysid: int) -> Extremes:
    extremes = group.get(sysid)
    if extremes is None:
        extremes = group[sysid] = Extremes(max)
    return extremes
