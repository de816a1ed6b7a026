"""Geodesy against positions computed another way."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmctl.frames import WGS84_A, WGS84_F, LocalFrame, ecef_to_geodetic, geodetic_to_ecef

latitudes = st.floats(-1.4, 1.4)
longitudes = st.floats(-math.pi, math.pi)
near = st.floats(-20_000, 20_000)


def test_known_points_of_the_ellipsoid() -> None:
    assert geodetic_to_ecef(0.0, 0.0, 0.0) == pytest.approx((WGS84_A, 0.0, 0.0))
    polar = WGS84_A * (1.0 - WGS84_F)
    assert geodetic_to_ecef(math.pi / 2, 0.0, 100.0) == pytest.approx(
        (0, 0, polar + 100.0), abs=1e-6
    )


@given(latitudes, longitudes, st.floats(-500, 20_000))
def test_ecef_and_back(lat: float, lon: float, alt: float) -> None:
    back = ecef_to_geodetic(*geodetic_to_ecef(lat, lon, alt))
    assert back[0] == pytest.approx(lat, abs=1e-11)
    assert math.remainder(back[1] - lon, 2 * math.pi) == pytest.approx(0.0, abs=1e-11)
    assert back[2] == pytest.approx(alt, abs=1e-4)


@given(latitudes, longitudes, near, near, st.floats(-100, 5_000))
def test_enu_and_back(lat: float, lon: float, east: float, north: float, up: float) -> None:
    frame = LocalFrame(lat, lon, 30.0)
    assert frame.to_enu(*frame.to_geodetic(east, north, up)) == pytest.approx(
        (east, north, up), abs=1e-3
    )


def test_east_is_east_and_north_is_north() -> None:
    frame = LocalFrame(math.radians(54.0), math.radians(11.0), 0.0)
    # Radii of curvature at 54 degrees, from their textbook formulas with other numbers.
    e2 = 0.00669437999014
    w = 1.0 - e2 * math.sin(math.radians(54.0)) ** 2
    prime, meridian = 6378137.0 / math.sqrt(w), 6378137.0 * (1.0 - e2) / w**1.5
    second = math.radians(1.0 / 3600.0)
    east, north, _ = frame.to_enu(math.radians(54.0), math.radians(11.0) + second, 0.0)
    assert east == pytest.approx(prime * math.cos(math.radians(54.0)) * second, rel=1e-6)
    assert north == pytest.approx(0.0, abs=1e-3)
    east, north, _ = frame.to_enu(math.radians(54.0) + second, math.radians(11.0), 0.0)
    assert east == pytest.approx(0.0, abs=1e-3)
    assert north == pytest.approx(meridian * second, rel=1e-6)


@given(latitudes, st.floats(-10_000, 10_000), st.floats(-10_000, 10_000), st.floats(-100, 3000))
def test_the_earth_falls_away_below_the_tangent_plane(
    lat: float, east: float, north: float, alt: float
) -> None:
    frame = LocalFrame(lat, 0.3, 12.0)
    up = frame.up_at(east, north, alt)
    assert frame.to_geodetic(east, north, up)[2] == pytest.approx(alt, abs=0.1)


def test_the_drop_at_two_and_a_half_kilometres_is_half_a_metre() -> None:
    assert LocalFrame(0.9, 0.2, 0.0).up_at(2500.0, 0.0, 0.0) == pytest.approx(-0.49, abs=0.005)
