"""Upload and download of missions, fences and rally points (the MAVLink mission protocol).

What is uploaded is stored and given back. Missions are flown (:mod:`sim.autopilots.mission_flight`)
and fences act (:mod:`sim.autopilots.geofence`); rally points are not used.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from sim.autopilots.mission_items import (
    FENCE,
    MISSION,
    RALLY,
    Item,
    fence_is_sound,
    mission_is_sound,
)
from sim.mavlink import Message, dialect

GREATEST_COUNT = 700
"""Greatest number of items that are stored."""

_PLAIN_FRAMES = {
    dialect.MAV_FRAME_GLOBAL_INT: dialect.MAV_FRAME_GLOBAL,
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
}


class UploadTraits(NamedTuple):
    """How an autopilot uploads.

    Attributes:
        asks_int: Whether it asks with MISSION_REQUEST_INT or with MISSION_REQUEST.
        repeat_s: It asks again after this long, s.
        give_up_s: It gives up after this long without an item, s.
        says_so: Whether it sends MISSION_ACK when it gives up.
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


class MissionProtocol:
    """The stored items of one vehicle and their transfers.

    Args:
        traits: How it uploads.
        send: Sends a message.

    Attributes:
        changes: Number of changes of the stored items.
    """

    __slots__ = ("_send", "_stored", "_traits", "_upload", "changes")

    def __init__(self, traits: UploadTraits, send: Callable[[Message], None]) -> None:
        self._traits = traits
        self._send = send
        self._stored: dict[int, tuple[Item, ...]] = {MISSION: (), FENCE: (), RALLY: ()}
        self._upload: _Upload | None = None
        self.changes = 0

    def stored(self, kind: int) -> tuple[Item, ...]:
        """The stored items of a MAV_MISSION_TYPE."""
        return self._stored[kind]

    def abort(self) -> None:
        """Forget an upload under way."""
        self._upload = None

    def advance(self, now_s: float) -> None:
        """Ask again for a missing item, or give up."""
        upload, traits = self._upload, self._traits
        if upload is None:
            return
        if now_s - upload.heard_s >= traits.give_up_s:
            self._upload = None
            if traits.says_so:
                self._ack(upload.peer, dialect.MAV_MISSION_OPERATION_CANCELLED, upload.kind)
        elif now_s - upload.asked_s >= traits.repeat_s:
            self._ask(upload, now_s)

    def on_count(self, message: Message, now_s: float) -> None:
        """Begin an upload (MISSION_COUNT)."""
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
        """Take the next item of an upload (MISSION_ITEM_INT)."""
        upload = self._upload
        if upload is None or _peer(message) != upload.peer or message.mission_type != upload.kind:
            return
        if message.seq != len(upload.items):
            # An item it has is a late repetition; one too far ahead means that one was lost.
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
        """Delete stored items (MISSION_CLEAR_ALL)."""
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
        """Begin a download (MISSION_REQUEST_LIST)."""
        kind = message.mission_type
        if kind not in self._stored:
            self._ack(_peer(message), dialect.MAV_MISSION_UNSUPPORTED, kind)
            return
        self._send(
            dialect.MAVLink_mission_count_message(*_peer(message), len(self._stored[kind]), kind)
        )

    def on_request(self, message: Message, home: tuple[int, int, float] | None) -> None:
        """Send an item (MISSION_REQUEST_INT or MISSION_REQUEST).

        Args:
            message: The request; it decides between MISSION_ITEM_INT and MISSION_ITEM.
            home: Latitude and longitude of home in 1e-7 degrees and its altitude, m.
        """
        kind = message.mission_type
        items = self._stored.get(kind, ())
        if message.seq >= len(items):
            self._ack(_peer(message), dialect.MAV_MISSION_INVALID_SEQUENCE, kind)
            return
        item = items[message.seq]
        if self._traits.home_is_first:
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
            if self._traits.asks_int
            else dialect.MAVLink_mission_request_message
        )
        self._send(build(*upload.peer, len(upload.items), upload.kind))

    def _ack(self, peer: tuple[int, int], result: int, kind: int) -> None:
        self._send(dialect.MAVLink_mission_ack_message(*peer, result, kind))


def _peer(message: Message) -> tuple[int, int]:
    return message.get_srcSystem(), message.get_srcComponent()
