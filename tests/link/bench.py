"""A link in virtual time, and vehicles made of pymavlink at the other end."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, Protocol, TypeVar

from swarmctl.commands import Command, GoTo
from swarmctl.events import InputRejected, Observation
from swarmctl.link.address import Address
from swarmctl.link.mavlink_link import MavlinkLink
from swarmctl.link.signing import Signing
from tests.link.wire import Sender, unpack

GCS = 245
AT_1 = Address("10.0.0.1", 14550)
AT_2 = Address("10.0.0.2", 14550)
ELSEWHERE = Address("10.0.0.9", 40000)

Kind = TypeVar("Kind", bound=Observation)


class Vehicle(Sender):
    """A vehicle that acknowledges commands and shows what they did, as ArduCopter does."""

    def __init__(self, sysid: int) -> None:
        super().__init__(sysid)
        self.mode = 0
        self.armed = False
        self.received: list[Any] = []

    def state(self) -> bytes:
        return self.heartbeat(mode=self.mode, armed=self.armed)

    def answer(self, datagram: bytes) -> list[bytes]:
        message = unpack(datagram)
        self.received.append(message)
        if message.get_type() != "COMMAND_LONG" or message.target_system != self.mav.srcSystem:
            return []
        ack = self.pack("COMMAND_ACK", command=message.command, target_system=GCS)
        if message.command == 176:
            self.mode = int(message.param2)
        if message.command == 400:
            self.armed = message.param1 == 1.0
        return [ack, self.state()]

    @property
    def commands(self) -> list[int]:
        return [m.command for m in self.received if m.get_type() == "COMMAND_LONG"]


class Bench:
    """A link, a clock, and what the link said."""

    def __init__(
        self,
        vehicles: Collection[int] | None = (1, 2),
        signing: Signing | None = None,
        stations: Sequence[Address] = (),
    ) -> None:
        self.link = MavlinkLink(
            gcs_sysid=GCS, vehicles=vehicles, signing=signing, stations=stations
        )
        self.now = 50.0
        self.heard: list[Observation] = []
        self.sent: list[tuple[bytes, Address]] = []

    def receive(self, datagram: bytes, address: Address = AT_1) -> None:
        self.link.receive_datagram(datagram, address, self.now)
        self.drain()

    def drain(self) -> None:
        self.heard += self.link.events()
        self.sent += self.link.datagrams()

    def wait(self, seconds: float) -> None:
        """Let time pass, serving timers when they are due and never otherwise."""
        end = self.now + seconds
        while self.link.next_timer() <= end:
            self.now = self.link.next_timer()
            self.link.handle_timer(self.now)
            self.drain()
        self.now = end

    def of(self, kind: type[Kind]) -> list[Kind]:
        return [event for event in self.heard if isinstance(event, kind)]

    def rejected(self) -> list[str]:
        return [event.kind for event in self.of(InputRejected)]

    def sent_to(self, address: Address, name: str) -> list[Any]:
        messages = [unpack(frame) for frame, where in self.sent if where == address]
        return [message for message in messages if message.get_type() == name]


class Answering(Protocol):
    """Who answers what it is sent."""

    def answer(self, datagram: bytes, /) -> list[bytes]: ...


class AnsweredBench(Bench):
    """A link to one vehicle that answers at once."""

    def __init__(self, vehicle: Answering) -> None:
        super().__init__(None)
        self._answering = vehicle

    def send(self, *commands: Command) -> None:
        for command in commands:
            self.link.send(command, self.now)
            self.drain()

    def drain(self) -> None:
        super().drain()
        sent, self.sent = self.sent, []
        for frame, address in sent:
            for answer in self._answering.answer(frame):
                self.receive(answer, address)


def goto(sysid: int, alt_amsl_m: float = 100.0) -> GoTo:
    return GoTo(
        sysid=sysid, lat_rad=0.8, lon_rad=0.1, alt_amsl_m=alt_amsl_m, velocity_enu=(1.0, 2.0, 0.0)
    )
