"""The geometry of a geofence: what is inside, how far out, how fast towards an edge."""

from __future__ import annotations

import math

import msgspec

from sim.dynamics import approach_speed
from swarmctl.units import Vector

Point = tuple[float, float]
Polygon = tuple[Point, ...]
Circle = tuple[float, float, float]
"""East and north of the centre and the radius, m."""

BRAKING_MPS2 = 1.0
"""Deceleration that the allowed speed towards an edge counts on, m/s²."""
GAIN_PER_S = 1.0
"""Allowed speed towards a near edge per distance, 1/s."""


class Fence(msgspec.Struct, frozen=True, gc=False):
    """A geofence in ENU, m; without edges it allows everything.

    Attributes:
        inside: Polygons that the vehicle must stay inside of.
        outside: Polygons that it must stay outside of.
        circles_inside: Circles that it must stay inside of.
        circles_outside: Circles that it must stay outside of.
        ceiling_up_m: Greatest up coordinate.
    """

    inside: tuple[Polygon, ...] = ()
    outside: tuple[Polygon, ...] = ()
    circles_inside: tuple[Circle, ...] = ()
    circles_outside: tuple[Circle, ...] = ()
    ceiling_up_m: float = math.inf

    def contains(self, position_enu: Vector) -> bool:
        """Whether a position (m) is allowed."""
        x, y, z = position_enu
        return (
            z <= self.ceiling_up_m
            and all(_within(polygon, x, y) for polygon in self.inside)
            and not any(_within(polygon, x, y) for polygon in self.outside)
            and all(math.hypot(x - e, y - n) <= r for e, n, r in self.circles_inside)
            and not any(math.hypot(x - e, y - n) <= r for e, n, r in self.circles_outside)
        )

    def beyond_m(self, position_enu: Vector) -> float:
        """How far a position (m) is on the wrong side, m; 0 where it is allowed."""
        x, y, z = position_enu
        wrong = [
            *(p for p in self.inside if not _within(p, x, y)),
            *(p for p in self.outside if _within(p, x, y)),
        ]
        return max(
            0.0,
            z - self.ceiling_up_m,
            *(math.hypot(x - e, y - n) - r for e, n, r in self.circles_inside),
            *(r - math.hypot(x - e, y - n) for e, n, r in self.circles_outside),
            *(min(math.hypot(*way) for way in _ways_to_edges(p, x, y)) for p in wrong),
        )

    def restrain(self, position_enu: Vector, velocity_enu: Vector, margin_m: float) -> Vector:
        """A velocity without the part that would carry the vehicle over an edge.

        Args:
            position_enu: Position of the vehicle, inside the fence, m.
            velocity_enu: Velocity to restrain, m/s.
            margin_m: Distance from the edges at which it must stop, m.
        """
        x, y, z = position_enu
        vx, vy, vz = velocity_enu
        for to_x, to_y in self._edges(x, y):
            distance = math.hypot(to_x, to_y)
            if distance == 0.0:
                continue
            nx, ny = to_x / distance, to_y / distance
            allowed = _allowed(distance - margin_m)
            excess = vx * nx + vy * ny - allowed
            if excess > 0.0:
                vx, vy = vx - excess * nx, vy - excess * ny
        if vz > 0.0 and math.isfinite(self.ceiling_up_m):
            vz = min(vz, _allowed(self.ceiling_up_m - z - margin_m))
        return vx, vy, vz

    def _edges(self, x: float, y: float) -> list[Point]:
        """Vector from a place to the nearest point of each edge, m."""
        ways = [way for p in self.inside + self.outside for way in _ways_to_edges(p, x, y)]
        for e, n, r in self.circles_inside + self.circles_outside:
            distance = math.hypot(x - e, y - n)
            if distance > 0.0:
                scale = r / distance - 1.0
                ways.append(((x - e) * scale, (y - n) * scale))
        return ways


def _allowed(distance_m: float) -> float:
    return approach_speed(max(0.0, distance_m), GAIN_PER_S, BRAKING_MPS2)


def _within(polygon: Polygon, x: float, y: float) -> bool:
    """Whether a point is inside of a polygon."""
    # An eastward ray from inside crosses the edges an odd number of times.
    inside = False
    for i, (bx, by) in enumerate(polygon):
        ax, ay = polygon[i - 1]
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
            inside = not inside
    return inside


def _ways_to_edges(polygon: Polygon, x: float, y: float) -> list[Point]:
    return [_way_to_segment(polygon[i - 1], polygon[i], x, y) for i in range(len(polygon))]


def _way_to_segment(a: Point, b: Point, x: float, y: float) -> Point:
    dx, dy = b[0] - a[0], b[1] - a[1]
    length2 = dx * dx + dy * dy
    share = ((x - a[0]) * dx + (y - a[1]) * dy) / length2 if length2 > 0.0 else 0.0
    share = max(0.0, min(1.0, share))
    return (a[0] + share * dx - x, a[1] + share * dy - y)
