"""Upload and download of missions, fences and rally points.

What is uploaded is kept and given back. Fences act, missions are flown
(:mod:`sim.autopilots.mission_flight`), rally points are not used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from sim.autopilots.geofence import Circle, Polygon
from sim.mavlink import Message, dialect

MISSION: int = dialect.MAV_MISSION_TYPE_MISSION
FENCE: int = dialect.MAV_MISSION_TYPE_FENCE
RALLY: int = dialect.MAV_MISSION_TYPE_RALLY

GREATEST_COUNT = 700
GREATEST_ALT_M = 1e5

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
_PLAIN_FRAMES = {
    dialect.MAV_FRAME_GLOBAL_INT: dialect.MAV_FRAME_GLOBAL,
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
}


class Item(NamedTuple):
    """One item of a plan, as in MISSION_ITEM_INT."""

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


class TransferManners(NamedTuple):
    """How an autopilot uploads.

    Attributes:
        asks_int: Whether it asks with MISSION_REQUEST_INT or with MISSION_REQUEST.
        repeat_s: It asks again after so long, s.
        give_up_s: It gives up after so long without an item, s.
        says_so: Whether it acknowledges giving up.
        home_is_first: Whether item 0 of a mission is home, and frames lose their ``_INT``.
    """

    asks_int: bool
    repeat_s: float
    give_up_s: float
    says_so: bool
    home_is_first: bool


class _Upload:
    """An upload under way."""

    __slots__ = ("asked_s", "count", "heard_s", "items", "kind", "peer")

    def __init__(self, kind: int, count: int, peer: tuple[int, int], now_s: float) -> None:
        self.kind, self.count, self.peer = kind, count, peer
        self.items: list[Item] = []
        self.heard_s = now_s
        self.asked_s = now_s


class Plans:
    """The plans of one vehicle and their transfers.

    Args:
        manners: How it uploads.
        send: Sends a message.

    Attributes:
        changes: Counts the changes of the stored plans.
    """

    __slots__ = ("_manners", "_send", "_stored", "_upload", "changes")

    def __init__(self, manners: TransferManners, send: Callable[[Message], None]) -> None:
        self._manners = manners
        self._send = send
        self._stored: dict[int, tuple[Item, ...]] = {MISSION: (), FENCE: (), RALLY: ()}
        self._upload: _Upload | None = None
        self.changes = 0

    def stored(self, kind: int) -> tuple[Item, ...]:
        """The plan of a MAV_MISSION_TYPE."""
        return self._stored[kind]

    def abort(self) -> None:
        """Forget an upload under way."""
        self._upload = None

    def advance(self, now_s: float) -> None:
        """Ask again, or give up."""
        upload, manners = self._upload, self._manners
        if upload is None:
            return
        if now_s - upload.heard_s >= manners.give_up_s:
            self._upload = None
            if manners.says_so:
                self._ack(upload.peer, dialect.MAV_MISSION_OPERATION_CANCELLED, upload.kind)
        elif now_s - upload.asked_s >= manners.repeat_s:
            self._ask(upload, now_s)

    def on_count(self, message: Message, now_s: float) -> None:
        """MISSION_COUNT begins an upload."""
        peer, kind = _peer(message), message.mission_type
        if kind not in self._stored:
            self._ack(peer, dialect.MAV_MISSION_UNSUPPORTED, kind)
        elif message.count > GREATEST_COUNT:
            self._ack(peer, dialect.MAV_MISSION_NO_SPACE, kind)
        elif message.count == 0:
            self._upload = None
            self._store(kind, ())
            self._ack(peer, dialect.MAV_MISSION_ACCEPTED, kind)
        else:
            self._upload = _Upload(kind, message.count, peer, now_s)
            self._ask(self._upload, now_s)

    def on_item(self, message: Message, now_s: float) -> None:
        """MISSION_ITEM_INT goes on with it."""
        upload = self._upload
        if upload is None or _peer(message) != upload.peer or message.mission_type != upload.kind:
            return
        if message.seq != len(upload.items):
            # Late repetitions are normal where packets are lost: it asks for what it lacks.
            if message.seq > len(upload.items):
                self._ask(upload, now_s)
            return
        upload.items.append(
            Item(
                message.frame,
                message.command,
                message.param1,
                message.param2,
                message.param3,
                message.param4,
                message.x,
                message.y,
                message.z,
                message.autocontinue,
            )
        )
        upload.heard_s = now_s
        if len(upload.items) < upload.count:
            self._ask(upload, now_s)
            return
        self._upload = None
        items = tuple(upload.items)
        if upload.kind == FENCE and not fence_is_sound(items):
            result = dialect.MAV_MISSION_ERROR
        elif upload.kind == MISSION and not mission_is_sound(items):
            result = dialect.MAV_MISSION_INVALID
        else:
            self._store(upload.kind, items)
            result = dialect.MAV_MISSION_ACCEPTED
        self._ack(upload.peer, result, upload.kind)

    def on_clear_all(self, message: Message) -> None:
        """MISSION_CLEAR_ALL."""
        kind = message.mission_type
        if kind == dialect.MAV_MISSION_TYPE_ALL:
            for each in self._stored:
                self._store(each, ())
        elif kind in self._stored:
            self._store(kind, ())
        else:
            self._ack(_peer(message), dialect.MAV_MISSION_UNSUPPORTED, kind)
            return
        self._ack(_peer(message), dialect.MAV_MISSION_ACCEPTED, kind)

    def on_request_list(self, message: Message) -> None:
        """MISSION_REQUEST_LIST begins a download."""
        kind = message.mission_type
        if kind not in self._stored:
            self._ack(_peer(message), dialect.MAV_MISSION_UNSUPPORTED, kind)
            return
        self._send(
            dialect.MAVLink_mission_count_message(*_peer(message), len(self._stored[kind]), kind)
        )

    def on_request(self, message: Message, home: tuple[int, int, float] | None) -> None:
        """MISSION_REQUEST_INT or MISSION_REQUEST goes on with it.

        Args:
            message: The request, answered in its own kind of item.
            home: Latitude and longitude in 1e-7 degrees and altitude of home, m.
        """
        kind = message.mission_type
        items = self._stored.get(kind, ())
        if message.seq >= len(items):
            self._ack(_peer(message), dialect.MAV_MISSION_INVALID_SEQUENCE, kind)
            return
        item = items[message.seq]
        if self._manners.home_is_first:
            item = item._replace(frame=_PLAIN_FRAMES.get(item.frame, item.frame))
            if kind == MISSION and message.seq == 0 and home is not None:
                lat_e7, lon_e7, alt = home
                plain = dialect.MAV_FRAME_GLOBAL
                item = item._replace(
                    frame=plain,
                    command=dialect.MAV_CMD_NAV_WAYPOINT,
                    x=lat_e7,
                    y=lon_e7,
                    z=alt,
                )
        integer = message.get_msgId() == dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT
        build = (
            dialect.MAVLink_mission_item_int_message
            if integer
            else dialect.MAVLink_mission_item_message
        )
        scale = 1 if integer else 1e-7
        self._send(
            build(
                *_peer(message),
                message.seq,
                item.frame,
                item.command,
                0,
                item.autocontinue,
                item.param1,
                item.param2,
                item.param3,
                item.param4,
                item.x * scale,
                item.y * scale,
                item.z,
                kind,
            )
        )

    def _store(self, kind: int, items: tuple[Item, ...]) -> None:
        self._stored[kind] = items
        self.changes += 1

    def _ask(self, upload: _Upload, now_s: float) -> None:
        upload.asked_s = now_s
        build = (
            dialect.MAVLink_mission_request_int_message
            if self._manners.asks_int
            else dialect.MAVLink_mission_request_message
        )
        self._send(build(*upload.peer, len(upload.items), upload.kind))

    def _ack(self, peer: tuple[int, int], result: int, kind: int) -> None:
        self._send(dialect.MAVLink_mission_ack_message(*peer, result, kind))


def fence_is_sound(items: Sequence[Item]) -> bool:
    """Whether fence items make whole polygons of three vertices and more, and real circles."""
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
    """Whether the places of a mission are places that can be flown to."""
    # NaN is not below anything; commands that name no place have zeros there.
    return all(_is_on_earth(item) and abs(item.z) < GREATEST_ALT_M for item in items)


def _is_on_earth(item: Item) -> bool:
    return abs(item.x) <= 900_000_000 and abs(item.y) <= 1_800_000_000


def fence_shapes(
    items: Sequence[Item], to_enu: Callable[[int, int], tuple[float, float]]
) -> tuple[list[Polygon], list[Polygon], list[Circle], list[Circle]]:
    """Polygons to be inside and outside of and circles likewise, of sound fence items.

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


def _peer(message: Message) -> tuple[int, int]:
    return message.get_srcSystem(), message.get_srcComponent()
