"""What a link keeps about one vehicle, whoever speaks MAVLink underneath.

Messages of the vehicle become observations. Commands to it become packets, which each link writes
in its own way.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

import msgspec

from swarmctl.events import (
    Heartbeat,
    HomePosition,
    LandedState,
    Mode,
    Observation,
    StatusText,
    VehicleClock,
    VehiclePosition,
    VehicleVersion,
)
from swarmctl.link.autopilots.personality import PERSONALITIES, Personality
from swarmctl.link.codec.messages import (
    CommandAck,
    DataStream,
    FenceMessage,
    HeartbeatMessage,
    MavCmd,
    Message,
    ParameterMessage,
    PlanPacket,
    PositionMessage,
    TimeSyncAnswer,
)
from swarmctl.link.command_protocol import CommandExchange
from swarmctl.link.command_request import Attempt
from swarmctl.link.fence_upload import FenceExchange
from swarmctl.link.link_quality import LinkStatistics
from swarmctl.link.parameter_protocol import ParameterExchange, ReadPacket, SetPacket
from swarmctl.link.vehicle_clock import BootClock, RoundTrips

SILENT_S = 2.0
"""After a silence of so many seconds, another vehicle may speak under the same system id."""

Packet: TypeAlias = Attempt | ReadPacket | SetPacket | PlanPacket
"""What is sent to a vehicle: a command, or a step of a parameter's or a fence's transfer."""
WHO_ARE_YOU = {MavCmd.REQUEST_MESSAGE, MavCmd.REQUEST_AUTOPILOT_CAPABILITIES}
"""What is still asked of a vehicle under whose system id another one answers."""


def mapped(told: VehicleClock, clock: BootClock) -> VehicleClock | None:
    """Update a clock from its vehicle's SYSTEM_TIME; returns that in the clock's time base.

    Args:
        told: The vehicle's SYSTEM_TIME.
        clock: Its clock.

    Returns:
        None while the clock is not known yet.
    """
    clock.update(told.utc_s, told.boot_s)
    utc_s = clock.to_utc(told.boot_s)
    return None if utc_s is None else msgspec.structs.replace(told, utc_s=utc_s)


class VehicleSession:
    """What a link keeps about one vehicle.

    Args:
        sysid: Its system id.
        now: Monotonic time, s.
        clock: Its time since boot against UTC, not known yet.

    Attributes:
        sysid: As above.
        heard_s: When it was last heard, s.
        personality: How its flight stack wants to be asked; None if it is not commanded.
        home_alt_amsl_m: Altitude of its home, m; None while it is not known.
        uid: Its hardware id; 0 while it is not known.
        is_another: Whether another vehicle answers under its system id.
        clock: As above.
        round_trips: Its time since boot against ours.
        statistics: Its messages and losses.
        exchange: Commands under way.
        parameters: Parameters under way.
        fence: Fences under way.
    """

    def __init__(self, sysid: int, now: float, clock: BootClock) -> None:
        self.sysid = sysid
        self.heard_s = now
        self.personality: Personality | None = None
        self.home_alt_amsl_m: float | None = None
        self.uid = 0
        self.is_another = False
        self.clock = clock
        self.round_trips = RoundTrips()
        self.statistics = LinkStatistics(now)
        self.exchange = CommandExchange(sysid)
        self.parameters = ParameterExchange(sysid)
        self.fence = FenceExchange(sysid)

    def __str__(self) -> str:
        return f"System id {self.sysid}"

    def hear(self, now: float) -> bool:
        """Note that it was heard; returns whether to ask it for its hardware id again."""
        silent_s, self.heard_s = now - self.heard_s, now
        return silent_s >= SILENT_S and self.uid != 0

    def identify(self, version: VehicleVersion) -> str | None:
        """Keep its hardware id, or notice that another vehicle answers in its place.

        The other vehicle's messages are not used, and nothing is sent to it, until the first is
        back.

        Returns:
            A sentence if another vehicle answers.
        """
        if version.uid != 0:  # a vehicle that does not know its own id says 0
            self.uid = self.uid or version.uid
            self.is_another = version.uid != self.uid
            if self.is_another:
                return (
                    f"{self} had the hardware id {self.uid:#x} and now has {version.uid:#x}: "
                    f"another vehicle, which is not commanded; give each vehicle its own system id."
                )
        return None

    def handle_timer(self, now: float) -> None:
        """Do what is due in its exchanges."""
        self.exchange.handle_timer(now)
        self.parameters.handle_timer(now)
        self.fence.handle_timer(now)

    def next_timer(self) -> float:
        """When its exchanges are due."""
        return min(
            self.exchange.next_timer(), self.parameters.next_timer(), self.fence.next_timer()
        )

    def take(self, message: Message, now: float) -> Observation | None:
        """Take a message of the vehicle, and hand answers to the exchange that waits for them.

        Args:
            message: The message; an answer only if the question was ours.
            now: Monotonic time, s.

        Returns:
            The observation to report; None for an answer.
        """
        match message:
            case PositionMessage():
                return VehiclePosition(
                    received_s=now,
                    sysid=self.sysid,
                    boot_s=message.boot_s,
                    epoch_utc_s=self.clock.to_utc(message.boot_s),
                    lat_rad=message.lat_rad,
                    lon_rad=message.lon_rad,
                    alt_amsl_m=message.alt_amsl_m,
                    velocity_enu=message.velocity_enu,
                )
            case HeartbeatMessage():
                heartbeat = self._heartbeat(message, now)
                self.exchange.on_state(heartbeat, now)
                return heartbeat
            case CommandAck():
                self.exchange.on_ack(message, now)
            case TimeSyncAnswer():
                self.round_trips.add(message.asked_ns / 1e9, message.boot_s, now)
            case FenceMessage():
                self.fence.on_message(message, now)
            case ParameterMessage():
                if self.personality is not None:
                    bytewise = self.personality.BYTEWISE_PARAMETERS
                    self.parameters.on_value(message, now, bytewise=bytewise)
            case _:
                if isinstance(message, LandedState):
                    self.exchange.on_state(message, now)
                elif isinstance(message, StatusText):
                    self.exchange.on_text(message.text, now)
                elif isinstance(message, VehicleClock):
                    return mapped(message, self.clock)
                elif isinstance(message, HomePosition):
                    self.home_alt_amsl_m = message.alt_amsl_m
                return message
        return None

    def _heartbeat(self, message: HeartbeatMessage, now: float) -> Heartbeat:
        personality = PERSONALITIES.get(message.autopilot) if message.is_multirotor else None
        self.personality = personality
        if personality is not None:
            mode, mode_name = personality.mode_of(message.custom_mode)
        else:
            mode, mode_name = Mode.OTHER, str(message.custom_mode)
        return Heartbeat(
            received_s=now,
            sysid=self.sysid,
            autopilot=message.autopilot,
            is_multirotor=message.is_multirotor,
            mode=mode,
            mode_name=mode_name,
            armed=message.armed,
            failsafe=message.failsafe,
            guided_by_stream=personality is not None and personality.GUIDED_BY_STREAM,
        )

    def packets(self) -> Iterator[Packet]:
        """Drain the packets to send; another vehicle in its place is only asked who it is."""
        for attempt in self.exchange.attempts():
            command = attempt.command
            asks = not isinstance(command, DataStream) and command.command in WHO_ARE_YOU
            if asks or not self.is_another:
                yield attempt
        others = (*self.parameters.packets(), *self.fence.packets())
        if not self.is_another:
            yield from others

    def outcomes(self) -> list[Observation]:
        """Drain how its exchanges ended."""
        return [*self.exchange.outcomes(), *self.parameters.values(), *self.fence.outcomes()]
