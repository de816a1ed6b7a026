"""Uploaded missions are flown: AUTO of ArduCopter and AUTO.MISSION of PX4, over MAVLink bytes."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.sim.flying import (
    ACCEPTED,
    FAILED,
    GUIDED,
    Station,
    landed_state,
    of_type,
    simulation,
    vehicle,
)

AUTO = 3
PX4_MISSION, PX4_HOLD, PX4_RTL = (4 << 16 | sub << 24 for sub in (4, 3, 5))
TEMPORARILY_REJECTED = 1
HOME = (mavlink.MAV_CMD_NAV_WAYPOINT, 0.0, 0.0, 0.0)
UP = (mavlink.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 20.0)
EAST = (mavlink.MAV_CMD_NAV_WAYPOINT, 60.0, 0.0, 20.0)
SLOWER = (mavlink.MAV_CMD_DO_CHANGE_SPEED, 0.0, 0.0, 0.0)
NORTH = (mavlink.MAV_CMD_NAV_WAYPOINT, 60.0, 60.0, 30.0)
RETURN = (mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0, 0.0, 0.0)
DOWN = (mavlink.MAV_CMD_NAV_LAND, 20.0, 40.0, 0.0)
MISSION_START: int = mavlink.MAV_CMD_MISSION_START

Item = tuple[int, float, float, float]


def ready(autopilot: str, *items: Item) -> Station:
    """A vehicle with a mission: commands with east, north and height above home."""
    station = Station(simulation(vehicle(autopilot=autopilot)))
    station.advance(5.0)
    upload(station, *items)
    return station


def upload(station: Station, *items: Item) -> None:
    replies = station.send(mavlink.MAVLink_mission_count_message(1, 1, len(items), 0))
    for seq, (command, east, north, height) in enumerate(items):
        lat, lon = 0.0, 0.0
        if (east, north) != (0.0, 0.0):
            lat, lon, _ = station.world.frame.to_geodetic(east, north, 0.0)
        replies = station.send(
            mavlink.MAVLink_mission_item_int_message(
                *(1, 1, seq, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, command, 0, 1),
                *(0.0, 0.0, 0.0, 0.0),
                *(round(math.degrees(lat) * 1e7), round(math.degrees(lon) * 1e7), height, 0),
            )
        )
    (ack,) = of_type("MISSION_ACK", replies)
    assert ack.type == mavlink.MAV_MISSION_ACCEPTED


def start(station: Station, autopilot: str) -> None:
    if autopilot == "ardupilot":
        assert station.mode(GUIDED) == ACCEPTED
    assert station.arm() == ACCEPTED
    assert station.result(MISSION_START) == ACCEPTED


def mode(station: Station) -> int:
    return int(station.heartbeat().custom_mode)


def reached(station: Station) -> list[int]:
    return [message.seq for message in of_type("MISSION_ITEM_REACHED", station.received)]


@pytest.mark.parametrize(("autopilot", "first"), [("ardupilot", 1), ("px4", 0)])
def test_a_mission_is_flown_item_by_item_and_told(autopilot: str, first: int) -> None:
    items = (UP, EAST, SLOWER, NORTH, DOWN)
    station = ready(autopilot, *((HOME, *items) if first else items))
    start(station, autopilot)
    nearest = dict.fromkeys((EAST, NORTH), math.inf)
    for _ in range(1500):
        station.advance(0.1)
        for place in nearest:
            nearest[place] = min(nearest[place], math.dist(station.position(), place[1:]))
        if not station.armed():
            break
    station.advance(1.0)
    radius_m = 2.0 if first else 10.0
    assert max(nearest.values()) < radius_m
    x, y, z = station.position()
    assert (x, y, z) == pytest.approx((20.0, 40.0, 0.0), abs=radius_m)
    assert reached(station) == [first, first + 1, first + 3, first + 4]
    current = [m.seq for m in of_type("MISSION_CURRENT", station.received)]
    assert sorted(set(current)) == [first + i for i in (0, 1, 3, 4)]
    # The next flight begins anew.
    assert current[-1] == first


def test_ardupilot_returns_within_auto_and_px4_by_its_own_mode() -> None:
    for autopilot, items, entered in (
        ("ardupilot", (HOME, UP, EAST, RETURN), AUTO),
        ("px4", (UP, EAST, RETURN), PX4_RTL),
    ):
        station = ready(autopilot, *items)
        start(station, autopilot)
        station.advance(45.0)
        assert station.position()[0] < 50.0
        assert mode(station) == entered
        station.advance(90.0)
        assert not station.armed()
        assert math.hypot(*station.position()[:2]) < 2.0


def test_behind_the_last_item_it_holds() -> None:
    for autopilot, items, entered in (
        ("ardupilot", (HOME, UP, EAST), AUTO),
        ("px4", (UP, EAST), PX4_HOLD),
    ):
        station = ready(autopilot, *items)
        start(station, autopilot)
        station.advance(90.0)
        assert mode(station) == entered
        assert station.position() == pytest.approx((60.0, 0.0, 20.0), abs=10.0)
        assert station.armed()


def test_ardupilot_waits_on_the_ground_and_wants_a_take_off_first() -> None:
    station = ready("ardupilot")
    assert station.mode(AUTO) == FAILED  # nothing to fly
    upload(station, HOME, EAST)
    station.mode(GUIDED)
    assert station.result(MISSION_START) == FAILED  # disarmed
    station.arm()
    assert station.mode(AUTO) == FAILED
    said = [message.text for message in of_type("STATUSTEXT", station.received)]
    assert "Auto: Missing Takeoff Cmd" in said
    upload(station, HOME, UP, EAST)
    assert station.mode(AUTO) == ACCEPTED
    station.advance(5.0)
    assert landed_state(station) == mavlink.MAV_LANDED_STATE_ON_GROUND
    assert station.result(MISSION_START) == ACCEPTED
    station.advance(5.0)
    assert landed_state(station) == mavlink.MAV_LANDED_STATE_TAKEOFF


def test_ardupilot_in_the_air_goes_straight_on_with_the_item_that_is_set() -> None:
    station = ready("ardupilot", HOME, UP, EAST, NORTH)
    station.airborne(25.0)
    (current,) = [m for _, m in station.send(mavlink.MAVLink_mission_set_current_message(1, 1, 3))]
    assert (current.get_type(), current.seq) == ("MISSION_CURRENT", 3)
    assert station.mode(AUTO) == ACCEPTED
    station.advance(40.0)
    assert reached(station) == [3]
    assert station.position() == pytest.approx(NORTH[1:], abs=2.0)


def test_px4_takes_off_by_itself_and_refuses_an_empty_mission() -> None:
    station = ready("px4")
    do_set_mode = mavlink.MAV_CMD_DO_SET_MODE
    assert station.result(do_set_mode, 1, 4, 4) == TEMPORARILY_REJECTED
    upload(station, EAST)
    assert station.result(do_set_mode, 1, 4, 4) == ACCEPTED
    assert station.arm() == ACCEPTED
    station.advance(8.0)
    x, _, z = station.position()
    assert z > 5.0
    assert abs(x) < 1.0
    station.advance(40.0)
    assert reached(station) == [0]


@pytest.mark.parametrize("height", [math.nan, math.inf, -1e30])
def test_a_place_nobody_can_fly_to_is_refused(height: float) -> None:
    station = ready("px4", UP, EAST)
    station.send(mavlink.MAVLink_mission_count_message(1, 1, 1, 0))
    waypoint = (*(0.0, 0.0, 0.0, 0.0), *(470_000_000, 80_000_000), height, 0)
    replies = station.send(
        mavlink.MAVLink_mission_item_int_message(1, 1, 0, 6, EAST[0], 0, 1, *waypoint)
    )
    (ack,) = of_type("MISSION_ACK", replies)
    assert ack.type == mavlink.MAV_MISSION_INVALID
    start(station, "px4")  # what it had before
    station.advance(30.0)
    assert reached(station) == [0, 1]
