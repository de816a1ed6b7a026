"""The tracker inside the controller."""

import math

import numpy as np
import pytest

from swarmctl.decisions import Decision, HealthChanged
from swarmctl.events import ArrivalTime, RangeDifference, RangeDifferences, VehiclePosition
from swarmctl.mission.emitter_tracking import EmitterTracking
from swarmctl.mission.filter_settings import emitter_prior, expected_enu, process_noise
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.units import SPEED_OF_LIGHT_MPS, Vector
from tests.missions import short_mission_text

MISSION = parse_mission(short_mission_text())
PLACES: dict[int, Vector] = {
    1: (0.0, 0.0, 30.0),
    2: (-100.0, 60.0, 42.0),
    3: (100.0, -60.0, 54.0),
    4: (-60.0, -100.0, 66.0),
}


def report(tracking: EmitterTracking, epoch: float | None) -> None:
    for sysid, place in PLACES.items():
        lat, lon, alt = MISSION.frame.to_geodetic(*place)
        tracking.position(
            VehiclePosition(
                received_s=0.0,
                sysid=sysid,
                boot_s=0.0,
                epoch_utc_s=epoch,
                lat_rad=lat,
                lon_rad=lon,
                alt_amsl_m=alt,
                velocity_enu=(0.0, 0.0, 0.0),
            ),
            place,
        )


def measure(tracking: EmitterTracking, epoch: float, emitter: Vector) -> None:
    noise = np.random.default_rng(round(1000 * epoch)).normal(0.0, 3.0 / math.sqrt(2.0), 5)
    ranges = {s: math.dist(emitter, place) + noise[s] for s, place in PLACES.items()}
    tracking.range_differences(
        RangeDifferences(
            received_s=0.0,
            epoch_utc_s=epoch,
            reference=1,
            items=tuple(RangeDifference(s, ranges[s] - ranges[1], 3.0) for s in (2, 3, 4)),
            rho=0.5,
            clock_sigma_s=0.0,
            seq=0,
        )
    )


def arrive(tracking: EmitterTracking, sysid: int, seconds: int, emitter: Vector) -> None:
    tracking.arrival(
        ArrivalTime(
            received_s=0.0,
            receiver=sysid,
            toa_s=seconds,
            toa_frac_s=math.dist(emitter, PLACES[sysid]) / SPEED_OF_LIGHT_MPS,
            burst=seconds,
            sigma_s=3.0 / math.sqrt(2.0) / SPEED_OF_LIGHT_MPS,
            clock_sigma_s=0.0,
            seq=0,
        )
    )


def test_the_prior_is_the_missions() -> None:
    mean, covariance = emitter_prior(MISSION)
    place = MISSION.emitter
    assert place.lat_deg is not None
    assert place.lon_deg is not None
    lat, lon = math.radians(place.lat_deg), math.radians(place.lon_deg)
    assert mean[:3] == pytest.approx(MISSION.frame.to_enu(lat, lon, place.alt_amsl_m))
    assert expected_enu(MISSION) == pytest.approx(mean[:3])
    assert np.sqrt(np.diag(covariance)) == pytest.approx([100, 100, 1, 1.5, 1.5, 0.001])
    assert process_noise(MISSION) == pytest.approx((4e-4, 4e-4, 0.0))
    tracking = EmitterTracking(MISSION, 0.0)
    assert tracking.target.sigma_m == 100.0
    assert tracking.process(0.0) == []
    assert tracking.last_used_s is None


def test_measurements_draw_the_target_to_the_emitter() -> None:
    tracking = EmitterTracking(MISSION, 0.0)
    east, north, up = tracking.target.position_enu
    emitter = (east + 50.0, north - 30.0, up)
    found: list[Decision] = []
    for step in range(300):
        epoch = 1000.0 + 0.1 * step
        report(tracking, epoch)
        measure(tracking, epoch, emitter)
        found += tracking.process(0.1 * step)
    tracking.predict(1030.0)
    (health,) = [decision for decision in found if isinstance(decision, HealthChanged)]
    assert health.status == "tracking"
    assert len(found) == 301
    assert tracking.counts.used == 900
    assert tracking.counts.dropped == 0
    assert tracking.rate_hz() == pytest.approx(30.0, rel=0.03)
    error = math.dist(tracking.target.position_enu[:2], emitter[:2])
    assert error < tracking.target.sigma_m < 30.0


@pytest.mark.parametrize("leader", [1, 3])
def test_arrival_times_draw_it_as_range_differences_do(leader: int) -> None:
    stamped, differenced = EmitterTracking(MISSION, 0.0), EmitterTracking(MISSION, 0.0)
    stamped.leader = leader
    east, north, up = stamped.target.position_enu
    emitter = (east + 50.0, north - 30.0, up)
    for second in range(1000, 1011):
        for tracking in (stamped, differenced):
            report(tracking, float(second))
        for sysid in PLACES:
            arrive(stamped, sysid, second, emitter)
        measure(differenced, float(second), emitter)
        stamped.process(0.0)
        differenced.process(0.0)
    assert (stamped.counts.used, differenced.counts.used) == (
        30,
        33,
    )  # the last burst waits for positions
    assert stamped.last is not None
    path_s = math.dist(emitter, PLACES[leader]) / SPEED_OF_LIGHT_MPS
    assert stamped.last.epoch_utc_s == pytest.approx(1009.0 + path_s, abs=1e-9)
    for tracking in (stamped, differenced):
        tracking.predict(1010.0)
        error_m = math.dist(tracking.target.position_enu, emitter)
        assert error_m < tracking.target.sigma_m < 100.0


def test_receivers_that_do_not_fit_together_are_complained_of_once() -> None:
    tracking = EmitterTracking(MISSION, 0.0)
    for second in range(1000, 1015):
        report(tracking, float(second))
        arrive(tracking, 1, second, (400.0, 700.0, 0.0))
        tracking.arrival(
            ArrivalTime(
                received_s=0.0,
                receiver=2,
                toa_s=second,
                toa_frac_s=0.5,
                burst=second,
                sigma_s=1e-8,
                clock_sigma_s=0.0,
                seq=0,
            )
        )
        tracking.process(0.0)
    assert tracking.counts.used == 0
    assert tracking.counts.dropped > 10
    (complaint,) = tracking.complaints()
    assert complaint.startswith("receiver 1 heard burst 1000 -0.49")
    assert tracking.complaints() == []


def test_positions_without_an_epoch_are_of_no_use() -> None:
    tracking = EmitterTracking(MISSION, 0.0)
    report(tracking, None)
    measure(tracking, 1000.0, (400.0, 700.0, 0.0))
    report(tracking, 1001.0)
    assert tracking.process(0.0) == []
    assert tracking.counts.dropped == 3


def test_the_target_stays_while_the_time_is_unknown() -> None:
    tracking = EmitterTracking(MISSION, 0.0)
    before = tracking.target
    tracking.predict(None)
    assert tracking.target is before
