"""What every vehicle link does, whoever speaks MAVLink underneath.

It routes commands to the exchanges of each vehicle, runs their timers, checks that an answer is
to a question of ours, and counts faults.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import Counter
from typing import Generic, Literal, TypeVar

from swarmctl.commands import (
    Command,
    GoTo,
    ReadParameter,
    RequestVersion,
    UploadFence,
    WriteParameter,
)
from swarmctl.events import CommandOutcome, InputRejected, Observation, VehicleVersion
from swarmctl.link.codec.messages import CommandAck, FenceMessage, Message, TimeSyncAnswer
from swarmctl.link.parameter_protocol import unread
from swarmctl.link.vehicle_link import VehicleLink
from swarmctl.link.vehicle_session import Packet, VehicleSession

PERIOD_S = 1.0
"""Time between our own heartbeats, and between two reports of link quality, s."""

SessionType = TypeVar("SessionType", bound=VehicleSession)


class LinkBase(VehicleLink, ABC, Generic[SessionType]):
    """Common part of the vehicle links; a subclass sends and receives.

    Args:
        gcs_sysid: Our own system id.
    """

    def __init__(self, gcs_sysid: int) -> None:
        self._gcs_sysid = gcs_sysid
        self._vehicles: dict[int, SessionType] = {}
        self._events: list[Observation] = []
        self._next_period_s = math.inf
        self.messages_in = 0
        self.setpoints_out = 0
        self.setpoints_dropped = 0
        self.rejected: Counter[str] = Counter()

    # --- What a subclass fills in ------------------------------------------------------

    @abstractmethod
    def _every_period(self, now: float) -> None:
        """Send our heartbeats and questions."""

    @abstractmethod
    def _has_asked(self, vehicle: SessionType, asked_ns: int, now: float) -> bool:
        """Whether a TIMESYNC answers a question of ours: other stations ask, too."""

    @abstractmethod
    def _send_setpoint(self, goto: GoTo, vehicle: SessionType, now: float) -> bool:
        """Send a setpoint if possible; returns whether it was sent."""

    @abstractmethod
    def _send_packet(self, packet: Packet, vehicle: SessionType, now: float) -> None:
        """Send a packet. One that cannot be sent is lost: its exchange asks again."""

    # --- In and out --------------------------------------------------------------------

    def send(self, command: Command, now: float) -> None:
        """See :class:`VehicleLink`."""
        vehicle = self._vehicles.get(command.sysid)
        personality = None if vehicle is None else vehicle.personality
        if isinstance(command, GoTo):
            if (
                vehicle is not None
                and personality is not None
                and not vehicle.is_another
                and _can_be_flown(command)
                and self._send_setpoint(command, vehicle, now)
            ):
                self.setpoints_out += 1
            else:
                self.setpoints_dropped += 1
        elif isinstance(command, ReadParameter | WriteParameter):
            if vehicle is None or personality is None:
                self._events.append(unread(command.parameter, command.sysid, now))
                return
            wanted = command.value if isinstance(command, WriteParameter) else None
            spellings = personality.spellings(command.parameter)
            vehicle.parameters.submit(command.parameter, spellings, wanted, now)
            self._flush(vehicle, now)
        elif vehicle is None:
            self._end(command, "no_answer", "no HEARTBEAT was heard from it", now)
        elif vehicle.is_another and not isinstance(command, RequestVersion):
            self._end(command, "refused", "another vehicle answers under its system id", now)
        elif personality is None:
            detail = "its HEARTBEAT says that it is no multirotor with ArduCopter or PX4"
            self._end(command, "refused", detail, now)
        elif isinstance(command, UploadFence):
            vehicle.fence.submit(command, now)
            self._flush(vehicle, now)
        else:
            request = personality.request_for(command, vehicle.home_alt_amsl_m)
            if isinstance(request, str):
                self._end(command, "refused", request, now)
            else:
                vehicle.exchange.submit(request, now)
                self._flush(vehicle, now)

    def handle_timer(self, now: float) -> None:
        """See :class:`VehicleLink`."""
        if now >= self._next_period_s:
            self._next_period_s += PERIOD_S
            if self._next_period_s <= now:  # nobody called for a while: no burst to catch up
                self._next_period_s = now + PERIOD_S
            self._every_period(now)
            for sysid, vehicle in self._vehicles.items():
                self._events.append(
                    vehicle.statistics.report(sysid, now, vehicle.clock, vehicle.round_trips)
                )
        for vehicle in self._vehicles.values():
            if now >= vehicle.next_timer():
                vehicle.handle_timer(now)
                self._flush(vehicle, now)

    def next_timer(self) -> float:
        """See :class:`VehicleLink`."""
        retries = (vehicle.next_timer() for vehicle in self._vehicles.values())
        return min((self._next_period_s, *retries))

    def events(self) -> list[Observation]:
        """See :class:`VehicleLink`."""
        events, self._events = self._events, []
        return events

    # --- What is heard and answered ----------------------------------------------------

    def _begin(self, now: float) -> None:
        """Send our heartbeat from now on."""
        self._next_period_s = min(self._next_period_s, now)

    def _take(self, message: Message, vehicle: SessionType, now: float) -> None:
        """Take a message of a vehicle; an answer only if the question was ours."""
        if isinstance(message, VehicleVersion):
            fault = vehicle.identify(message)
            if fault is not None:
                self._reject("changed_uid", fault, now)
        if vehicle.is_another or not self._is_for_us(message, vehicle, now):
            return
        observation = vehicle.take(message, now)
        if observation is not None:
            self._events.append(observation)
        self._flush(vehicle, now)

    def _is_for_us(self, message: Message, vehicle: SessionType, now: float) -> bool:
        match message:
            case CommandAck() | FenceMessage():
                return message.target_system in {0, self._gcs_sysid}
            case TimeSyncAnswer():
                return self._has_asked(vehicle, message.asked_ns, now)
            case _:
                return True

    def _flush(self, vehicle: SessionType, now: float) -> None:
        """Send what the vehicle's exchanges want sent, and report how they ended."""
        for packet in vehicle.packets():
            self._send_packet(packet, vehicle, now)
        self._events.extend(vehicle.outcomes())

    def _end(
        self, command: Command, result: Literal["refused", "no_answer"], detail: str, now: float
    ) -> None:
        self._events.append(
            CommandOutcome(
                received_s=now,
                sysid=command.sysid,
                command=command.kind,
                result=result,
                detail=detail,
            )
        )

    def _reject(self, kind: str, detail: str, now: float) -> None:
        """Count a fault, and name the first of its kind."""
        self.rejected[kind] += 1
        if self.rejected[kind] == 1:
            self._name(kind, detail, now)

    def _name(self, kind: str, detail: str, now: float) -> None:
        self._events.append(
            InputRejected(received_s=now, source="mavlink", kind=kind, detail=detail)
        )


def _can_be_flown(goto: GoTo) -> bool:
    """Whether a setpoint is a place on Earth with finite numbers; no other may leave."""
    return (
        abs(goto.lat_rad) <= math.pi / 2.0  # false for NaN
        and abs(goto.lon_rad) <= math.pi
        and all(map(math.isfinite, (goto.alt_amsl_m, *goto.velocity_enu)))
    )
