"""What the ardupilot personality makes of its fences, beyond the rows of tests/conformance."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.sim.flying import (
    ACCEPTED,
    FAILED,
    GUIDED,
    LAND,
    LOITER,
    POSITION_ONLY,
    RTL,
    VELOCITY_ONLY,
    Station,
    of_type,
    simulation,
    vehicle,
)

FENCE_ENABLE = mavlink.MAV_CMD_DO_FENCE_ENABLE


def away(east_m: float, up_m: float = 30.0, **parameters: float) -> Station:
    """A vehicle that hovers east of its home, its fence off."""
    station = Station(simulation(vehicle(parameters=tuple(parameters.items()))))
    station.airborne(up_m)
    station.setpoint((east_m, 0.0, up_m), mask=POSITION_ONLY)
    station.advance(20.0 + east_m / 5.0)
    return station


def drift(station: Station, duration_s: float) -> None:
    """Fly east at 5 m/s: from outside, the fence holds nothing back."""
    for _ in range(round(duration_s)):
        station.setpoint(velocity_enu=(5.0, 0.0, 0.0), mask=VELOCITY_ONLY)
        station.advance(1.0)


def upload_square(station: Station, east_m: float) -> None:
    """Give it a fence, 20 m wide, whose middle is east of home."""
    kind = mavlink.MAV_MISSION_TYPE_FENCE
    station.send(mavlink.MAVLink_mission_count_message(1, 1, 4, kind))
    corners = ((-10.0, -10.0), (10.0, -10.0), (10.0, 10.0), (-10.0, 10.0))
    for seq, (east, north) in enumerate(corners):
        lat, lon, _ = station.world.frame.to_geodetic(east_m + east, north, 0.0)
        replies = station.send(
            mavlink.MAVLink_mission_item_int_message(
                *(1, 1, seq, mavlink.MAV_FRAME_GLOBAL_INT),
                *(mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, 0, 1, 4.0, 0.0, 0.0, 0.0),
                *(round(math.degrees(lat) * 1e7), round(math.degrees(lon) * 1e7), 0.0, kind),
            )
        )
    (ack,) = of_type("MISSION_ACK", replies)
    assert ack.type == mavlink.MAV_MISSION_ACCEPTED


def texts(station: Station) -> list[str]:
    return [message.text for message in of_type("STATUSTEXT", station.received)]


def mode(station: Station) -> int:
    return int(station.heartbeat().custom_mode)


def test_by_its_defaults_a_fence_is_100_m_high_and_300_m_wide_and_brings_it_home() -> None:
    station = away(320.0, 110.0)
    assert station.result(FENCE_ENABLE, 1) == ACCEPTED
    station.advance(0.1)
    assert mode(station) == RTL
    assert texts(station) == ["Max Alt and Circle fences breached", "Manual recovery started"]


@pytest.mark.parametrize(
    ("east_m", "up_m", "fence"),
    [
        (160.0, 30.0, {"FENCE_TYPE": 2.0, "FENCE_RADIUS": 50.0}),
        (10.0, 130.0, {"FENCE_TYPE": 1.0, "FENCE_ALT_MAX": 20.0}),
    ],
)
def test_more_than_100_m_outside_it_lands_whatever_is_set(
    east_m: float, up_m: float, fence: dict[str, float]
) -> None:
    station = away(east_m, up_m, FENCE_ACTION=1.0, **fence)
    station.result(FENCE_ENABLE, 1)
    station.advance(0.1)
    assert mode(station) == LAND


def test_from_outside_it_may_fly_in_again() -> None:
    station = away(60.0, FENCE_TYPE=2.0, FENCE_RADIUS=50.0, FENCE_ACTION=0.0)
    station.result(FENCE_ENABLE, 1)
    for _ in range(5):
        station.setpoint(velocity_enu=(-5.0, 0.0, 0.0), mask=VELOCITY_ONLY)
        station.advance(1.0)
    assert mode(station) == GUIDED
    assert station.position()[0] < 45.0
    assert texts(station)[-1] == "Fence breach cleared"


def test_20_m_farther_out_is_a_breach_again_but_not_within_10_s_of_a_change_of_the_mode() -> None:
    station = away(60.0, FENCE_TYPE=2, FENCE_RADIUS=50.0, FENCE_ACTION=1, FENCE_OPTIONS=0)
    station.result(FENCE_ENABLE, 1)
    station.advance(0.1)
    assert station.mode(GUIDED) == ACCEPTED
    heard = len(station.received)
    for _ in range(9):
        assert mode(station) == GUIDED
        drift(station, 1.0)
    drift(station, 12.0)
    assert mode(station) == RTL
    later = of_type("STATUSTEXT", station.received[heard:])
    assert "Circle fence breached" in {message.text for message in later}


def test_recovering_it_refuses_other_modes_and_says_why_until_it_is_inside() -> None:
    station = away(60.0, FENCE_TYPE=2, FENCE_RADIUS=55.0)
    station.result(FENCE_ENABLE, 1)
    station.advance(0.1)
    assert station.mode(LOITER) == FAILED
    assert texts(station)[-1] == "Mode change to LOITER failed: in fence recovery"
    station.advance(6.0)
    assert texts(station)[-1] == "Fence breach cleared"
    assert station.mode(GUIDED) == ACCEPTED


@pytest.mark.parametrize("outside", [True, False])
def test_it_does_not_arm_outside_its_fence(outside: bool) -> None:
    station = Station()
    station.advance(5.0)
    upload_square(station, 30.0 if outside else 0.0)
    station.result(FENCE_ENABLE, 1)
    station.advance(0.1)
    station.mode(GUIDED)
    assert station.arm() == (FAILED if outside else ACCEPTED)
    assert ("Arm: Vehicle breaching Polygon fence" in texts(station)) == outside
