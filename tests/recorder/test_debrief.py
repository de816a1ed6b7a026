"""The debrief on a short flight whose every figure can be worked out by hand."""

from __future__ import annotations

import itertools
import math
from typing import Literal

import msgspec
import pytest

from swarmctl import decisions, events
from swarmctl.events import Record
from swarmctl.recorder.debrief import Debrief
from swarmctl.recorder.summary import FlightFigures
from swarmctl.results import MissionResult
from tests.recorder import flight as made_up
from tests.recorder.samples import ONE_OF_EACH

FRAME, SETTINGS, UTC_S = made_up.FRAME, made_up.SETTINGS, made_up.UTC_S
START_S = 50.0
"""The controller's clock does not start at 0."""


def debrief(*records: Record) -> FlightFigures:
    it = Debrief(SETTINGS)
    for record in records:
        it.record(record)
    return it.figures()


def phase(t: float, name: str) -> Record:
    return decisions.PhaseChanged(at_s=START_S + t, phase=name, trigger="-", reason="-")


def health(t: float, status: Literal["initialising", "tracking", "degraded"]) -> Record:
    return decisions.HealthChanged(at_s=START_S + t, status=status, cause=None, detail="-")


def plan(
    t: float,
    errors: dict[int, float | None],
    reach_m: float,
    formed: bool = True,
    *,
    reference: int = 1,
    joined: bool = True,
) -> Record:
    slots = tuple(
        decisions.Slot(
            sysid=sysid,
            position_enu=(0.0, 0.0, 0.0),
            velocity_enu=(0.0, 0.0, 0.0),
            error_m=error,
            range_to_reference_m=None if sysid == reference else reach_m,
            joined=joined,
        )
        for sysid, error in errors.items()
    )
    return decisions.Plan(
        at_s=START_S + t, reference=reference, los_rad=0.0, formed=formed, slots=slots
    )


def estimate(t: float, east: float, north: float, sigma: float) -> Record:
    covariance = [0.0] * 36
    for k in range(6):
        covariance[7 * k] = sigma**2
    return decisions.EstimateMade(
        at_s=START_S + t,
        epoch_utc_s=UTC_S + t,
        position_enu=(east, north, 0.0),
        velocity_enu=(0.0, 0.0, 0.0),
        covariance=tuple(covariance),
        nis=2.0,
        rd_count=3,
    )


def position(t: float, sysid: int, east: float, north: float, up: float) -> Record:
    lat, lon, alt = FRAME.to_geodetic(east, north, up)
    return events.VehiclePosition(
        received_s=START_S + t,
        sysid=sysid,
        boot_s=t,
        epoch_utc_s=UTC_S + t,
        lat_rad=lat,
        lon_rad=lon,
        alt_amsl_m=alt,
        velocity_enu=(0.0, 0.0, 0.0),
    )


def truth(t: float, east: float, north: float) -> Record:
    lat, lon, alt = FRAME.to_geodetic(east, north, 0.0)
    return events.EmitterTruth(
        received_s=START_S + t,
        epoch_utc_s=UTC_S + t,
        lat_rad=lat,
        lon_rad=lon,
        alt_amsl_m=alt,
        velocity_enu=(0.0, 0.0, 0.0),
    )


def test_a_flight_that_has_not_begun() -> None:
    summary = debrief()
    limits = {"d_max_m": 250.0, "stand_off_m": 300.0}
    zeros = {"duration_s": 0.0, "rd_measurements": 0, "estimates": 0}
    assert {
        k: v for k, v in msgspec.structs.asdict(summary).items() if v is not None
    } == limits | zeros


def test_how_it_ended_and_how_long_it_took() -> None:
    summary = debrief(
        phase(0.0, "waiting"),
        decisions.MissionEnded(
            at_s=START_S + 321.5, result=MissionResult.LOCATED, detail="Within 3 m."
        ),
        decisions.Notice(at_s=START_S + 322.0, level="info", text="Afterwards."),
    )
    assert (summary.result, summary.detail) == ("located", "Within 3 m.")
    assert summary.duration_s == pytest.approx(321.5)


def test_an_interrupted_flight_lasts_until_its_last_record() -> None:
    summary = debrief(phase(0.0, "waiting"), phase(12.0, "checking"))
    assert (summary.result, summary.duration_s) == (None, 12.0)


def test_formation_figures_count_followers_that_have_formed_while_observing() -> None:
    summary = debrief(
        phase(0.0, "forming"),
        plan(0.0, {1: 50.0, 2: 90.0, 3: 90.0}, reach_m=400.0, formed=False),
        plan(1.0, {1: 50.0, 2: 80.0, 3: 80.0}, reach_m=390.0),  # formed, not yet observing
        phase(1.0, "approaching"),
        plan(2.0, {1: 50.0, 2: 3.0, 3: 5.0}, reach_m=240.0),
        plan(3.0, {1: 50.0, 2: None, 3: 4.0}, reach_m=241.0),
        plan(4.0, {1: 50.0, 2: 99.0, 3: 99.0}, reach_m=399.0, formed=False),
        phase(5.0, "returning"),
        plan(5.0, {1: 50.0, 2: 70.0, 3: 70.0}, reach_m=380.0),
    )
    assert summary.slot_error_rms_m == pytest.approx(math.sqrt((9 + 16 + 25) / 3))
    assert summary.max_slot_error_m == 5.0
    assert summary.max_reference_range_m == 241.0


def test_who_is_lost_or_on_his_way_back_is_not_in_the_formation() -> None:
    """And distances are from the reference UAV of the day."""
    summary = debrief(
        phase(0.0, "approaching"),
        plan(1.0, {1: None, 2: 3.0}, reach_m=240.0),
        plan(2.0, {1: 90.0, 2: 90.0}, reach_m=410.0, reference=2, joined=False),
        plan(3.0, {1: 4.0, 2: 90.0}, reach_m=250.0, reference=2),
    )
    assert summary.slot_error_rms_m == pytest.approx(math.sqrt((9 + 16) / 2))
    assert summary.max_reference_range_m == 250.0


def test_accuracy_figures_are_those_of_the_last_observed_estimate() -> None:
    summary = debrief(
        phase(0.0, "approaching"),
        estimate(1.0, 30.0, 0.0, sigma=30.0),
        estimate(2.0, 3.0, 4.0, sigma=2.5),
        phase(3.0, "returning"),
        estimate(4.0, 70.0, 0.0, sigma=1.0),
        truth(4.5, 0.0, 0.0),
    )
    assert summary.estimates == 3
    assert summary.final_error_m == pytest.approx(5.0, abs=1e-6)
    assert summary.final_sigma_m == pytest.approx(2.5)
    assert summary.nees_final == pytest.approx(4.0, abs=1e-6)
    assert summary.nees_mean == pytest.approx(4.0, abs=1e-6)
    assert summary.pcrb_final_m is None


def test_without_truth_only_the_sigma_is_known() -> None:
    summary = debrief(phase(0.0, "approaching"), estimate(1.0, 3.0, 4.0, sigma=2.5))
    assert summary.final_sigma_m == pytest.approx(2.5)
    for figure in ("final_error_m", "nees_final", "nees_mean", "pcrb_final_m", "final_range_m"):
        assert getattr(summary, figure) is None


@pytest.mark.parametrize(("late_s", "known"), [(1.9, True), (2.1, False)])
def test_the_truth_may_end_a_little_before_the_estimates(late_s: float, known: bool) -> None:
    it = Debrief(SETTINGS)
    it.record(truth(0.0, 0.0, 0.0))
    it.record(estimate(late_s, 6.0, 8.0, sigma=5.0))
    error = it.figures().final_error_m
    assert error == (pytest.approx(10.0, abs=1e-6) if known else None)
    assert it.figures() == it.figures()


def test_an_error_long_before_the_final_estimate_is_not_the_final_error() -> None:
    summary = debrief(
        truth(0.0, 0.0, 0.0), estimate(0.0, 3.0, 4.0, sigma=2.0), estimate(9.0, 3.0, 4.0, sigma=1.0)
    )
    assert summary.final_error_m is None
    assert summary.final_sigma_m == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("formed_at", "converged_at", "expected"),
    [(10.0, 25.0, 15.0), (30.0, 25.0, 0.0), (None, 25.0, None), (10.0, None, None)],
)
def test_convergence_is_timed_from_the_first_formed_plan(
    formed_at: float | None, converged_at: float | None, expected: float | None
) -> None:
    records = [phase(0.0, "approaching")]
    for t in range(1, 40):
        formed = formed_at is not None and t >= formed_at
        records.append(plan(float(t), {2: 1.0}, reach_m=200.0, formed=formed))
        converged = converged_at is not None and t >= converged_at
        records.append(estimate(float(t), 0.0, 0.0, sigma=24.9 if converged else 25.1))
    assert debrief(*records).converged_s == expected


def test_distances_are_those_of_the_airborne() -> None:
    summary = debrief(
        position(0.0, 1, 0.0, 0.0, 0.0),
        position(0.0, 2, 20.0, 0.0, 0.0),
        truth(0.0, 500.0, 0.0),
        position(1.0, 1, 100.0, 0.0, 100.0),
        position(1.0, 2, 100.0, 30.0, 140.0),
        truth(2.0, 500.0, 0.0),
    )
    assert summary.min_separation_m == pytest.approx(50.0, abs=1e-6)
    assert summary.min_standoff_m == pytest.approx(math.hypot(400.0, 100.0), abs=1e-6)


def test_a_position_without_an_epoch_is_left_out() -> None:
    airborne = position(1.0, 2, 0.0, 0.1, 50.0)
    assert isinstance(airborne, events.VehiclePosition)
    summary = debrief(
        position(0.0, 1, 0.0, 0.0, 0.0),
        position(0.0, 2, 9.0, 0.0, 0.0),
        position(1.0, 1, 0.0, 0.0, 50.0),
        msgspec.structs.replace(airborne, epoch_utc_s=None),
    )
    assert summary.min_separation_m is None


def test_range_differences_and_arrival_times_are_counted_one_by_one() -> None:
    group = made_up.range_differences(100.0)
    (arrival,) = [record for record in ONE_OF_EACH if isinstance(record, events.ArrivalTime)]
    assert debrief(group, group, arrival).rd_measurements == 2 * len(made_up.FOLLOWERS) + 1


def test_the_tracks_health_is_timed_until_the_end() -> None:
    assert debrief(phase(0.0, "waiting")).health is None
    summary = debrief(
        phase(0.0, "waiting"),
        health(10.0, "initialising"),
        health(12.0, "tracking"),
        health(20.0, "degraded"),
        health(25.0, "tracking"),
        phase(40.0, "landing"),
    )
    assert summary.health == {"initialising": 2.0, "tracking": 23.0, "degraded": 5.0}


def test_phases_are_kept_at_mission_time() -> None:
    it = Debrief(SETTINGS)
    for record in (phase(0.0, "waiting"), phase(7.5, "checking")):
        it.record(record)
    assert it.series.phases == [(0.0, "waiting"), (7.5, "checking")]


def test_every_kind_of_record_is_taken() -> None:
    for order in (ONE_OF_EACH, tuple(reversed(ONE_OF_EACH))):
        debrief(*order)


def test_a_whole_flight() -> None:
    it = Debrief(SETTINGS)
    for record in made_up.records():
        it.record(record)
    summary = it.figures()
    # By construction of the made-up flight.
    last_observed_s = 270.0 - 0.2
    assert summary.duration_s == pytest.approx(made_up.END_S)
    assert summary.final_range_m == pytest.approx(
        math.dist(made_up.emitter(last_observed_s), made_up.vehicle(1, last_observed_s)), abs=1.0
    )
    standoff = min(
        math.dist(made_up.emitter(t / 10), made_up.vehicle(sysid, t / 10))
        for t, sysid in itertools.product(range(100, 4100), (1, 2, 3, 4))
    )
    assert summary.min_standoff_m == pytest.approx(standoff, abs=1e-3)
    separation = min(
        math.dist(made_up.vehicle(a, t / 10), made_up.vehicle(b, t / 10))
        for t, (a, b) in itertools.product(range(100, 4100), itertools.combinations(range(1, 5), 2))
    )
    assert summary.min_separation_m == pytest.approx(separation, rel=0.02)
    # A bound is below the sigma of the filter that is told to be worse, and above nothing.
    assert isinstance(summary.pcrb_final_m, float)
    assert isinstance(summary.final_sigma_m, float)
    assert 0.5 < summary.pcrb_final_m < summary.final_sigma_m
    msgspec.json.encode(summary)
