"""The whole swarm's MAVLink link without any I/O: datagrams in and out, facts and commands."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from swarmctl.commands import Command, GoTo
from swarmctl.link.channels import SILENT_LINK_S, Channels
from swarmctl.link.codec import decoding
from swarmctl.link.codec.framing import split
from swarmctl.link.codec.messages import AUTOPILOT_COMPONENT, Address, DataStream, Fault, Frame
from swarmctl.link.command_protocol import Attempt
from swarmctl.link.forwarding import Forwarder
from swarmctl.link.parameter_protocol import ReadPacket, SetPacket
from swarmctl.link.roster import AddressedVehicle, Roster
from swarmctl.link.signing import Signing
from swarmctl.link.vehicle import Packet
from swarmctl.link.vehicle_link import Backend


class MavlinkLink(Backend[AddressedVehicle]):
    """MAVLink with every vehicle of a swarm, however many share a port.

    The caller hands in every datagram, and after any call drains :meth:`datagrams` and
    :meth:`traffic`, too.

    Vehicles are told apart by system id. A vehicle exists from the first HEARTBEAT of its
    autopilot component on; it is answered where it was last heard from.

    An endpoint that listens (``udpin``) needs no word here. One that calls (``udpout``, TCP, a
    serial line) is announced by :meth:`open`: it gets our heartbeat before anybody was heard
    there, for nobody may know of us.

    Args:
        gcs_sysid: Our own system id; messages that carry it are nobody's.
        vehicles: System ids that belong to the swarm; None for any.
        signing: Signs what we send, and refuses what is not signed; None without a key.
        stations: Addresses of other ground stations that everything is passed on to.
        speedup: Seconds of our time in a second of the computer's: what a simulator may tell for
            UTC.

    Attributes:
        messages_in: Sound and believed frames received on the vehicles' side, from whomever.
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
        self._channels = Channels(gcs_sysid, signing)
        self._roster = Roster(
            vehicles, self._vehicles, self._channels, self.send, self._reject, speedup
        )
        self._datagrams: list[tuple[bytes, Address]] = []
        self._traffic: list[tuple[float, bytes]] = []

    # --- In and out --------------------------------------------------------------------

    def receive_datagram(self, data: bytes, address: Address, now: float) -> None:
        """Take a datagram that came from an address."""
        if self._signing is not None:
            self._signing.advance(now)
        frames, faults = split(data)
        for fault in faults:
            self._reject_bytes(fault, data, address, now)
        if self._forwarder is not None and self._forwarder.is_station(address):
            for frame in frames:
                self._pass_to_vehicles(frame, self._forwarder, address, now)
            return
        for frame in frames:
            unbelieved = self._signing.check(frame) if self._signing is not None else None
            if unbelieved is not None:
                self._reject_bytes(unbelieved, data, address, now)
                continue
            self.messages_in += 1
            self._traffic.append((now, frame.raw))
            self._channels.heard(address)
            if frame.sysid == self._gcs_sysid:
                continue
            vehicle = self._vehicles.get(frame.sysid)
            if frame.compid != AUTOPILOT_COMPONENT:
                if vehicle is None or vehicle.address == address:
                    self._pass_to_stations(frame, address)
                continue
            vehicle = vehicle or self._meet(frame, address, now)
            if vehicle is None:
                self._pass_to_stations(frame, address)
            elif self._roster.is_where(vehicle, address, now):
                self._pass_to_stations(frame, address)
                self._hear(frame, vehicle, data, now)

    def _hear(self, frame: Frame, vehicle: AddressedVehicle, data: bytes, now: float) -> None:
        """Take a frame from a vehicle of the swarm."""
        vehicle.statistics.count(frame.seq)
        vehicle.encoder.hear(frame)
        fact = decoding.read(frame, now)
        if isinstance(fact, Fault):
            self._reject_bytes(fact, data, vehicle.address, now)
        elif fact is not None:
            self._take(fact, vehicle, now)

    def _meet(self, frame: Frame, address: Address, now: float) -> AddressedVehicle | None:
        """A new vehicle, if this frame makes one: from now on it gets our heartbeat."""
        vehicle = self._roster.meet(frame, address, now)
        if vehicle is not None and self._next_period_s == math.inf:
            self._begin(now)
        return vehicle

    def _has_asked(self, vehicle: AddressedVehicle, asked_ns: int, now: float) -> bool:
        return self._channels.has_asked(vehicle.address, asked_ns)

    def send(self, command: Command, now: float) -> None:
        """See :class:`Backend`."""
        if self._signing is not None:
            self._signing.advance(now)
        super().send(command, now)

    def handle_timer(self, now: float) -> None:
        """See :class:`Backend`."""
        if self._signing is not None:
            self._signing.advance(now)
        super().handle_timer(now)

    def _every_period(self, now: float) -> None:
        addresses = (vehicle.address for vehicle in self._vehicles.values())
        for frame, address in self._channels.period(addresses, now):
            self._transmit(frame, address, now)
        for url in self._channels.silent(now):
            self._name_silence(url, now)

    # --- Endpoints ---------------------------------------------------------------------

    def listen(self, urls: Sequence[str], now: float) -> None:
        """Endpoints were opened: one on which nothing is heard is named once.

        Args:
            urls: Their URLs; the place of each is the ``endpoint`` of its addresses.
            now: Monotonic time, s.
        """
        self._channels.listen(urls, now)
        self._begin(now)

    def open(self, address: Address, now: float) -> None:
        """An endpoint that calls has a connection: it gets our heartbeat from now on."""
        self._channels.call(address)
        self._begin(now)

    def close(self, address: Address) -> None:
        """A connection was lost."""
        self._channels.hang_up(address)

    def datagrams(self) -> list[tuple[bytes, Address]]:
        """Drain what is to be sent, and where to."""
        datagrams, self._datagrams = self._datagrams, []
        return datagrams

    def traffic(self) -> list[tuple[float, bytes]]:
        """Drain every sound frame that came in or went out, with its time, for the tlog."""
        traffic, self._traffic = self._traffic, []
        return traffic

    @property
    def addresses(self) -> dict[int, Address]:
        """Where each vehicle known by its system id was last heard from."""
        return {sysid: vehicle.address for sysid, vehicle in self._vehicles.items()}

    # --- Other stations ----------------------------------------------------------------

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

    def _reject_bytes(self, fault: Fault, data: bytes, address: Address, now: float) -> None:
        detail = f"{fault.detail}, in a datagram of {len(data)} bytes from {address}."
        self._reject(fault.kind, detail, now)

    def _name_silence(self, url: str, now: float) -> None:
        """Name an endpoint on which nothing is heard; each by itself, for each has its cause."""
        self.rejected["silent_link"] += 1
        self._name(
            "silent_link",
            f"Nothing was heard on {url} for {SILENT_LINK_S:.0f} s: check power, radio and where "
            f"the vehicles send their MAVLink.",
            now,
        )

    # --- What is said ------------------------------------------------------------------

    def _set_point(self, goto: GoTo, vehicle: AddressedVehicle, now: float) -> bool:
        frame = vehicle.encoder.setpoint(goto, now)
        if frame is not None:
            self._transmit(frame, vehicle.address, now)
        return frame is not None

    def _tell(self, packet: Packet, vehicle: AddressedVehicle, now: float) -> None:
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
