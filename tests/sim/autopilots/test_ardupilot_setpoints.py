"""What is flown for which setpoint, and what makes the vehicle stop."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilots.ardupilot_setpoints import global_setpoint, local_setpoint
from sim.autopilots.flight_tasks import FlyAcceleration, FlyTo, FlyVelocity, Hold, Task
from sim.autopilots.setpoints import setpoint_yaw
from swarmctl.frames import LocalFrame
from tests.sim.flying import POSITION_AND_VELOCITY, POSITION_ONLY, VELOCITY_ONLY

FRAME = LocalFrame(math.radians(47.0), math.radians(8.0), 400.0)
HOME_ALT = 410.0
HERE = (1.0, 2.0, 3.0)
NOW, TIMEOUT = 12.0, 3.0
ACCELERATION_ONLY = 0b110000111111


def global_task(
    mask: int = POSITION_AND_VELOCITY,
    frame: int = mavlink.MAV_FRAME_GLOBAL_INT,
    lat_e7: int = 470000000,
    lon_e7: int = 80000000,
    alt: float = 450.0,
    velocity_ned: tuple[float, float, float] = (1.0, 2.0, 3.0),
) -> Task:
    message = mavlink.MAVLink_set_position_target_global_int_message(
        0, 1, 1, frame, mask, lat_e7, lon_e7, alt, *velocity_ned, 9, 9, 9, 0.5, 0
    )
    return global_setpoint(message, FRAME, HOME_ALT, HERE, NOW, TIMEOUT)


def local_task(
    frame: int,
    position_ned: tuple[float, float, float] = (10.0, 20.0, -30.0),
    velocity_ned: tuple[float, float, float] = (1.0, 2.0, 3.0),
    mask: int = POSITION_AND_VELOCITY,
    yaw_rad: float = 0.0,
) -> Task:
    message = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, frame, mask, *position_ned, *velocity_ned, 9, 9, 9, 0.5, 0
    )
    return local_setpoint(message, (100.0, 200.0, 300.0), HERE, yaw_rad, NOW, TIMEOUT)


@pytest.mark.parametrize(
    ("frame", "alt", "up_m"),
    [
        (mavlink.MAV_FRAME_GLOBAL, 450.0, 50.0),
        (mavlink.MAV_FRAME_GLOBAL_INT, 450.0, 50.0),
        (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, 50.0, 60.0),
        (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, 50.0, 60.0),
    ],
)
def test_altitudes_are_amsl_or_above_home_as_the_frame_says(
    frame: int, alt: float, up_m: float
) -> None:
    task = global_task(frame=frame, alt=alt)
    assert isinstance(task, FlyTo)
    assert task.position_enu == pytest.approx((0.0, 0.0, up_m), abs=1e-6)
    assert task.velocity_enu == (2.0, 1.0, -3.0)
    assert task.set_s == NOW


def test_north_and_east_of_a_global_position() -> None:
    task = global_task(lat_e7=470010000, lon_e7=80020000)
    assert isinstance(task, FlyTo)
    # At 47 degrees a thousandth of a degree is 111.18 m of meridian and 76.06 m of parallel.
    east, north, _ = task.position_enu
    assert north == pytest.approx(111.18, abs=0.02)
    assert east == pytest.approx(2.0 * 76.06, abs=0.02)


def test_position_alone_and_velocity_alone() -> None:
    position = global_task(POSITION_ONLY)
    assert isinstance(position, FlyTo)
    assert position.velocity_enu is None
    assert global_task(VELOCITY_ONLY) == FlyVelocity((2.0, 1.0, -3.0), NOW, TIMEOUT)


def test_acceleration_alone_is_flown() -> None:
    assert global_task(ACCELERATION_ONLY) == FlyAcceleration((9.0, 9.0, -9.0), NOW, TIMEOUT)


STOPPING_MASKS = {
    "everything ignored": 0b111111111111,
    "one position axis ignored": POSITION_ONLY | 0b100,
    "one velocity axis ignored": VELOCITY_ONLY | 0b100000,
    "position and acceleration": POSITION_ONLY & ~0b111000000,
}


@pytest.mark.parametrize("mask", STOPPING_MASKS.values(), ids=STOPPING_MASKS.keys())
def test_what_cannot_be_flown_stops_the_vehicle(mask: int) -> None:
    assert global_task(mask) == Hold()
    assert local_task(mavlink.MAV_FRAME_LOCAL_NED, mask=mask) == Hold()


def test_a_partly_ignored_position_leaves_its_velocity() -> None:
    assert isinstance(global_task(POSITION_AND_VELOCITY | 0b001), FlyVelocity)


@pytest.mark.parametrize("frame", [12, 200])
def test_an_unknown_frame_stops_the_vehicle(frame: int) -> None:
    assert global_task(frame=frame) == Hold()
    assert local_task(frame) == Hold()


def test_a_position_above_terrain_is_flown_at_the_present_height() -> None:
    task = global_task(
        POSITION_ONLY, mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT, lat_e7=470010000, alt=80.0
    )
    assert isinstance(task, FlyTo)
    assert task.position_enu[1] == pytest.approx(111.18, abs=0.02)
    assert task.position_enu[2] == pytest.approx(HERE[2], abs=0.01)


def test_impossible_numbers_stop_the_vehicle() -> None:
    nan, inf = math.nan, math.inf
    assert global_task(lat_e7=910000000) == Hold()
    assert global_task(lon_e7=-1810000000) == Hold()
    assert global_task(alt=nan) == Hold()
    assert global_task(velocity_ned=(nan, 0.0, 0.0)) == Hold()
    assert global_task(velocity_ned=(0.0, 0.0, 1000.0)) == Hold()
    local = mavlink.MAV_FRAME_LOCAL_NED
    assert local_task(local, position_ned=(inf, 0.0, 0.0)) == Hold()
    assert local_task(local, velocity_ned=(0.0, nan, 0.0)) == Hold()
    # In a group that is ignored they do no harm.
    ignored = local_task(local, position_ned=(nan, nan, nan), mask=VELOCITY_ONLY)
    assert isinstance(ignored, FlyVelocity)


def test_local_frames() -> None:
    def target(frame: int, yaw_rad: float) -> tuple[object, object]:
        task = local_task(frame, yaw_rad=yaw_rad)
        assert isinstance(task, FlyTo)
        assert task.velocity_enu is not None
        return pytest.approx(task.position_enu), pytest.approx(task.velocity_enu)

    east_yaw = math.pi / 2.0
    # From the origin (100, 200, 300): 20 east, 10 north, 30 up.
    expected = ((120.0, 210.0, 330.0), (2.0, 1.0, -3.0))
    assert target(mavlink.MAV_FRAME_LOCAL_NED, east_yaw) == expected
    # From the vehicle (1, 2, 3).
    expected = ((21.0, 12.0, 33.0), (2.0, 1.0, -3.0))
    assert target(mavlink.MAV_FRAME_LOCAL_OFFSET_NED, east_yaw) == expected
    # From the vehicle, 10 forward (east) and 20 to the right (south).
    expected = ((11.0, -18.0, 33.0), (1.0, -2.0, -3.0))
    assert target(mavlink.MAV_FRAME_BODY_NED, east_yaw) == expected
    assert target(mavlink.MAV_FRAME_BODY_OFFSET_NED, east_yaw) == expected


def test_yaw() -> None:
    def yaw(mask: int, frame: int, value: float) -> float | None:
        message = mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, frame, mask, 0, 0, 0, 0, 0, 0, 0, 0, 0, value, 0
        )
        return setpoint_yaw(message, 1.0)

    with_yaw = POSITION_AND_VELOCITY & ~(1 << 10)
    assert yaw(with_yaw, mavlink.MAV_FRAME_LOCAL_NED, 0.5) == 0.5
    assert yaw(with_yaw, mavlink.MAV_FRAME_BODY_NED, 0.5) == 1.5
    assert yaw(POSITION_AND_VELOCITY, mavlink.MAV_FRAME_LOCAL_NED, 0.5) is None
    assert yaw(with_yaw, mavlink.MAV_FRAME_LOCAL_NED, math.nan) is None
