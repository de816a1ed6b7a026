"""PX4's rows: what was measured on v1.16, with its tolerance."""

from __future__ import annotations

import struct

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.conformance.flying import (
    POSITION_ONLY,
    PX4_HOLD,
    PX4_LAND,
    PX4_OFFBOARD,
    PX4_POSCTL,
    PX4_RTL,
    SET_MODE,
    TAKE_OFF,
    airborne_px4,
    watch,
)
from tests.conformance.harness import (
    ACCEPTED,
    ARMED,
    BODY,
    EVERYTHING,
    LOCAL_NED,
    LOCAL_OFFSET,
    POSITION,
    TEMPORARILY_REJECTED,
    TICK_S,
    VELOCITY,
    Message,
    Vehicle,
    count,
    of,
    only,
)

UP = -20.0


def whole(value: Message) -> int:
    """The whole number in a PARAM_VALUE."""
    (number,) = struct.unpack("<i", struct.pack("<f", value.param_value))
    return int(number)


def as_float(number: int) -> float:
    """What a PARAM_SET carries for a whole number."""
    (carrier,) = struct.unpack("<f", struct.pack("<i", number))
    return float(carrier)


def fly(
    vehicle: Vehicle,
    duration_s: float,
    mask: int,
    position: tuple[float, float, float] = (0.0, 0.0, UP),
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> None:
    """Stream a setpoint at 10 Hz for a time."""
    until = vehicle.now + duration_s
    while vehicle.now < until:
        vehicle.local(mask, position, velocity)
        vehicle.wait(0.1)


def offboard(vehicle: Vehicle) -> None:
    """Airborne, then OFFBOARD at the place it is."""
    airborne_px4(vehicle)
    place = vehicle.position()
    fly(vehicle, 1.0, POSITION_ONLY, position=place)
    assert vehicle.result(SET_MODE, 1, 6) == ACCEPTED
    fly(vehicle, 1.5, POSITION_ONLY, position=place)
    assert vehicle.latest("HEARTBEAT").custom_mode == PX4_OFFBOARD


def test_it_is_armable_4_5_s_after_boot_and_rejects_arming_before(px4: Vehicle) -> None:
    silent_s = px4.reboot()
    assert silent_s < 5.0
    assert px4.arm() == TEMPORARILY_REJECTED
    start = px4.now
    while px4.arm() != ACCEPTED:
        px4.wait(0.2)
        assert px4.now - start < 20.0
    assert px4.now - start == pytest.approx(3.5, abs=2.0)


def test_it_streams_unasked(px4: Vehicle) -> None:
    heard = px4.wait(10.0)
    assert count("GLOBAL_POSITION_INT", heard) == pytest.approx(500, rel=0.1)
    assert count("LOCAL_POSITION_NED", heard) == pytest.approx(300, rel=0.1)
    assert count("HEARTBEAT", heard) in {9, 10, 11}


def test_offboard_without_setpoints_is_accepted_and_not_entered(px4: Vehicle) -> None:
    airborne_px4(px4)
    assert px4.result(SET_MODE, 1, 6) == ACCEPTED
    px4.wait(2.5)
    assert px4.latest("HEARTBEAT").custom_mode == PX4_HOLD


def test_offboard_wants_more_than_two_setpoints_a_second(px4: Vehicle) -> None:
    airborne_px4(px4)
    for _ in range(4):
        px4.local(POSITION_ONLY, (0.0, 0.0, UP))
        px4.wait(1.0)
    assert px4.result(SET_MODE, 1, 6) == ACCEPTED
    px4.wait(1.5)
    assert px4.latest("HEARTBEAT").custom_mode == PX4_HOLD


def test_the_stream_lost_it_descends_in_posctl_and_resumes_by_itself(px4: Vehicle) -> None:
    offboard(px4)
    start = px4.now
    at, heartbeat = px4.until(of("HEARTBEAT", custom_mode=PX4_POSCTL), 5.0)
    # Its heartbeats come once a second.
    assert 1.0 < at - start < 2.4
    assert heartbeat.system_status == mavlink.MAV_STATE_CRITICAL
    px4.wait(2.0)
    high = -px4.position()[2]
    px4.wait(5.0)
    assert (high + px4.position()[2]) / 5.0 == pytest.approx(0.7, abs=0.15)
    fly(px4, 3.0, POSITION_ONLY, position=(0.0, 0.0, UP))
    assert px4.latest("HEARTBEAT").custom_mode == PX4_OFFBOARD


REJECTED = {
    "everything ignored": (EVERYTHING, LOCAL_NED),
    "frame 7": (POSITION_ONLY, LOCAL_OFFSET),
    "frame 12": (POSITION_ONLY, 12),
}


@pytest.mark.parametrize(("mask", "frame"), REJECTED.values(), ids=REJECTED)
def test_setpoints_rejected_with_a_text(px4: Vehicle, mask: int, frame: int) -> None:
    px4.local(mask, (0.0, 0.0, UP), frame=frame)
    px4.until(of("STATUSTEXT"), 2.0)


def test_global_frame_3_is_rejected_with_a_text(px4: Vehicle) -> None:
    px4.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    px4.global_(POSITION_ONLY, 3, 0.0, 0.0, 20.0)
    px4.until(of("STATUSTEXT"), 2.0)


@pytest.mark.parametrize("frame", [LOCAL_NED, BODY])
def test_local_frames_that_are_flown(px4: Vehicle, frame: int) -> None:
    offboard(px4)
    until = px4.now + 4.0
    while px4.now < until:
        px4.local(only(VELOCITY), velocity=(2.0, 0.0, 0.0), frame=frame)
        px4.wait(0.1)
    assert px4.speed() == pytest.approx(2.0, abs=0.4)


@pytest.mark.parametrize("frame", [5, 6, 11])
def test_global_frames_that_are_flown(px4: Vehicle, frame: int) -> None:
    offboard(px4)
    amsl = px4.latest("HOME_POSITION").altitude * 1e-3
    until = px4.now + 15.0
    while px4.now < until:
        px4.global_(POSITION_ONLY, frame, 8.0, 4.0, 20.0 + (amsl if frame == 5 else 0.0))
        px4.wait(0.1)
    assert px4.position() == pytest.approx((8.0, 4.0, UP), abs=1.0)


def test_mavsdks_global_setpoints_are_flown(px4: Vehicle) -> None:
    offboard(px4)
    until = px4.now + 12.0
    while px4.now < until:
        px4.global_(2552, 6, 6.0, 0.0, 20.0)
        px4.wait(0.1)
    assert px4.position() == pytest.approx((6.0, 0.0, UP), abs=1.0)


def test_velocity_alone_drifts_upwards_and_a_held_height_does_not(px4: Vehicle) -> None:
    offboard(px4)
    start = -px4.position()[2]
    fly(px4, 65.0, only(VELOCITY), velocity=(0.5, 0.0, 0.0))
    drifted = -px4.position()[2]
    assert 3.0 < drifted - start < 20.0
    height_and_velocity = only(POSITION, VELOCITY) | 0b011
    fly(px4, 20.0, height_and_velocity, position=(0.0, 0.0, -drifted), velocity=(0.5, 0.0, 0.0))
    assert -px4.position()[2] == pytest.approx(drifted, abs=1.0)


def test_the_altitude_of_a_take_off_is_amsl(px4: Vehicle) -> None:
    airborne_px4(px4, 12.0)
    assert -px4.position()[2] == pytest.approx(12.0, abs=1.0)


def test_a_take_off_lower_than_it_stands_goes_to_its_default_height(px4: Vehicle) -> None:
    watch(px4)
    default = px4.parameter("MIS_TAKEOFF_ALT").param_value
    assert px4.arm() == ACCEPTED
    assert px4.result(TAKE_OFF, 0, 0, 0, 0, 0, 0, -400.0) == ACCEPTED
    px4.wait(12.0)
    assert -px4.position()[2] == pytest.approx(default, abs=1.0)


def test_left_on_the_ground_it_disarms_after_12_s(px4: Vehicle) -> None:
    assert px4.result(SET_MODE, 1, 4, 3) == ACCEPTED
    assert px4.arm() == ACCEPTED
    start = px4.now
    at, _ = px4.until(lambda m: of("HEARTBEAT")(m) and not m.base_mode & ARMED, 20.0)
    assert at - start == pytest.approx(12.0, abs=1.5)


def test_whole_numbers_are_encoded_byte_by_byte(px4: Vehicle) -> None:
    value = px4.parameter("SYS_AUTOSTART")
    assert value.param_type == mavlink.MAV_PARAM_TYPE_INT32
    assert 0 < whole(value) < 100_000
    before = px4.parameter("NAV_DLL_ACT").param_value
    assert whole(px4.assign("NAV_DLL_ACT", as_float(1))) == 1
    px4.assign("NAV_DLL_ACT", before)


@pytest.mark.parametrize(
    ("action", "entered"), [(1, PX4_OFFBOARD), (2, PX4_HOLD), (3, PX4_RTL), (5, PX4_LAND)]
)
def test_outside_a_fence_it_does_what_is_set(px4: Vehicle, action: int, entered: int) -> None:
    assert whole(px4.parameter("GF_ACTION")) == 2
    offboard(px4)
    fly(px4, 15.0, POSITION_ONLY, position=(25.0, 0.0, UP))
    with px4.parameters(GF_ACTION=as_float(action), GF_MAX_HOR_DIST=15.0):
        fly(px4, 3.0, POSITION_ONLY, position=(25.0, 0.0, UP))
        heartbeat = px4.latest("HEARTBEAT")
        assert heartbeat.custom_mode == entered
        assert (heartbeat.system_status == mavlink.MAV_STATE_CRITICAL) == (action != 1)
        texts = [m.text for _, m in px4.heard if of("STATUSTEXT")(m)]
        assert any("maximum distance to Home" in text for text in texts)


def test_it_answers_a_ping(px4: Vehicle) -> None:
    px4.send(mavlink.MAVLink_ping_message(123, 7, 0, 0))
    _, reply = px4.until(of("PING"), 2.0)
    assert (reply.time_usec, reply.seq) == (123, 7)
    px4.wait(TICK_S)
