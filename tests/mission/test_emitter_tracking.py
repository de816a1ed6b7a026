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


def report(observer: EmitterTracking, epoch: float | None) -> None:
    for sysid, place in PLACES.items():
        lat, lon, alt = MISSION.frame.to_geodetic(*place)
        observer.position(
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


def measure(observer: EmitterTracking, epoch: float, emitter: Vector) -> None:
    noise = np.random.default_rng(round(1000 * epoch)).normal(0.0, 3.0 / math.sqrt(2.0), 5)
    ranges = {s: math.dist(emitter, place) + noise[s] for s, place in PLACES.items()}
    observer.range_differences(
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


def arrive(observer: EmitterTracking, sysid: int, seconds: int, emitter: Vector) -> None:
    observer.arrival(
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
    observer = EmitterTracking(MISSION, 0.0)
    assert observer.target.sigma_m == 100.0
    assert observer.process(0.0) == []
    assert observer.last_used_s is None


def test_measurements_draw_the_target_to_the_emitter() -> None:
    observer = EmitterTracking(MISSION, 0.0)
    east, north, up = observer.target.position_enu
    emitter = (east + 50.0, north - 30.0, up)
    found: list[Decision] = []
    for step in range(300):
        epoch = 1000.0 + 0.1 * step
        report(observer, epoch)
        measure(observer, epoch, emitter)
        found += observer.process(0.1 * step)
    observer.predict(1030.0)
    (health,) = [decision for decision in found if isinstance(decision, HealthChanged)]
    assert health.status == "tracking"
    assert len(found) == 301
    assert observer.counts.used == 900
    assert observer.counts.dropped == 0
    assert observer.rate_hz() == pytest.approx(30.0, rel=0.03)
    error = math.dist(observer.target.position_enu[:2], emitter[:2])
    assert error < observer.target.sigma_m < 30.0


@pytest.mark.parametrize("leader", [1, 3])
def test_arrival_times_draw_it_as_range_differences_do(leader: int) -> None:
    stamped, differenced = EmitterTracking(MISSION, 0.0), EmitterTracking(MISSION, 0.0)
    stamped.leader = leader
    east, north, up = stamped.target.position_enu
    emitter = (east + 50.0, north - 30.0, up)
    for second in range(1000, 1011):
        for observer in (stamped, differenced):
            report(observer, float(second))
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
    for observer in (stamped, differenced):
        observer.predict(1010.0)
        error_m = math.dist(observer.target.position_enu, emitter)
        assert error_m < observer.target.sigma_m < 100.0


def test_receivers_that_do_not_fit_together_are_complained_of_once() -> None:
    observer = EmitterTracking(MISSION, 0.0)
    for second in range(1000, 1015):
        report(observer, float(second))
        arrive(observer, 1, second, (400.0, 700.0, 0.0))
        observer.arrival(
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
        observer.process(0.0)
    assert observer.counts.used == 0
    assert observer.counts.dropped > 10
    (complaint,) = observer.complaints()
    assert complaint.startswith("receiver 1 heard burst 1000 -0.49")
    assert observer.complaints() == []


def test_positions_without_an_epoch_are_of_no_use() -> None:
    observer = EmitterTracking(MISSION, 0.0)
    report(observer, None)
    measure(observer, 1000.0, (400.0, 700.0, 0.0))
    report(observer, 1001.0)
    assert observer.process(0.0) == []
    assert observer.counts.dropped == 3


def test_the_target_stays_while_the_time_is_unknown() -> None:
    observer = EmitterTracking(MISSION, 0.0)
    before = observer.target
    observer.predict(None)
    assert observer.target is before
