"""A ground station for tests: speaks MAVLink to a world and keeps what comes back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.config import (
    EmitterConfig,
    NavigationConfig,
    ReceiverConfig,
    SimConfig,
    VehicleConfig,
    WindConfig,
)
from sim.world import World
from swarmctl.feed.schema import (
    ArrivalTimeMessage,
    RangeDifferenceMessage,
    ReceiverTruthMessage,
    TruthMessage,
)

LAT, LON, ALT = math.radians(47.0), math.radians(8.0), 400.0
POSITION_AND_VELOCITY = 0b110111000000
POSITION_ONLY = 0b110111111000
VELOCITY_ONLY = 0b110111000111
STABILIZE, GUIDED, LOITER, RTL, LAND, BRAKE = 0, 4, 5, 6, 9, 17
ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4


def vehicle(sysid: int = 1, east_m: float = 0.0, **changes: Any) -> VehicleConfig:  # noqa: ANN401 - whatever the field takes
    """A UAV launched some metres east of (LAT, LON)."""
    lon = LON + east_m / (6_378_137.0 * math.cos(LAT))
    return replace(VehicleConfig(sysid, LAT, lon, ALT), **changes)


def simulation(
    *vehicles: VehicleConfig,
    wind: WindConfig | None = None,
    navigation: NavigationConfig | None = None,
    receivers: ReceiverConfig | None = None,
    emitter: EmitterConfig | None = None,
    seed: int = 0,
) -> SimConfig:
    """A simulation that is exact and still unless told otherwise."""
    vehicles = vehicles or (vehicle(),)
    return SimConfig(
        swarm="alpha",
        vehicles=vehicles,
        emitter=emitter or EmitterConfig(LAT + 1e-4, LON + 2e-4, ALT, (0.5, -0.2, 0.0)),
        receivers=receivers or ReceiverConfig(reference=vehicles[0].sysid),
        navigation=navigation or NavigationConfig(white_sigma_m=0.0),
        wind=wind or WindConfig(),
        seed=seed,
    )


class Station:
    """Flies the vehicles of one world.

    Args:
        config: The simulation.

    Attributes:
        world: The world.
        received: Every message decoded, with the system id of the socket it came from.
        publications: Everything published over MQTT.
    """

    def __init__(self, config: SimConfig | None = None) -> None:
        self.world = World(config or simulation())
        self.received: list[tuple[int, Any]] = []
        self.publications: list[tuple[str, bytes]] = []
        self._encoder = mavlink.MAVLink(None, srcSystem=77, srcComponent=190)
        self._decoder = mavlink.MAVLink(None)

    def advance(self, duration_s: float) -> list[tuple[int, Any]]:
        """Let time pass; returns the messages that came meanwhile."""
        self.world.advance(self.world.time_s + duration_s)
        return self._take()

    def send(self, message: Any, sysid: int = 1) -> list[tuple[int, Any]]:  # noqa: ANN401 - pymavlink is untyped
        """Send a message to a vehicle; returns what it says at once."""
        return self.send_bytes(bytes(message.pack(self._encoder)), sysid)

    def send_bytes(self, data: bytes, sysid: int = 1) -> list[tuple[int, Any]]:
        """Send raw bytes to a vehicle; returns what it says at once."""
        self.world.receive_datagram(sysid, data)
        return self._take()

    def command(
        self, command: int, *params: float, sysid: int = 1, target: int | None = None
    ) -> list[Any]:
        """Send a COMMAND_LONG; returns the messages said at once."""
        values = [*params, *([0.0] * (7 - len(params)))]
        message = mavlink.MAVLink_command_long_message(target or sysid, 1, command, 0, *values)
        return [reply for _, reply in self.send(message, sysid)]

    def result(self, command: int, *params: float, sysid: int = 1) -> int:
        """Send a COMMAND_LONG; returns the MAV_RESULT of its only acknowledgement."""
        (ack,) = of_type("COMMAND_ACK", self.command(command, *params, sysid=sysid))
        assert ack.command == command
        return int(ack.result)

    def mode(self, mode: int, sysid: int = 1) -> int:
        """Switch the flight mode."""
        return self.result(mavlink.MAV_CMD_DO_SET_MODE, 1, mode, sysid=sysid)

    def arm(self, sysid: int = 1) -> int:
        """Arm."""
        return self.result(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, sysid=sysid)

    def take_off(self, height_m: float, sysid: int = 1) -> int:
        """Command a take-off."""
        return self.result(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height_m, sysid=sysid)

    def stream(self, message_id: int, rate_hz: float, sysid: int = 1) -> int:
        """Ask for a message at a rate."""
        command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        return self.result(command, message_id, 1e6 / rate_hz, sysid=sysid)

    def request(self, message_id: int, sysid: int = 1) -> Any:  # noqa: ANN401 - pymavlink is untyped
        """Ask for one message; returns it."""
        ack, message = self.command(mavlink.MAV_CMD_REQUEST_MESSAGE, message_id, sysid=sysid)
        assert ack.get_type() == "COMMAND_ACK"
        assert ack.result == ACCEPTED
        return message

    def airborne(self, height_m: float = 30.0, sysids: Sequence[int] = (1,)) -> None:
        """Bring vehicles up to a height and into a hover, in GUIDED."""
        if self.world.time_s < 5.0:
            self.advance(5.0 - self.world.time_s)
        for sysid in sysids:
            assert self.mode(GUIDED, sysid) == ACCEPTED
            assert self.arm(sysid) == ACCEPTED
            assert self.take_off(height_m, sysid) == ACCEPTED
        self.advance(10.0 + height_m / 2.0)

    def setpoint(
        self,
        position_enu: tuple[float, float, float] = (0.0, 0.0, 0.0),
        velocity_enu: tuple[float, float, float] = (0.0, 0.0, 0.0),
        mask: int = POSITION_AND_VELOCITY,
        sysid: int = 1,
        frame: int = mavlink.MAV_FRAME_GLOBAL_INT,
    ) -> None:
        """Send a global setpoint; its altitude is AMSL or whatever ``frame`` makes of it."""
        lat, lon, alt = self.world.frame.to_geodetic(*position_enu)
        (east, north, up) = velocity_enu
        self.send(
            mavlink.MAVLink_set_position_target_global_int_message(
                0,
                sysid,
                1,
                frame,
                mask,
                round(math.degrees(lat) * 1e7),
                round(math.degrees(lon) * 1e7),
                alt,
                north,
                east,
                -up,
                0,
                0,
                0,
                0,
                0,
            ),
            sysid,
        )

    def position(self, sysid: int = 1) -> tuple[float, float, float]:
        """True position, m."""
        return self.world.vehicle_position_enu(sysid)

    def velocity(self, sysid: int = 1) -> tuple[float, float, float]:
        """True velocity, m/s."""
        return self.world.vehicle_state(sysid).velocity_enu

    def heartbeat(self, sysid: int = 1) -> Any:  # noqa: ANN401 - pymavlink is untyped
        """The state HEARTBEAT shows now."""
        return self.request(mavlink.MAVLINK_MSG_ID_HEARTBEAT, sysid)

    def armed(self, sysid: int = 1) -> bool:
        """Whether HEARTBEAT says armed."""
        return bool(self.heartbeat(sysid).base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    def _take(self) -> list[tuple[int, Any]]:
        self.publications += self.world.publications()
        taken = [
            (sysid, message)
            for sysid, data in self.world.datagrams()
            for message in self._decoder.parse_buffer(data)
        ]
        self.received += taken
        return taken


def of_type(name: str, messages: Sequence[Any]) -> list[Any]:
    """Those of a MAVLink type, from plain messages or (sysid, message) pairs."""
    plain = [m[1] if isinstance(m, tuple) else m for m in messages]
    return [message for message in plain if message.get_type() == name]


def range_differences(
    publications: Sequence[tuple[str, bytes]],
) -> list[list[RangeDifferenceMessage]]:
    """The decoded TDOA publications."""
    return [
        msgspec.json.decode(payload, type=list[RangeDifferenceMessage])
        for topic, payload in publications
        if topic == "swarm/alpha/tdoa"
    ]


def arrival_times(publications: Sequence[tuple[str, bytes]]) -> list[ArrivalTimeMessage]:
    """The decoded arrival times, each from its receiver's topic."""
    messages = []
    for topic, payload in publications:
        if "/toa/" in topic:
            message = msgspec.json.decode(payload, type=ArrivalTimeMessage)
            assert topic == f"swarm/alpha/toa/{message.receiver}"
            messages.append(message)
    return messages


def truths(publications: Sequence[tuple[str, bytes]]) -> list[TruthMessage]:
    """The decoded truth publications."""
    return [
        msgspec.json.decode(payload, type=TruthMessage)
        for topic, payload in publications
        if topic == "swarm/alpha/truth"
    ]


def receivers_truths(
    publications: Sequence[tuple[str, bytes]],
) -> list[list[ReceiverTruthMessage]]:
    """The decoded publications of the truth about the receivers."""
    return [
        msgspec.json.decode(payload, type=list[ReceiverTruthMessage])
        for topic, payload in publications
        if topic == "swarm/alpha/truth/receivers"
    ]


def landed_state(station: Station) -> int:
    """The MAV_LANDED_STATE that a vehicle says."""
    message = station.request(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
    return int(message.landed_state)
