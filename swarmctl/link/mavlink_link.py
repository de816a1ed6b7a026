"""The native vehicle link: the whole swarm's MAVLink without any I/O, datagrams in and out."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import NamedTuple

from swarmctl.commands import Command, GoTo
from swarmctl.link.address import Address
from swarmctl.link.codec import decoding
from swarmctl.link.codec.encoding import Encoders
from swarmctl.link.codec.framing import split
from swarmctl.link.codec.messages import (
    AUTOPILOT_COMPONENT,
    DataStream,
    Fault,
    Frame,
)
from swarmctl.link.command_request import Attempt
from swarmctl.link.datagram_port import DatagramPort
from swarmctl.link.forwarding import Forwarder
from swarmctl.link.heartbeats import Heartbeats
from swarmctl.link.link_base import LinkBase
from swarmctl.link.parameter_protocol import ReadPacket, SetPacket
from swarmctl.link.signing import Signing
from swarmctl.link.silent_endpoints import SILENT_LINK_S, SilentEndpoints
from swarmctl.link.vehicle_roster import AddressedSession, VehicleRoster
from swarmctl.link.vehicle_session import Packet


class _Datagram(NamedTuple):
    """A datagram, where it came from and when, monotonic s."""

    data: bytes
    address: Address
    now: float


class MavlinkLink(LinkBase[AddressedSession], DatagramPort):
    """MAVLink with every vehicle of a swarm, however many share a port.

    Vehicles are told apart by system id. A vehicle is met with the first HEARTBEAT of its
    autopilot component, and is answered where it was last heard.

    Args:
        gcs_sysid: Our own system id; frames that carry it are not read.
        vehicles: System ids that belong to the swarm; None for any.
        signing: Signs what we send, and refuses what is not signed; None without a key.
        stations: Addresses of the other ground stations that every frame is passed on to.
        speedup: Seconds of our time in a second of the computer's. A simulator may take the
            computer's time for UTC.

    Attributes:
        messages_in: Sound and trusted frames received on the vehicles' side, from any sender.
    """

    def __init__(
        self,
        *,
        gcs_sysid: int,
        vehicles: Collection[int] | None,
        signing: Signing | None = None,
        stations: Sequence[Address] = (),
        speedup: float = 1.0,
    ) -> None:
        super().__init__(gcs_sysid)
        self._signing = signing
        self._forwarder = Forwarder(gcs_sysid, stations) if stations else None
        encoders = Encoders(gcs_sysid, signing)
        self._heartbeats = Heartbeats(encoders)
        self._silent_endpoints = SilentEndpoints()
        self._roster = VehicleRoster(
            vehicles, self._vehicles, encoders, self.send, self._reject, speedup
        )
        self._datagrams: list[tuple[bytes, Address]] = []
        self._traffic: list[tuple[float, bytes]] = []

    # --- What arrives: split, trust, route, locate, decode -------------------------------

    def receive_datagram(self, data: bytes, address: Address, now: float) -> None:
        """See :class:`swarmctl.link.datagram_port.DatagramPort`."""
        datagram = _Datagram(data, address, now)
        for frame in self._split(datagram):
            if self._trust(frame, datagram) and self._route(frame, datagram):
                vehicle = self._locate(frame, datagram)
                if vehicle is not None:
                    self._decode(frame, vehicle, datagram)

    def _split(self, datagram: _Datagram) -> list[Frame]:
        """The whole frames of a datagram; unusable bytes are reported."""
        if self._signing is not None:
            self._signing.advance(datagram.now)
        frames, faults = split(datagram.data)
        for fault in faults:
            self._reject_bytes(fault, datagram)
        return frames

    def _trust(self, frame: Frame, datagram: _Datagram) -> bool:
        """Whether the signature is right, where signatures are asked for.

        A frame of another ground station is only passed on: its vehicle checks it.
        """
        if self._is_station(datagram.address):
            return True
        fault = self._signing.check(frame) if self._signing is not None else None
        if fault is not None:
            self._reject_bytes(fault, datagram)
            return False
        self.messages_in += 1
        self._traffic.append((datagram.now, frame.raw))
        self._silent_endpoints.heard(datagram.address.endpoint)
        return True

    def _route(self, frame: Frame, datagram: _Datagram) -> bool:
        """Whether an autopilot sent the frame; what others send is passed on at most."""
        _, address, now = datagram
        if self._forwarder is not None and self._forwarder.is_station(address):
            self._pass_to_vehicles(frame, self._forwarder, address, now)
            return False
        if frame.sysid == self._gcs_sysid:
            return False
        if frame.compid != AUTOPILOT_COMPONENT:
            vehicle = self._vehicles.get(frame.sysid)
            if vehicle is None or vehicle.address == address:
                self._pass_to_stations(frame, address)
            return False
        return True

    def _locate(self, frame: Frame, datagram: _Datagram) -> AddressedSession | None:
        """The vehicle that sent the frame, if it may speak from there; then it is passed on.

        A HEARTBEAT may make a new vehicle: our heartbeat is sent from now on. A frame of a
        system that is none of our vehicles is passed on, too.
        """
        _, address, now = datagram
        vehicle = self._vehicles.get(frame.sysid)
        if vehicle is None:
            vehicle = self._roster.meet(frame, address, now)
            if vehicle is None:
                self._pass_to_stations(frame, address)
                return None
            if self._next_period_s == math.inf:
                self._begin(now)
        if not self._roster.may_speak_from(vehicle, address, now):
            return None
        self._pass_to_stations(frame, address)
        return vehicle

    def _decode(self, frame: Frame, vehicle: AddressedSession, datagram: _Datagram) -> None:
        """Count the frame and take what it says."""
        vehicle.statistics.count(frame.seq)
        vehicle.encoder.hear(frame)
        message = decoding.read(frame, datagram.now)
        if isinstance(message, Fault):
            self._reject_bytes(message, datagram)
        elif message is not None:
            self._take(message, vehicle, datagram.now)

    # --- Commands and timer --------------------------------------------------------------

    def send(self, command: Command, now: float) -> None:
        """See :class:`swarmctl.link.vehicle_link.VehicleLink`."""
        if self._signing is not None:
            self._signing.advance(now)
        super().send(command, now)

    def handle_timer(self, now: float) -> None:
        """See :class:`swarmctl.link.vehicle_link.VehicleLink`."""
        if self._signing is not None:
            self._signing.advance(now)
        super().handle_timer(now)

    def _every_period(self, now: float) -> None:
        addresses = (vehicle.address for vehicle in self._vehicles.values())
        for frame, address in self._heartbeats.period(addresses, now):
            self._transmit(frame, address, now)
        for url in self._silent_endpoints.overdue(now):
            self._name_silence(url, now)

    def _has_asked(self, vehicle: AddressedSession, asked_ns: int, now: float) -> bool:
        return self._heartbeats.has_asked(vehicle.address, asked_ns)

    # --- Endpoints -----------------------------------------------------------------------

    def listen(self, urls: Sequence[str], now: float) -> None:
        """See :class:`swarmctl.link.datagram_port.DatagramPort`."""
        self._silent_endpoints.listen(urls, now)
        self._begin(now)

    def open(self, address: Address, now: float) -> None:
        """See :class:`swarmctl.link.datagram_port.DatagramPort`."""
        self._heartbeats.call(address)
        self._begin(now)

    def close(self, address: Address) -> None:
        """See :class:`swarmctl.link.datagram_port.DatagramPort`."""
        self._heartbeats.hang_up(address)

    def datagrams(self) -> list[tuple[bytes, Address]]:
        """See :class:`swarmctl.link.datagram_port.DatagramPort`."""
        datagrams, self._datagrams = self._datagrams, []
        return datagrams

    def traffic(self) -> list[tuple[float, bytes]]:
        """See :class:`swarmctl.link.datagram_port.DatagramPort`."""
        traffic, self._traffic = self._traffic, []
        return traffic

    @property
    def addresses(self) -> dict[int, Address]:
        """Where each vehicle known by its system id was last heard from."""
        return {sysid: vehicle.address for sysid, vehicle in self._vehicles.items()}

    # --- Other stations ------------------------------------------------------------------

    def _is_station(self, address: Address) -> bool:
        return self._forwarder is not None and self._forwarder.is_station(address)

    def _pass_to_stations(self, frame: Frame, address: Address) -> None:
        if self._forwarder is not None:
            for station in self._forwarder.from_vehicles(frame, address):
                self._datagrams.append((frame.raw, station))

    def _pass_to_vehicles(
        self, frame: Frame, forwarder: Forwarder, station: Address, now: float
    ) -> None:
        addresses = forwarder.from_station(frame, station)
        if addresses == "our_sysid":
            self._reject(
                "our_sysid",
                f"The ground station at {station} uses our own system id {self._gcs_sysid}: give "
                f"it another one, or change swarm.gcs_sysid.",
                now,
            )
        elif addresses == "loop":
            self._reject(
                "forwarding_loop",
                f"Frames of vehicle {frame.sysid} come back from the ground station at {station} "
                f"and are dropped: let it pass on nothing to this port.",
                now,
            )
        else:
            for address in addresses:
                self._transmit(frame.raw, address, now)

    # --- What is refused ------------------------------------------------------------------

    def _reject_bytes(self, fault: Fault, datagram: _Datagram) -> None:
        data, address, now = datagram
        detail = f"{fault.detail}, in a datagram of {len(data)} bytes from {address}."
        self._reject(fault.kind, detail, now)

    def _name_silence(self, url: str, now: float) -> None:
        """Name a silent endpoint; each is named, because each has its own cause."""
        self.rejected["silent_link"] += 1
        self._name(
            "silent_link",
            f"Nothing was heard on {url} for {SILENT_LINK_S:.0f} s: check power, radio and where "
            f"the vehicles send their MAVLink.",
            now,
        )

    # --- What is said ------------------------------------------------------------------

    def _send_setpoint(self, goto: GoTo, vehicle: AddressedSession, now: float) -> bool:
        frame = vehicle.encoder.setpoint(goto, now)
        if frame is not None:
            self._transmit(frame, vehicle.address, now)
        return frame is not None

    def _send_packet(self, packet: Packet, vehicle: AddressedSession, now: float) -> None:
        encoder, sysid = vehicle.encoder, vehicle.sysid
        match packet:
            case Attempt():
                command = packet.command
                frame = (
                    encoder.request_data_stream(sysid, command)
                    if isinstance(command, DataStream)
                    else encoder.command_long(sysid, command, packet.confirmation)
                )
            case ReadPacket():
                frame = encoder.param_request_read(sysid, packet.name)
            case SetPacket():
                frame = encoder.param_set(sysid, packet.name, packet.raw, packet.kind)
            case _:
                frame = encoder.plan(sysid, packet)
        self._transmit(frame, vehicle.address, now)

    def _transmit(self, frame: bytes, address: Address, now: float) -> None:
        self._datagrams.append((frame, address))
        self._traffic.append((now, frame))
