"""Where and when: geodesy, WGS-84 to and from a local east-north-up frame, and sped-up UTC.

Angles in radians, lengths in metres. The conversion goes through ECEF and is exact (the
inverse to below a tenth of a millimetre within 100 km); a flat-earth shortcut would err by
7 m at 7 km. Scalars only: a control period converts a dozen positions, and plain floats are
ten times faster there than small arrays.
"""

from __future__ import annotations

import math

from swarmctl.units import Vector

WGS84_A = 6378137.0
"""Semi-major axis, m."""
WGS84_F = 1.0 / 298.257223563
"""Flattening."""
WGS84_E2 = WGS84_F * (2.0 - WGS84_F)
"""First eccentricity squared."""


SPED_UP_FROM_UTC_S = 1_767_225_600.0
"""2026-01-01: any instant would do, as long as whoever measures and whoever flies agree on it
without a word. The later, the nearer to the date is what comes of it."""


def sped_up_utc_s(utc_s: float, speedup: float) -> float:
    """The time base of vehicles that are simulated faster than the UTC they tell, s.

    PX4's SITL tells the computer's UTC, whatever its speed-up. Its measurements then have a time
    that goes ``speedup`` times as fast and depends on nothing but that UTC: it is the same for
    every vehicle and in every process, whenever it was started.

    Args:
        utc_s: UTC, s.
        speedup: Simulated seconds per second.
    """
    return SPED_UP_FROM_UTC_S + speedup * (utc_s - SPED_UP_FROM_UTC_S)


def geodetic_to_ecef(lat_rad: float, lon_rad: float, alt_m: float) -> Vector:
    """Earth-centred, earth-fixed position (m) of a geodetic one (rad, rad, m)."""
    sin_lat, cos_lat = math.sin(lat_rad), math.cos(lat_rad)
    n = WGS84_A / math.sqrt(1.0 - WGS84_E2 * sin_lat * sin_lat)
    radius = (n + alt_m) * cos_lat
    return (
        radius * math.cos(lon_rad),
        radius * math.sin(lon_rad),
        (n * (1.0 - WGS84_E2) + alt_m) * sin_lat,
    )


def ecef_to_geodetic(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Geodetic latitude, longitude (rad) and altitude (m) of an ECEF position (m).

    Fixed-point iteration on the latitude; four rounds leave less than 1e-12 rad for
    altitudes within 100 km of the ellipsoid.
    """
    p = math.hypot(x, y)
    lat = math.atan2(z, p * (1.0 - WGS84_E2))
    for _ in range(4):
        sin_lat = math.sin(lat)
        n = WGS84_A / math.sqrt(1.0 - WGS84_E2 * sin_lat * sin_lat)
        lat = math.atan2(z + WGS84_E2 * n * sin_lat, p)
    sin_lat, cos_lat = math.sin(lat), math.cos(lat)
    n = WGS84_A / math.sqrt(1.0 - WGS84_E2 * sin_lat * sin_lat)
    alt = p * cos_lat + z * sin_lat - WGS84_A * WGS84_A / n
    return lat, math.atan2(y, x), alt


class LocalFrame:
    """East-north-up frame, tangent to the ellipsoid at an origin.

    Args:
        lat_rad: Latitude of the origin, rad.
        lon_rad: Longitude of the origin, rad.
        alt_amsl_m: Altitude of the origin, m.
    """

    __slots__ = ("_east", "_ecef", "_north", "_radius_m", "_up", "alt_amsl_m", "lat_rad", "lon_rad")

    def __init__(self, lat_rad: float, lon_rad: float, alt_amsl_m: float) -> None:
        self.lat_rad = lat_rad
        self.lon_rad = lon_rad
        self.alt_amsl_m = alt_amsl_m
        sin_lat, cos_lat = math.sin(lat_rad), math.cos(lat_rad)
        sin_lon, cos_lon = math.sin(lon_rad), math.cos(lon_rad)
        self._ecef = geodetic_to_ecef(lat_rad, lon_rad, alt_amsl_m)
        self._east = (-sin_lon, cos_lon, 0.0)
        self._north = (-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat)
        self._up = (cos_lat * cos_lon, cos_lat * sin_lon, sin_lat)
        n = WGS84_A / math.sqrt(1.0 - WGS84_E2 * sin_lat * sin_lat)
        meridian = n * (1.0 - WGS84_E2) / (1.0 - WGS84_E2 * sin_lat * sin_lat)
        self._radius_m = math.sqrt(n * meridian)

    def to_enu(self, lat_rad: float, lon_rad: float, alt_amsl_m: float) -> Vector:
        """ENU position (m) of a geodetic one (rad, rad, m)."""
        x, y, z = geodetic_to_ecef(lat_rad, lon_rad, alt_amsl_m)
        ox, oy, oz = self._ecef
        dx, dy, dz = x - ox, y - oy, z - oz
        e, n, u = self._east, self._north, self._up
        return (
            e[0] * dx + e[1] * dy,
            n[0] * dx + n[1] * dy + n[2] * dz,
            u[0] * dx + u[1] * dy + u[2] * dz,
        )

    def to_geodetic(self, east_m: float, north_m: float, up_m: float) -> tuple[float, float, float]:
        """Latitude, longitude (rad) and altitude AMSL (m) of an ENU position (m)."""
        ox, oy, oz = self._ecef
        e, n, u = self._east, self._north, self._up
        return ecef_to_geodetic(
            ox + e[0] * east_m + n[0] * north_m + u[0] * up_m,
            oy + e[1] * east_m + n[1] * north_m + u[1] * up_m,
            oz + n[2] * north_m + u[2] * up_m,
        )

    def up_at(self, east_m: float, north_m: float, alt_amsl_m: float) -> float:
        """The ``up`` coordinate (m) of a point at a given altitude AMSL above (east, north).

        The earth falls away below the tangent plane by d²/2R: 0.5 m at 2.5 km. Mean radius
        of curvature; within 2 cm at 10 km.
        """
        drop = (east_m * east_m + north_m * north_m) / (2.0 * (self._radius_m + alt_amsl_m))
        return alt_amsl_m - self.alt_amsl_m - drop
