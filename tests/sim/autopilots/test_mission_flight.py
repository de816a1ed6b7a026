"""A mission leg by leg, without any bytes."""

from __future__ import annotations

import math

from sim.autopilots.flight_tasks import FlyTo, Hold, Situation
from sim.autopilots.mission_flight import FlyLegs, Leg, Pace, legs_of
from sim.autopilots.mission_items import Item
from sim.autopilots.takeoff_and_landing import Descend, ReturnClimb, TakeOff
from sim.dynamics import Command

LANDING = Descend(True, 1.5, 0.5, 10.0)
PACE = Pace(2.5, 3.0, 2.0, LANDING, ReturnClimb(15.0, LANDING))
STILL = (0.0, 0.0, 0.0)
A, B = (10.0, 0.0, 20.0), (10.0, 10.0, 20.0)


def at(position: tuple[float, float, float], now_s: float = 0.0) -> Situation:
    return Situation(now_s, position, STILL, STILL)


def fly(
    route: FlyLegs, position: tuple[float, float, float], now_s: float = 0.0
) -> tuple[FlyLegs, Command | None]:
    task, command = route.fly(at(position, now_s))
    assert isinstance(task, FlyLegs)
    return task, command


def item(command: int, lat_e7: int = 0, hold_s: float = 0.0, frame: int = 6) -> Item:
    return Item(frame, command, hold_s, 0.0, 0.0, 0.0, lat_e7, 0, 20.0, 1)


def test_items_become_legs_and_what_is_not_flown_is_passed_over() -> None:
    items = (item(16), item(22), item(178), item(16, 5, 7.0, 0), item(16, 6, math.nan), item(21, 9))
    legs = legs_of(items, 1, lambda lat, lon, alt, home: (float(lat), float(lon), alt + home))
    assert legs == (
        Leg(1, "take_off", (0.0, 0.0, 21.0), 0.0),
        Leg(3, "fly", (5.0, 0.0, 20.0), 7.0),
        Leg(4, "fly", (6.0, 0.0, 21.0), 0.0),
        Leg(5, "level", (9.0, 0.0, 21.0), 0.0),
        Leg(5, "land", (9.0, 0.0, 21.0), 0.0),
    )


def test_a_place_is_left_when_it_was_reached_for_as_long_as_it_says() -> None:
    route = FlyLegs((Leg(0, "fly", A, 5.0), Leg(1, "fly", B, 0.0)), PACE)
    route, command = fly(route, (0.0, 0.0, 20.0))
    assert command is not None
    assert command.error_enu == (10.0, 0.0, 0.0)
    for now_s, leg in ((10.0, 0), (14.9, 0), (15.0, 1)):
        route, _ = fly(route, (8.5, 0.0, 20.0), now_s)
        assert route.at == leg
    assert isinstance(route.doing, FlyTo)
    assert route.doing.position_enu == B
    route, _ = fly(route, B, 20.0)
    assert route.leg is None
    assert route.doing == Hold(B)


def test_only_from_the_ground_a_take_off_spools_up() -> None:
    for height_m, spool_up_s in ((0.1, 3.0), (5.0, 0.0)):
        route, _ = fly(FlyLegs((Leg(0, "take_off", A, 0.0),), PACE), (1.0, 2.0, height_m))
        assert route.lifts
        assert route.doing == TakeOff((1.0, 2.0, 20.0), 0.0, spool_up_s, 2.5)
    up, _ = fly(route, (1.0, 2.0, 19.8), 9.0)  # there: it holds
    done, _ = fly(up, (1.0, 2.0, 19.8), 9.1)
    assert done.leg is None


def test_a_landing_elsewhere_is_flown_to_at_the_height_it_has() -> None:
    route = FlyLegs((Leg(0, "level", (30.0, 0.0, 0.0), 0.0), Leg(0, "land", STILL, 0.0)), PACE)
    route, command = fly(route, (0.0, 0.0, 12.0))
    assert command is not None
    assert command.error_enu == (30.0, 0.0, 0.0)
    route, command = fly(route, (29.0, 0.0, 12.0))
    assert command is not None
    assert command.velocity_enu == (0.0, 0.0, -1.5)
