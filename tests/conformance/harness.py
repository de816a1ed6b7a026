"""A vehicle whose behaviour is tested row by row, in memory or at a UDP endpoint."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Literal, TypeAlias

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.world import World
from tests.sim.flying import simulation, vehicle

Message: TypeAlias = Any
"""A pymavlink message; pymavlink ships no type information."""

GCS, OTHER = 255, 77
"""The ground station the vehicle is configured for, and another one."""
COMPONENT = 190
TICK_S = 0.02
GUIDED = 4
"""ArduCopter's mode."""
PX4_AUTO, PX4_HOLD = 4, 3
"""PX4's main mode AUTO and its sub-mode LOITER."""
ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
ARMED: int = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
LOCAL_NED, LOCAL_OFFSET, BODY, BODY_OFFSET = 1, 7, 8, 9
POSITION, VELOCITY, ACCELERATION, YAW, YAW_RATE = 0b111, 0b111 << 3, 0b111 << 6, 1 << 10, 1 << 11
EVERYTHING = POSITION | VELOCITY | ACCELERATION | YAW | YAW_RATE


def only(*groups: int) -> int:
    """The type mask that ignores everything but some groups."""
    return EVERYTHING & ~sum(groups)


class Vehicle(ABC):
    """One vehicle and what it said.

    Args:
        sysid: Its system id.

    Attributes:
        sysid: Its system id.
        heard: Every message with the time it came, s.
    """

    def __init__(self, sysid: int) -> None:
        self.sysid = sysid
        self.heard: list[tuple[float, Message]] = []
        self._encoders: dict[int, Any] = {}
        self._streams: set[int] = set()
        self._stand = (0.0, 0.0)
        self._looked_at = 0

    # --- The wire ----------------------------------------------------------------------

    @property
    @abstractmethod
    def now(self) -> float:
        """The time, s."""

    @abstractmethod
    def tick(self) -> None:
        """Let ``TICK_S`` pass and take what comes meanwhile."""

    @abstractmethod
    def _send(self, data: bytes) -> None:
        """Send bytes."""

    def send(self, message: Message, source: int = OTHER) -> None:
        """Send a message as a system id."""
        encoder = self._encoders.setdefault(
            source, mavlink.MAVLink(None, srcSystem=source, srcComponent=COMPONENT)
        )
        encoder.seq = (encoder.seq + 1) % 256
        self._send(message.pack(encoder))

    def wait(
        self, duration_s: float, meanwhile: Callable[[], None] = lambda: None
    ) -> list[tuple[float, Message]]:
        """Let time pass, doing something each tick; returns the messages not yet looked at."""
        until = self.now + duration_s
        while self.now < until - 1e-6:
            meanwhile()
            self.tick()
        start, self._looked_at = self._looked_at, len(self.heard)
        return self.heard[start:]

    def until(
        self,
        holds: Callable[[Message], bool],
        within_s: float,
        meanwhile: Callable[[], None] = lambda: None,
    ) -> tuple[float, Message]:
        """The first message not yet looked at for which something holds, and its time."""
        deadline = self.now + within_s
        while True:
            while self._looked_at < len(self.heard):
                at, message = self.heard[self._looked_at]
                self._looked_at += 1
                if holds(message):
                    return at, message
            assert self.now < deadline, f"not within {within_s} s"
            meanwhile()
            self.tick()

    def latest(self, name: str) -> Message:
        """The last message of a type."""
        return next(m for _, m in reversed(self.heard) if m.get_type() == name)

    # --- Commands ----------------------------------------------------------------------

    def command(self, command: int, *params: float, target: int | None = None) -> None:
        """Send a COMMAND_LONG."""
        values = [*params, *([0.0] * (7 - len(params)))]
        system = self.sysid if target is None else target
        self.send(mavlink.MAVLink_command_long_message(system, 1, command, 0, *values))

    def result(self, command: int, *params: float) -> int:
        """Send a COMMAND_LONG; returns the MAV_RESULT of its acknowledgement."""
        self.command(command, *params)
        _, ack = self.until(of("COMMAND_ACK", command=command), 2.0)
        return int(ack.result)

    def request(self, message_id: int) -> Message:
        """Ask for one message; returns it."""
        name = mavlink.mavlink_map[message_id].msgname
        self.command(mavlink.MAV_CMD_REQUEST_MESSAGE, message_id)
        return self.until(of(name), 2.0)[1]

    def stream(self, message_id: int, rate_hz: float) -> None:
        """Ask for a message at a rate, until it is hushed."""
        self._streams.add(message_id)
        command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        assert self.result(command, message_id, 1e6 / rate_hz) == ACCEPTED

    def arm(self) -> int:
        """Arm."""
        return self.result(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def heartbeat(self) -> Message:
        """The next HEARTBEAT."""
        return self.until(of("HEARTBEAT"), 2.5)[1]

    def armed(self) -> bool:
        """Whether the next HEARTBEAT says armed."""
        return bool(self.heartbeat().base_mode & ARMED)

    def landed_state(self) -> int:
        """The next MAV_LANDED_STATE."""
        return int(self.until(of("EXTENDED_SYS_STATE"), 2.0)[1].landed_state)

    # --- Parameters --------------------------------------------------------------------

    def parameter(self, name: str) -> Message:
        """The PARAM_VALUE of a parameter."""
        self.send(mavlink.MAVLink_param_request_read_message(self.sysid, 1, name.encode(), -1))
        return self.until(of("PARAM_VALUE", param_id=name), 2.0)[1]

    def assign(self, name: str, value: float) -> Message:
        """Set a parameter in its own type; returns the echo."""
        kind = self.parameter(name).param_type
        self.send(mavlink.MAVLink_param_set_message(self.sysid, 1, name.encode(), value, kind))
        return self.until(of("PARAM_VALUE", param_id=name), 2.0)[1]

    @contextmanager
    def parameters(self, **values: float) -> Iterator[None]:
        """Set parameters for as long as the context lasts."""
        before = {name: self.parameter(name).param_value for name in values}
        for name, value in values.items():
            self.assign(name, value)
        try:
            yield
        finally:
            for name, value in before.items():
                self.assign(name, value)

    # --- Flying ------------------------------------------------------------------------

    def ready(self) -> None:
        """Bring it to the ground, disarmed and armable."""
        if self.armed():
            self.command(mavlink.MAV_CMD_NAV_LAND)
            self.until(lambda m: of("HEARTBEAT")(m) and not m.base_mode & ARMED, 300.0)
        # In the mode it landed in it would never be.
        is_px4 = self.heartbeat().autopilot == mavlink.MAV_AUTOPILOT_PX4
        mode = (PX4_AUTO, PX4_HOLD) if is_px4 else (GUIDED,)
        self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, *mode)
        deadline = self.now + 120.0
        while not (
            self.request(mavlink.MAVLINK_MSG_ID_SYS_STATUS).onboard_control_sensors_health
            & mavlink.MAV_SYS_STATUS_PREARM_CHECK
        ):
            assert self.now < deadline, "it does not become armable"
            self.wait(1.0)

    def hush(self) -> None:
        """Turn off the streams that the test asked for."""
        for message_id in self._streams:
            self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, 0)
        self._streams.clear()

    def stand(self) -> None:
        """Count positions from where it stands; its local frame begins where it booted."""
        self._stand = (0.0, 0.0)
        north, east, _ = self.position()
        self._stand = (north, east)

    def reboot(self) -> float:
        """Reboot; returns how long it was silent, s."""
        assert self.result(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == ACCEPTED
        start = self.now
        at, _ = self.until(of("HEARTBEAT"), 30.0)
        return at - start

    def position(self) -> tuple[float, float, float]:
        """Where the next LOCAL_POSITION_NED says that it is, seen from where it stood, m."""
        return self.seen(self.until(of("LOCAL_POSITION_NED"), 2.0)[1])

    def seen(self, message: Message) -> tuple[float, float, float]:
        """The place of a LOCAL_POSITION_NED, seen from where it stood, m."""
        north, east = self._stand
        return message.x - north, message.y - east, message.z

    def speed(self) -> float:
        """The next speed, m/s."""
        _, m = self.until(of("LOCAL_POSITION_NED"), 2.0)
        return math.hypot(m.vx, m.vy, m.vz)

    def local(
        self,
        mask: int,
        position: tuple[float, float, float] = (0.0, 0.0, 0.0),
        velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        acceleration: tuple[float, float, float] = (0.0, 0.0, 0.0),
        frame: int = LOCAL_NED,
        source: int = OTHER,
        yaw: float = 0.0,
        yaw_rate: float = 0.0,
    ) -> None:
        """Send a SET_POSITION_TARGET_LOCAL_NED; a place in LOCAL_NED counts from where it stood."""
        north, east = self._stand if frame == LOCAL_NED else (0.0, 0.0)
        place = (position[0] + north, position[1] + east, position[2])
        self.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                *(0, self.sysid, 1, frame, mask),
                *(*place, *velocity, *acceleration, yaw, yaw_rate),
            ),
            source,
        )

    def global_(self, mask: int, frame: int, north_m: float, east_m: float, alt: float) -> None:
        """Send a SET_POSITION_TARGET_GLOBAL_INT for a place seen from home."""
        home = self.latest("HOME_POSITION")
        scale = 1e7 / 111_320.0
        lat = home.latitude + round(north_m * scale)
        lon = home.longitude + round(east_m * scale / math.cos(math.radians(home.latitude * 1e-7)))
        self.send(
            mavlink.MAVLink_set_position_target_global_int_message(
                *(0, self.sysid, 1, frame, mask, lat, lon, alt), *([0.0] * 8)
            )
        )


class InMemory(Vehicle):
    """A simulated vehicle in virtual time.

    Args:
        personality: Its autopilot.
    """

    def __init__(self, personality: Literal["ardupilot", "px4"]) -> None:
        super().__init__(1)
        config = replace(vehicle(1), autopilot=personality, full_boot=True)
        self._world = World(simulation(config))
        self._decoder = mavlink.MAVLink(None)

    @property
    def now(self) -> float:
        """See :class:`Vehicle`."""
        return self._world.time_s

    def tick(self) -> None:
        """See :class:`Vehicle`."""
        self._world.advance(self._world.time_s + TICK_S)
        self._take()

    def _send(self, data: bytes) -> None:
        self._world.receive_datagram(self.sysid, data)
        self._take()

    def _take(self) -> None:
        for _, data in self._world.datagrams():
            self.heard += [(self.now, m) for m in self._decoder.parse_buffer(data) or ()]


class Udp(Vehicle):
    """A vehicle at an endpoint, in real time.

    Args:
        url: For example ``udpin://127.0.0.1:14550``.
    """

    def __init__(self, url: str) -> None:
        self._connection = mavutil.mavlink_connection(
            url.replace("://", ":"), source_system=OTHER, source_component=COMPONENT
        )
        heartbeat = self._connection.wait_heartbeat(timeout=60)
        assert heartbeat is not None, f"nobody speaks at {url}"
        super().__init__(heartbeat.get_srcSystem())

    @property
    def now(self) -> float:
        """See :class:`Vehicle`."""
        return time.monotonic()

    def tick(self) -> None:
        """See :class:`Vehicle`."""
        until = time.monotonic() + TICK_S
        while (left := until - time.monotonic()) > 0.0:
            message = self._connection.recv_match(blocking=True, timeout=left)
            if message is not None and message.get_srcSystem() == self.sysid:
                self.heard.append((time.monotonic(), message))

    def _send(self, data: bytes) -> None:
        self._connection.write(data)

    def close(self) -> None:
        """Close the socket."""
        self._connection.close()


def of(name: str, **fields: object) -> Callable[[Message], bool]:
    """Whether a message is of a type and has some fields."""

    def is_it(message: Message) -> bool:
        return message.get_type() == name and all(
            getattr(message, key) == value for key, value in fields.items()
        )

    return is_it


def count(name: str, heard: list[tuple[float, Message]]) -> int:
    """How many messages of a type there are."""
    return sum(m.get_type() == name for _, m in heard)
