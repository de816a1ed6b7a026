"""What is known of the vehicles, and the time."""

import msgspec
import pytest

from swarmctl.events import Heartbeat, HomePosition, Mode, VehicleClock, VehiclePosition
from swarmctl.frames import LocalFrame
from swarmctl.mission.fleet import Fleet, VehicleState

FRAME = LocalFrame(0.9, 0.2, 0.0)


def fleet() -> Fleet:
    return Fleet(FRAME, {1: VehicleState(1, 40.0), 2: VehicleState(2, 52.0)})


def clock(received_s: float, utc_s: float) -> VehicleClock:
    return VehicleClock(received_s=received_s, sysid=1, utc_s=utc_s, boot_s=0.0)


def test_a_vehicle_that_boots_again_has_its_clock_watched_from_there_on() -> None:
    known = fleet()
    for received, boot in ((10.0, 50.0), (11.0, 51.0), (12.0, 50.5), (20.0, 3.0), (21.0, 4.0)):
        known.observe(
            VehicleClock(received_s=received, sysid=1, utc_s=1000.0 + received, boot_s=boot)
        )
        first = known.vehicles[1].clock_first
        assert first is not None
        assert first.received_s == (10.0 if received < 20.0 else 20.0)


def position(received_s: float, epoch: float | None, up: float = 40.0) -> VehiclePosition:
    lat, lon, alt = FRAME.to_geodetic(100.0, 50.0, up)
    return VehiclePosition(
        received_s=received_s,
        sysid=1,
        boot_s=0.0,
        epoch_utc_s=epoch,
        lat_rad=lat,
        lon_rad=lon,
        alt_amsl_m=alt,
        velocity_enu=(10.0, -5.0, 1.0),
    )


def heartbeat(received_s: float, *, mode: Mode = Mode.GUIDED, armed: bool = True) -> Heartbeat:
    return Heartbeat(
        received_s=received_s,
        sysid=1,
        autopilot="ardupilot",
        is_multirotor=True,
        mode=mode,
        mode_name=mode.upper(),
        armed=armed,
    )


def test_the_rate_of_the_positions_is_told_by_the_vehicles_clock_since_it_booted() -> None:
    known = fleet()
    assert known.vehicles[1].position_hz is None
    for boots, rate_hz in ((range(100, 200), 4.0), (range(40), 10.0)):
        for n in boots:
            # They come in a bunch.
            report = position(0.0, None)
            known.observe(msgspec.structs.replace(report, boot_s=n / rate_hz))
        assert known.vehicles[1].position_hz == pytest.approx(rate_hz)


def test_the_least_delayed_clock_report_tells_the_time() -> None:
    known = fleet()
    assert known.utc(0.0) is None
    for received, delay in ((10.0, 0.5), (11.0, 0.02), (12.0, 0.3)):
        known.observe(clock(received, 1000.0 + received - delay))
    assert known.utc(20.0) == pytest.approx(1020.0 - 0.02)


def test_a_simulation_that_has_slowed_down_is_followed_within_the_window() -> None:
    known = fleet()
    for second in range(10):
        known.observe(clock(float(second), 1000.0 + second))
    for second in range(10, 15):
        known.observe(clock(float(second), 1000.0 + second - 6.0))
    assert known.utc(20.0) == pytest.approx(1014.0)


def test_a_position_is_carried_by_its_velocity() -> None:
    known = fleet()
    known.observe(position(0.0, 1000.0))
    assert known.vehicles[1].position_at(1000.2) == pytest.approx((102.0, 49.0, 40.2), abs=1e-6)
    known.observe(position(0.0, None))
    assert known.vehicles[1].position_at(1000.2) is None


def test_silence_is_that_of_the_older_of_heartbeat_and_position() -> None:
    known = fleet()
    vehicle = known.vehicles[1]
    assert vehicle.silence_s(5.0) == float("inf")
    known.observe(heartbeat(4.0))
    assert vehicle.silence_s(5.0) == 1.0
    known.observe(position(3.0, 1000.0))
    assert vehicle.silence_s(5.0) == 2.0


def test_guided_means_armed_and_in_guided_mode() -> None:
    known = fleet()
    vehicle = known.vehicles[1]
    assert not vehicle.is_guided
    for mode, armed, guided in (
        (Mode.GUIDED, True, True),
        (Mode.GUIDED, False, False),
        (Mode.LAND, True, False),
    ):
        known.observe(heartbeat(0.0, mode=mode, armed=armed))
        assert vehicle.is_guided is guided


def test_airborne_is_clearly_above_the_launch_point() -> None:
    known = fleet()
    lat, lon, alt = FRAME.to_geodetic(100.0, 50.0, 2.0)
    known.observe(HomePosition(received_s=0.0, sysid=1, lat_rad=lat, lon_rad=lon, alt_amsl_m=alt))
    for up, airborne in ((4.0, False), (6.0, True)):
        known.observe(position(0.0, 1000.0, up))
        assert known.vehicles[1].is_airborne is airborne


def test_vehicles_of_others_are_ignored() -> None:
    known = fleet()
    known.observe(VehicleClock(received_s=0.0, sysid=9, utc_s=1.0, boot_s=0.0))
    assert known.utc(0.0) is None
