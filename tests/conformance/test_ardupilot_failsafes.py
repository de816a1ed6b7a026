"""How ArduCopter behaves: failsafes, fences, parameters and uploads."""

from __future__ import annotations

import itertools
import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.conformance.flying import (
    BRAKE,
    GUIDED,
    LAND,
    LOITER,
    POSITION_ONLY,
    RTL,
    SET_MODE,
    airborne_ardupilot,
)
from tests.conformance.harness import (
    ACCEPTED,
    FAILED,
    GCS,
    OTHER,
    VELOCITY,
    Vehicle,
    count,
    of,
    only,
)

NORTH = (40.0, 0.0, -30.0)

# --- Failsafes -------------------------------------------------------------------------


def gcs_heartbeat(vehicle: Vehicle, source: int = GCS) -> None:
    vehicle.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3), source)


def test_gcs_loss_returns_after_5_s_whoever_else_speaks_and_stays(ardupilot: Vehicle) -> None:
    with ardupilot.parameters(FS_GCS_ENABLE=1):
        airborne_ardupilot(ardupilot)
        ardupilot.local(POSITION_ONLY, NORTH)
        for _ in range(10):
            gcs_heartbeat(ardupilot)
            ardupilot.wait(1.0)
        assert ardupilot.heartbeat().custom_mode == GUIDED
        gcs_heartbeat(ardupilot)
        start = ardupilot.now

        def speak() -> None:
            gcs_heartbeat(ardupilot, OTHER)
            ardupilot.local(POSITION_ONLY, NORTH, source=OTHER)

        at, _ = ardupilot.until(of("HEARTBEAT", custom_mode=RTL), 10.0, speak)
        assert at - start == pytest.approx(5.0, abs=1.2)
        for _ in range(5):
            gcs_heartbeat(ardupilot)
            ardupilot.wait(1.0)
        assert ardupilot.heartbeat().custom_mode == RTL


def test_by_default_gcs_loss_does_nothing(ardupilot: Vehicle) -> None:
    assert ardupilot.parameter("FS_GCS_ENABLE").param_value == 0.0
    airborne_ardupilot(ardupilot)
    gcs_heartbeat(ardupilot)
    ardupilot.wait(15.0)
    assert ardupilot.heartbeat().custom_mode == GUIDED


def test_gps_loss_lands_after_8_s(ardupilot: Vehicle) -> None:
    airborne_ardupilot(ardupilot)
    start = ardupilot.now
    with ardupilot.parameters(SIM_GPS1_ENABLE=0):
        at, _ = ardupilot.until(of("HEARTBEAT", custom_mode=LAND), 20.0)
        assert at - start == pytest.approx(8.0, abs=2.0)


def test_a_low_battery_does_what_is_set(ardupilot: Vehicle) -> None:
    airborne_ardupilot(ardupilot)
    with ardupilot.parameters(BATT_FS_LOW_ACT=2, SIM_BATT_VOLTAGE=10.0):
        ardupilot.until(of("HEARTBEAT", custom_mode=RTL), 30.0)


def test_loiter_without_sticks_descends_to_the_ground(ardupilot: Vehicle) -> None:
    airborne_ardupilot(ardupilot, 15.0)
    ardupilot.result(SET_MODE, 1, LOITER)
    ardupilot.until(lambda m: of("LOCAL_POSITION_NED")(m) and -m.z < 1.0, 60.0)


def square(half_m: float, vehicle: Vehicle) -> list[tuple[int, int, int, float]]:
    """Items of a fence: command, latitude, longitude, number of vertices."""
    home = vehicle.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    north = round(half_m * 1e7 / 111_320.0)
    east = round(north / math.cos(math.radians(home.latitude * 1e-7)))
    vertex = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    return [
        (vertex, home.latitude + dy * north, home.longitude + dx * east, 4.0)
        for dy, dx in ((-1, -1), (-1, 1), (1, 1), (1, -1))
    ]


def upload(vehicle: Vehicle, kind: int, items: list[tuple[int, int, int, float]]) -> int:
    """Upload items; returns the MAV_MISSION_RESULT."""
    vehicle.send(mavlink.MAVLink_mission_count_message(vehicle.sysid, 1, len(items), kind))
    frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    for seq, (command, lat, lon, param1) in enumerate(items):
        vehicle.until(of("MISSION_REQUEST", seq=seq, mission_type=kind), 2.0)
        vehicle.send(
            mavlink.MAVLink_mission_item_int_message(
                *(vehicle.sysid, 1, seq, frame, command, 0, 1, param1, 0, 0, 0),
                *(lat, lon, 20.0, kind),
            )
        )
    _, ack = vehicle.until(of("MISSION_ACK", mission_type=kind), 3.0)
    return int(ack.type)


FENCE: int = mavlink.MAV_MISSION_TYPE_FENCE
MISSION: int = mavlink.MAV_MISSION_TYPE_MISSION


def test_outside_the_fence_a_position_is_not_taken_and_a_velocity_stops_inside(
    ardupilot: Vehicle,
) -> None:
    assert upload(ardupilot, FENCE, square(50.0, ardupilot)) == 0
    try:
        with ardupilot.parameters(FENCE_TYPE=4, FENCE_ENABLE=1):
            airborne_ardupilot(ardupilot)
            ardupilot.local(POSITION_ONLY, (80.0, 0.0, -30.0))
            ardupilot.wait(8.0)
            assert abs(ardupilot.position()[0]) < 1.0
            for _ in range(60):
                ardupilot.local(only(VELOCITY), velocity=(5.0, 0.0, 0.0))
                ardupilot.wait(0.5)
            assert 40.0 < ardupilot.position()[0] < 50.0
            assert ardupilot.heartbeat().custom_mode == GUIDED
    finally:
        ardupilot.send(mavlink.MAVLink_mission_clear_all_message(ardupilot.sysid, 1, FENCE))


@pytest.mark.parametrize(("action", "entered"), [(0, GUIDED), (1, RTL), (2, LAND), (4, BRAKE)])
def test_outside_a_fence_it_does_what_is_set_and_takes_no_other_mode_until_it_is_back(
    ardupilot: Vehicle, action: int, entered: int
) -> None:
    airborne_ardupilot(ardupilot)
    ardupilot.local(POSITION_ONLY, (45.0, 0.0, -30.0))
    ardupilot.wait(20.0)
    with ardupilot.parameters(FENCE_TYPE=2, FENCE_RADIUS=35, FENCE_ACTION=action, FENCE_ENABLE=1):
        _, text = ardupilot.until(lambda m: of("STATUSTEXT")(m) and "fence breached" in m.text, 3.0)
        assert text.severity == mavlink.MAV_SEVERITY_NOTICE
        ardupilot.wait(1.5)
        assert ardupilot.heartbeat().custom_mode == entered
        if action != 0:
            assert ardupilot.result(SET_MODE, 1, LOITER) == FAILED
    ardupilot.wait(0.5)  # no fence, no recovery
    assert ardupilot.result(SET_MODE, 1, GUIDED) == ACCEPTED


def test_above_the_fence_it_comes_down_and_goes_home_below(ardupilot: Vehicle) -> None:
    assert ardupilot.parameter("FENCE_TYPE").param_value == 7.0
    assert ardupilot.parameter("FENCE_ALT_MAX").param_value == 100.0
    airborne_ardupilot(ardupilot)
    ardupilot.local(POSITION_ONLY, (60.0, 0.0, -30.0))
    ardupilot.wait(20.0)
    with ardupilot.parameters(FENCE_TYPE=1, FENCE_ALT_MAX=20, FENCE_ENABLE=1):
        ardupilot.until(of("HEARTBEAT", custom_mode=RTL), 5.0)
        _, cleared = ardupilot.until(
            lambda m: of("STATUSTEXT")(m) and "cleared" in m.text.lower(), 30.0
        )
        assert "breach" in cleared.text
        assert ardupilot.position()[0] > 50.0
        ardupilot.wait(7.0)
        north, _, down = ardupilot.position()
        assert north < 50.0
        assert 16.0 < -down < 20.0


# --- Parameters ------------------------------------------------------------------------


def test_all_parameters_come_in_a_second_and_have_old_or_new_names(ardupilot: Vehicle) -> None:
    start = ardupilot.now
    ardupilot.send(mavlink.MAVLink_param_request_list_message(ardupilot.sysid, 1))
    heard = ardupilot.wait(3.0)
    values = {m.param_id: (at, m) for at, m in heard if of("PARAM_VALUE")(m)}
    total = next(iter(values.values()))[1].param_count
    assert len(values) == total > 200
    assert {m.param_index for _, m in values.values()} == set(range(total))
    # 1350 of them take 0.9 s.
    assert max(at for at, _ in values.values()) - start < 1.5
    assert {"MAV_SYSID", "MAV_GCS_SYSID"} <= set(values) or {
        "SYSID_THISMAV",
        "SYSID_MYGCS",
    } <= set(values)


def test_a_parameter_is_echoed_as_a_float_and_an_unknown_one_is_silent(
    ardupilot: Vehicle,
) -> None:
    before = ardupilot.parameter("FS_GCS_ENABLE")
    assert before.param_type != mavlink.MAV_PARAM_TYPE_REAL32
    start = ardupilot.now
    echo = ardupilot.assign("FS_GCS_ENABLE", 1.0)
    assert ardupilot.now - start < 0.2
    assert echo.param_value == 1.0
    ardupilot.assign("FS_GCS_ENABLE", before.param_value)
    ardupilot.send(mavlink.MAVLink_param_set_message(ardupilot.sysid, 1, b"NO_SUCH", 1.0, 9))
    ardupilot.send(mavlink.MAVLink_param_request_read_message(ardupilot.sysid, 1, b"NO_SUCH", -1))
    assert count("PARAM_VALUE", ardupilot.wait(2.0)) == 0


# --- Mission, fence --------------------------------------------------------------------


def test_an_upload_is_asked_for_each_second_and_given_up_after_8(ardupilot: Vehicle) -> None:
    start = ardupilot.now
    ardupilot.send(mavlink.MAVLink_mission_count_message(ardupilot.sysid, 1, 2, MISSION))
    at, ack = ardupilot.until(of("MISSION_ACK"), 12.0)
    assert ack.type == mavlink.MAV_MISSION_OPERATION_CANCELLED
    assert at - start == pytest.approx(8.0, abs=1.0)
    asked = [t for t, m in ardupilot.heard if of("MISSION_REQUEST")(m) and t >= start]
    assert len(asked) in {7, 8, 9}
    gaps = [later - earlier for earlier, later in itertools.pairwise(asked)]
    assert gaps == pytest.approx([1.0] * len(gaps), abs=0.3)


def test_item_0_of_a_mission_is_home_and_frame_6_comes_back_as_3(ardupilot: Vehicle) -> None:
    home = ardupilot.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    waypoint = mavlink.MAV_CMD_NAV_WAYPOINT
    places = [(waypoint, home.latitude + n * 1000, home.longitude, 0.0) for n in (1, 2)]
    assert upload(ardupilot, MISSION, places) == mavlink.MAV_MISSION_ACCEPTED
    ardupilot.send(mavlink.MAVLink_mission_request_list_message(ardupilot.sysid, 1, MISSION))
    assert ardupilot.until(of("MISSION_COUNT"), 2.0)[1].count == 2
    items = []
    for seq in range(2):
        ardupilot.send(
            mavlink.MAVLink_mission_request_int_message(ardupilot.sysid, 1, seq, MISSION)
        )
        items.append(ardupilot.until(of("MISSION_ITEM_INT", seq=seq), 2.0)[1])
    assert (items[0].x, items[0].y) == pytest.approx((home.latitude, home.longitude), abs=20)
    assert (items[1].x, items[1].frame) == (home.latitude + 2000, 3)
    ardupilot.send(mavlink.MAVLink_mission_clear_all_message(ardupilot.sysid, 1, MISSION))
    assert ardupilot.until(of("MISSION_ACK"), 2.0)[1].type == mavlink.MAV_MISSION_ACCEPTED
    ardupilot.send(mavlink.MAVLink_mission_request_list_message(ardupilot.sysid, 1, MISSION))
    assert ardupilot.until(of("MISSION_COUNT"), 2.0)[1].count <= 1


def test_a_bad_fence_is_an_error(ardupilot: Vehicle) -> None:
    corners = square(50.0, ardupilot)
    assert upload(ardupilot, FENCE, corners[:3]) == mavlink.MAV_MISSION_ERROR
