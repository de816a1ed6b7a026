"""The items of an uploaded mission or fence, and what they mean."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from sim.autopilots.geofence import Circle, Polygon
from sim.mavlink import dialect

MISSION: int = dialect.MAV_MISSION_TYPE_MISSION
FENCE: int = dialect.MAV_MISSION_TYPE_FENCE
RALLY: int = dialect.MAV_MISSION_TYPE_RALLY

GREATEST_ALT_M = 1e5
"""A mission item higher than this cannot be flown to, m."""

_INSIDE: int = dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
_OUTSIDE: int = dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
_CIRCLE_INSIDE: int = dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
_CIRCLE_OUTSIDE: int = dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
_FENCE_ITEMS = {
    _INSIDE,
    _OUTSIDE,
    _CIRCLE_INSIDE,
    _CIRCLE_OUTSIDE,
    dialect.MAV_CMD_NAV_FENCE_RETURN_POINT,
}


class Item(NamedTuple):
    """One item, as in MISSION_ITEM_INT."""

    frame: int
    command: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: int
    y: int
    z: float
    autocontinue: int


def fence_is_sound(items: Sequence[Item]) -> bool:
    """Whether all fence items are complete polygons of three or more vertices, or circles."""
    if any(item.command not in _FENCE_ITEMS or not _is_on_earth(item) for item in items):
        return False
    if any(
        item.command in {_CIRCLE_INSIDE, _CIRCLE_OUTSIDE} and not 0.0 < item.param1 < 1e6
        for item in items
    ):
        return False
    start = 0
    while start < len(items):
        item = items[start]
        if item.command not in {_INSIDE, _OUTSIDE}:
            start += 1
            continue
        count = item.param1
        if not 3.0 <= count <= len(items) - start:  # false for NaN
            return False
        polygon = items[start : start + int(count)]
        if any((v.command, v.param1) != (item.command, item.param1) for v in polygon):
            return False
        start += int(count)
    return True


def mission_is_sound(items: Sequence[Item]) -> bool:
    """Whether the places of a mission can be flown to."""
    # A comparison with NaN is false; commands without a place have zeros there.
    return all(_is_on_earth(item) and abs(item.z) < GREATEST_ALT_M for item in items)


def _is_on_earth(item: Item) -> bool:
    return abs(item.x) <= 900_000_000 and abs(item.y) <= 1_800_000_000


def fence_shapes(
    items: Sequence[Item], to_enu: Callable[[int, int], tuple[float, float]]
) -> tuple[list[Polygon], list[Polygon], list[Circle], list[Circle]]:
    """Polygons and circles of a sound fence: inclusion and exclusion polygons, then circles.

    Args:
        items: The items.
        to_enu: East and north (m) of latitude and longitude in 1e-7 degrees.
    """
    polygons: dict[int, list[Polygon]] = {_INSIDE: [], _OUTSIDE: []}
    circles: dict[int, list[Circle]] = {_CIRCLE_INSIDE: [], _CIRCLE_OUTSIDE: []}
    start = 0
    while start < len(items):
        item = items[start]
        count = int(item.param1) if item.command in polygons else 1
        if item.command in polygons:
            vertices = tuple(to_enu(v.x, v.y) for v in items[start : start + count])
            polygons[item.command].append(vertices)
        elif item.command in circles:
            circles[item.command].append((*to_enu(item.x, item.y), item.param1))
        start += count
    return (
        polygons[_INSIDE],
        polygons[_OUTSIDE],
        circles[_CIRCLE_INSIDE],
        circles[_CIRCLE_OUTSIDE],
    )
