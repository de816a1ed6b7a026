"""ArduCopter's rows on booting, streams, commands, modes, take-off and setpoints.

What was measured on 4.7 in development, each with its tolerance.
"""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.conformance.flying import (
    BRAKE,
    GUIDED,
    LAND,
    LOITER,
    POSITION_ONLY,
    SET_MODE,
    TAKE_OFF,
    airborne_ardupilot,
    watch,
)
from tests.conformance.harness import (
    ACCELERATION,
    ACCEPTED,
    ARMED,
    BODY,
    BODY_OFFSET,
    DENIED,
    EVERYTHING,
    FAILED,
    LOCAL_NED,
    LOCAL_OFFSET,
    POSITION,
    TICK_S,
    UNSUPPORTED,
    VELOCITY,
    YAW,
    YAW_RATE,
    Vehicle,
    count,
    of,
    only,
)

INTERVAL: int = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
ATTITUDE: int = mavlink.MAVLINK_MSG_ID_ATTITUDE
STATUS: int = mavlink.MAVLINK_MSG_ID_SYS_STATUS
DISARM: int = mavlink.MAV_CMD_COMPONENT_ARM_DISARM


# --- Boot ------------------------------------------------------------------------------


def test_reboot_is_acknowledged_and_a_heartbeat_comes_1_2_s_later(ardupilot: Vehicle) -> None:
    assert ardupilot.reboot() == pytest.approx(1.2, abs=0.6)


def test_it_is_armable_43_s_after_boot_and_knows_no_position_before(ardupilot: Vehicle) -> None:
    ardupilot.reboot()
    start = ardupilot.now
    ardupilot.stream(mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT, 5.0)
    ardupilot.stream(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 5.0)
    ardupilot.stream(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5.0)
    ardupilot.stream(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 5.0)
    early = ardupilot.wait(5.0)
    positions = [m for _, m in early if of("GLOBAL_POSITION_INT")(m)]
    assert positions
    assert {(m.lat, m.lon) for m in positions} == {(0, 0)}
    assert count("LOCAL_POSITION_NED", early) == 0
    assert {m.flags for _, m in early if of("EKF_STATUS_REPORT")(m)} == {167}
    fixed, _ = ardupilot.until(lambda m: of("GPS_RAW_INT")(m) and m.fix_type >= 3, 30.0)
    assert fixed - start == pytest.approx(10.0, abs=4.0)
    placed, _ = ardupilot.until(lambda m: of("GLOBAL_POSITION_INT")(m) and m.lat != 0, 40.0)
    assert placed - start == pytest.approx(20.0, abs=6.0)
    ready, _ = ardupilot.until(of("EKF_STATUS_REPORT", flags=831), 60.0)
    assert ready - start == pytest.approx(43.0, abs=8.0)
    assert ardupilot.result(SET_MODE, 1, GUIDED) == ACCEPTED
    assert ardupilot.arm() == ACCEPTED


# --- MessageIntervals ---------------------------------------------------------------------------


def test_only_heartbeat_timesync_and_statustext_come_unasked(ardupilot: Vehicle) -> None:
    heard = ardupilot.wait(21.0)
    assert count("HEARTBEAT", heard) in {20, 21, 22}
    assert {m.get_type() for _, m in heard} <= {"HEARTBEAT", "TIMESYNC", "STATUSTEXT"}
    assert 1 <= count("TIMESYNC", heard) <= 5


@pytest.mark.parametrize("rate_hz", [4.0, 50.0, 200.0])
def test_an_interval_is_exact(ardupilot: Vehicle, rate_hz: float) -> None:
    start = ardupilot.now
    ardupilot.stream(ATTITUDE, rate_hz)
    assert ardupilot.now - start < 0.1
    assert count("ATTITUDE", ardupilot.wait(10.0)) == pytest.approx(10.0 * rate_hz, rel=0.03)


def test_interval_minus_one_and_zero_turn_it_off_and_an_unknown_one_is_denied(
    ardupilot: Vehicle,
) -> None:
    for off in (-1, 0):
        ardupilot.stream(ATTITUDE, 10.0)
        assert ardupilot.result(INTERVAL, ATTITUDE, off) == ACCEPTED
        assert count("ATTITUDE", ardupilot.wait(2.0)) == 0
    assert ardupilot.result(INTERVAL, 60000, 1e6) == DENIED


def test_request_data_stream_overrides_intervals_set_before(ardupilot: Vehicle) -> None:
    ardupilot.stream(ATTITUDE, 20.0)
    extra1 = mavlink.MAV_DATA_STREAM_EXTRA1
    ardupilot.send(mavlink.MAVLink_request_data_stream_message(ardupilot.sysid, 1, extra1, 2, 1))
    ardupilot.wait(1.0)
    assert count("ATTITUDE", ardupilot.wait(10.0)) == pytest.approx(20, abs=2)


# --- Commands --------------------------------------------------------------------------


def test_unknown_commands_and_messages(ardupilot: Vehicle) -> None:
    assert ardupilot.result(31999) == UNSUPPORTED
    assert ardupilot.result(mavlink.MAV_CMD_REQUEST_MESSAGE, 60000) == FAILED


def test_no_answer_to_another_system_or_to_a_ping(ardupilot: Vehicle) -> None:
    ardupilot.command(31999, target=ardupilot.sysid % 200 + 1)
    ardupilot.send(mavlink.MAVLink_ping_message(1, 1, 0, 0))
    heard = ardupilot.wait(2.0)
    assert count("COMMAND_ACK", heard) == count("PING", heard) == 0


# --- Modes -----------------------------------------------------------------------------


def test_guided_is_taken_without_a_position_but_not_armed(ardupilot: Vehicle) -> None:
    ardupilot.reboot()
    assert ardupilot.result(SET_MODE, 1, GUIDED) == ACCEPTED
    assert ardupilot.heartbeat().custom_mode == GUIDED
    assert ardupilot.arm() == FAILED
    assert "Need Position Estimate" in ardupilot.latest("STATUSTEXT").text


def test_a_mode_change_sends_a_heartbeat_at_once_and_a_bad_mode_fails(ardupilot: Vehicle) -> None:
    for mode in (BRAKE, GUIDED):
        assert ardupilot.result(SET_MODE, 1, mode) == ACCEPTED
        ardupilot.wait(0.1)
        assert ardupilot.latest("HEARTBEAT").custom_mode == mode
    assert ardupilot.result(SET_MODE, 1, 99) == FAILED
    assert ardupilot.heartbeat().custom_mode == GUIDED


def test_legacy_set_mode_has_no_acknowledgement(ardupilot: Vehicle) -> None:
    ardupilot.send(mavlink.MAVLink_set_mode_message(ardupilot.sysid, 1, GUIDED))
    heard = ardupilot.wait(1.5)
    assert count("COMMAND_ACK", heard) == 0
    assert ardupilot.latest("HEARTBEAT").custom_mode == GUIDED


def test_the_prearm_bit_depends_on_the_mode(ardupilot: Vehicle) -> None:
    bits = []
    for mode in (GUIDED, LAND, GUIDED):
        assert ardupilot.result(SET_MODE, 1, mode) == ACCEPTED
        ardupilot.wait(2.0)
        health = ardupilot.request(STATUS).onboard_control_sensors_health
        bits.append(bool(health & mavlink.MAV_SYS_STATUS_PREARM_CHECK))
    assert bits == [True, False, True]


# --- Arming and take-off ---------------------------------------------------------------


def test_left_on_the_ground_it_disarms_after_10_s(ardupilot: Vehicle) -> None:
    assert ardupilot.result(SET_MODE, 1, GUIDED) == ACCEPTED
    assert ardupilot.arm() == ACCEPTED
    start = ardupilot.now
    at, _ = ardupilot.until(lambda m: of("HEARTBEAT")(m) and not m.base_mode & ARMED, 20.0)
    assert at - start == pytest.approx(10.0, abs=1.2)


def test_take_off_fails_disarmed_in_another_mode_and_airborne(ardupilot: Vehicle) -> None:
    take_off = (TAKE_OFF, 0, 0, 0, 0, 0, 0, 10.0)
    ardupilot.result(SET_MODE, 1, GUIDED)
    assert ardupilot.result(*take_off) == FAILED
    assert ardupilot.arm() == ACCEPTED
    ardupilot.result(SET_MODE, 1, LOITER)
    assert ardupilot.result(*take_off) == FAILED
    ardupilot.result(SET_MODE, 1, GUIDED)
    assert ardupilot.result(*take_off) == ACCEPTED
    ardupilot.wait(12.0)
    assert ardupilot.result(*take_off) == FAILED


def test_take_off_leaves_the_ground_after_3_4_s_and_is_at_15_m_after_10_4(
    ardupilot: Vehicle,
) -> None:
    watch(ardupilot)
    assert ardupilot.result(SET_MODE, 1, GUIDED) == ACCEPTED
    assert ardupilot.arm() == ACCEPTED
    assert ardupilot.result(TAKE_OFF, 0, 0, 0, 0, 0, 0, 15.0) == ACCEPTED
    start = ardupilot.now
    ground = mavlink.MAV_LANDED_STATE_ON_GROUND
    at, _ = ardupilot.until(
        lambda m: of("EXTENDED_SYS_STATE")(m) and m.landed_state != ground, 10.0
    )
    assert at - start == pytest.approx(3.4, abs=0.6)
    at, _ = ardupilot.until(lambda m: of("LOCAL_POSITION_NED")(m) and -m.z > 14.5, 20.0)
    assert at - start == pytest.approx(10.4, abs=1.0)


def test_a_setpoint_replaces_a_take_off_under_way(ardupilot: Vehicle) -> None:
    watch(ardupilot)
    ardupilot.result(SET_MODE, 1, GUIDED)
    assert ardupilot.arm() == ACCEPTED
    assert ardupilot.result(TAKE_OFF, 0, 0, 0, 0, 0, 0, 40.0) == ACCEPTED
    ardupilot.wait(7.0)
    ardupilot.local(POSITION_ONLY, (0.0, 0.0, -12.0))
    ardupilot.wait(12.0)
    assert -ardupilot.position()[2] == pytest.approx(12.0, abs=0.7)


def test_disarming_in_the_air_fails_unless_forced(ardupilot: Vehicle) -> None:
    airborne_ardupilot(ardupilot, 3.0)
    assert ardupilot.result(DISARM, 0) == FAILED
    assert ardupilot.armed()
    assert ardupilot.result(DISARM, 0, 21196) == ACCEPTED
    assert not ardupilot.armed()
    ardupilot.wait(5.0)


# --- Setpoints -------------------------------------------------------------------------

HERE = (0.0, 0.0, -30.0)
NORTH = (40.0, 0.0, -30.0)

TAKEN = {
    "position": (only(POSITION), LOCAL_NED),
    "position and yaw": (only(POSITION, YAW), LOCAL_NED),
    "position and velocity": (only(POSITION, VELOCITY), LOCAL_NED),
    "position, velocity and acceleration": (only(POSITION, VELOCITY, ACCELERATION), LOCAL_NED),
    "velocity": (only(VELOCITY), LOCAL_NED),
    "velocity and acceleration": (only(VELOCITY, ACCELERATION), LOCAL_NED),
    "velocity and yaw rate": (only(VELOCITY, YAW_RATE), LOCAL_NED),
    "acceleration": (only(ACCELERATION), LOCAL_NED),
    "velocity in frame 7": (only(VELOCITY), LOCAL_OFFSET),
    "velocity in frame 8": (only(VELOCITY), BODY),
    "velocity in frame 9": (only(VELOCITY), BODY_OFFSET),
}


@pytest.mark.parametrize(("mask", "frame"), TAKEN.values(), ids=TAKEN)
def test_setpoints_that_are_flown(ardupilot: Vehicle, mask: int, frame: int) -> None:
    airborne_ardupilot(ardupilot)
    for _ in range(8):
        ardupilot.local(mask, NORTH, (3.0, 0.0, 0.0), (1.0, 0.0, 0.0), frame)
        heard = ardupilot.wait(0.5)
        assert count("COMMAND_ACK", heard) == 0
    assert ardupilot.speed() > 1.5


@pytest.mark.parametrize("frame", [3, 5, 6])
def test_global_frames(ardupilot: Vehicle, frame: int) -> None:
    airborne_ardupilot(ardupilot)
    ardupilot.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    amsl = ardupilot.latest("HOME_POSITION").altitude * 1e-3
    ardupilot.global_(POSITION_ONLY, frame, 20.0, 10.0, 25.0 + (amsl if frame == 5 else 0.0))
    ardupilot.wait(20.0)
    assert ardupilot.position() == pytest.approx((20.0, 10.0, -25.0), abs=1.0)


def test_the_terrain_frame_is_taken_and_flown_wrongly(ardupilot: Vehicle) -> None:
    airborne_ardupilot(ardupilot)
    ardupilot.global_(POSITION_ONLY, 11, 20.0, 10.0, 20.0)
    ardupilot.wait(20.0)
    north, _, down = ardupilot.position()
    assert north > 5.0
    assert abs(-down - 20.0) > 2.0


STOPPING = {
    "everything ignored": EVERYTHING,
    "a position without north": only(POSITION) | 0b001,
    "a velocity without climb": only(VELOCITY) | 0b100000,
}


@pytest.mark.parametrize("mask", STOPPING.values(), ids=STOPPING)
def test_partly_or_wholly_ignored_it_stops(ardupilot: Vehicle, mask: int) -> None:
    airborne_ardupilot(ardupilot)
    ardupilot.local(POSITION_ONLY, (300.0, 0.0, -30.0))
    ardupilot.wait(5.0)
    assert ardupilot.speed() > 3.0
    ardupilot.local(mask, (300.0, 0.0, -30.0), (3.0, 0.0, 0.0))
    ardupilot.wait(8.0)
    assert ardupilot.speed() < 0.5


def test_outside_guided_setpoints_are_silently_ignored(ardupilot: Vehicle) -> None:
    airborne_ardupilot(ardupilot)
    ardupilot.result(SET_MODE, 1, BRAKE)
    ardupilot.local(POSITION_ONLY, NORTH)
    heard = ardupilot.wait(5.0)
    assert count("STATUSTEXT", heard) == 0
    assert abs(ardupilot.position()[0]) < 1.0


def test_any_system_may_command(ardupilot: Vehicle) -> None:
    airborne_ardupilot(ardupilot)
    ardupilot.local(POSITION_ONLY, NORTH, source=42)
    ardupilot.wait(5.0)
    assert ardupilot.speed() > 1.5


# --- Timeouts and following ------------------------------------------------------------


def test_a_position_is_held_for_ever(ardupilot: Vehicle) -> None:
    airborne_ardupilot(ardupilot)
    ardupilot.local(POSITION_ONLY, NORTH)
    ardupilot.wait(60.0)
    assert ardupilot.position() == pytest.approx(NORTH, abs=0.7)


def test_a_velocity_is_braked_3_7_s_after_the_last_one(ardupilot: Vehicle) -> None:
    airborne_ardupilot(ardupilot)
    for _ in range(10):
        ardupilot.local(only(VELOCITY), velocity=(4.0, 0.0, 0.0))
        ardupilot.wait(0.5)
    ardupilot.wait(2.0)  # 2.5 s after the last
    assert ardupilot.speed() == pytest.approx(4.0, abs=0.4)
    ardupilot.wait(1.6)
    assert ardupilot.speed() < 3.5
    ardupilot.wait(4.0)
    assert ardupilot.speed() < 0.4


FOLLOWING = {
    "position at 10 Hz": (only(POSITION), 10.0, 7.2, 1.0),
    "position at 1 Hz": (only(POSITION), 1.0, 9.8, 1.5),
    "position and velocity at 1 Hz": (only(POSITION, VELOCITY), 1.0, 0.1, 0.2),
}


@pytest.mark.parametrize(
    ("mask", "rate_hz", "lag_m", "within_m"), FOLLOWING.values(), ids=FOLLOWING
)
def test_how_far_it_lags_behind_a_target_at_4_mps(
    ardupilot: Vehicle, mask: int, rate_hz: float, lag_m: float, within_m: float
) -> None:
    airborne_ardupilot(ardupilot)
    start, sent, lags = ardupilot.now, 0, []
    while ardupilot.now - start < 40.0:
        if ardupilot.now - start >= sent / rate_hz - 1e-6:
            ahead = 4.0 * (ardupilot.now - start)
            ardupilot.local(mask, (ahead, 0.0, -30.0), (4.0, 0.0, 0.0))
            sent += 1
        for at, message in ardupilot.wait(TICK_S):
            if of("LOCAL_POSITION_NED")(message) and at - start > 25.0:
                lags.append(4.0 * (at - start) - ardupilot.seen(message)[0])
    assert sum(lags) / len(lags) == pytest.approx(lag_m, abs=within_m)


def test_its_speed_is_capped_by_its_parameter(ardupilot: Vehicle) -> None:
    airborne_ardupilot(ardupilot)
    cap = 0.01 * ardupilot.parameter("WPNAV_SPEED").param_value
    ardupilot.local(POSITION_ONLY, (400.0, 0.0, -30.0))
    ardupilot.wait(12.0)
    assert ardupilot.speed() == pytest.approx(cap, rel=0.1)
