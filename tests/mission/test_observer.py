"""The tracker inside the controller."""

import math

import numpy as np
import pytest

from swarmctl.events import RangeDifference, RangeDifferences, VehiclePosition
from swarmctl.frames import Vector
from swarmctl.mission.loading import parse_mission
from swarmctl.mission.observer import Observer, emitter_prior, process_noise
from tests.missions import short_mission_text

MISSION = parse_mission(short_mission_text())
PLACES: dict[int, Vector] = {
    1: (0.0, 0.0, 30.0),
    2: (-100.0, 60.0, 42.0),
    3: (100.0, -60.0, 54.0),
    4: (-60.0, -100.0, 66.0),
}


def report(observer: Observer, epoch: float | None) -> None:
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


def measure(observer: Observer, epoch: float, emitter: Vector) -> None:
    ranges = {sysid: math.dist(emitter, place) for sysid, place in PLACES.items()}
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


def test_the_prior_is_the_missions() -> None:
    mean, covariance = emitter_prior(MISSION)
    assert mean[:3] == pytest.approx(MISSION.frame.to_enu(*MISSION.emitter.geodetic))
    assert np.sqrt(np.diag(covariance)) == pytest.approx([100, 100, 1, 1.5, 1.5, 0.001])
    assert process_noise(MISSION) == pytest.approx((4e-4, 4e-4, 0.0))
    observer = Observer(MISSION, 0.0)
    assert observer.target.sigma_m == 100.0
    assert observer.process(0.0) == []
    assert observer.last_used_s is None


def test_measurements_draw_the_target_to_the_emitter() -> None:
    observer = Observer(MISSION, 0.0)
    east, north, up = observer.target.position_enu
    emitter = (east + 50.0, north - 30.0, up)
    found = []
    for step in range(300):
        epoch = 1000.0 + 0.1 * step
        report(observer, epoch)
        measure(observer, epoch, emitter)
        found += observer.process(0.1 * step)
    observer.predict(1030.0)
    assert len(found) == 300
    assert observer.used == 900
    assert observer.dropped == 0
    assert observer.rate_hz() == pytest.approx(30.0, rel=0.03)
    error = math.dist(observer.target.position_enu[:2], emitter[:2])
    assert error < observer.target.sigma_m < 30.0


def test_positions_without_an_epoch_are_of_no_use() -> None:
    observer = Observer(MISSION, 0.0)
    report(observer, None)
    measure(observer, 1000.0, (400.0, 700.0, 0.0))
    report(observer, 1001.0)
    assert observer.process(0.0) == []
    assert observer.dropped == 3


def test_the_target_stays_while_the_time_is_unknown() -> None:
    observer = Observer(MISSION, 0.0)
    before = observer.target
    observer.predict(None)
    assert observer.target is before
