"""The whole swarm's MAVLink link without any I/O: datagrams in and out, facts and commands."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Sequence
from typing import Literal

from swarmctl.events import (
    Command,
    CommandOutcome,
    GoTo,
    InputRejected,
    Observation,
    ParameterValue,
    ReadParameter,
    RequestVersion,
    UploadFence,
    VehicleVersion,
    WriteParameter,
)
from swarmctl.link import decoding
from swarmctl.link.channels import SILENT_LINK_S, Channels
from swarmctl.link.facts import (
    AUTOPILOT_COMPONENT,
    Address,
    CommandAck,
    Fact,
    Fault,
    FenceFact,
    Frame,
    TimeSyncAnswer,
)
from swarmctl.link.forward import Forwarder
from swarmctl.link.framing import split
from swarmctl.link.roster import Roster
from swarmctl.link.signing import Signing
from swarmctl.link.vehicle import Vehicle

_PERIOD_S = 1.0
"""Between our own heartbeats, and between two reports of link quality."""


class MavlinkLink:
    """MAVLink with every vehicle of a swarm, however many share a port.

    The caller hands in every datagram, calls :meth:`handle_timer` when :meth:`next_timer` is
    due, and after any call drains :meth:`events`, :meth:`datagrams` and :meth:`traffic`. All
    times are monotonic seconds and must not run backwards.

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
        setpoints_out: Setpoints sent.
        setpoints_dropped: Setpoints not sent: the vehicle is unknown or of an unknown kind, or
            a field is not finite.
        rejected: How often each kind of fault was met; the first of each kind was named in an
            InputRejected.
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
        self._gcs_sysid = gcs_sysid
        self._signing = signing
        self._forwarder = Forwarder(gcs_sysid, stations) if stations else None
        self._channels = Channels(gcs_sysid, signing)
        self._roster = Roster(vehicles, self._channels, self.send, self._reject, speedup)
        self._next_period_s = math.inf
        self._events: list[Observation] = []
        self._datagrams: list[tuple[bytes, Address]] = []
        self._traffic: list[tuple[float, bytes]] = []
        self.messages_in = 0
        self.setpoints_out = 0
        self.setpoints_dropped = 0
        self.rejected: Counter[str] = Counter()

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
            vehicle = self._roster.vehicles.get(frame.sysid)
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

    def _hear(self, frame: Frame, vehicle: Vehicle, data: bytes, now: float) -> None:
        """Take a frame from a vehicle of the swarm."""
        vehicle.statistics.count(frame.seq)
        vehicle.encoder.hear(frame)
        fact = decoding.read(frame, now)
        if isinstance(fact, Fault):
            self._reject_bytes(fact, data, vehicle.address, now)
        elif fact is not None:
            if isinstance(fact, VehicleVersion):
                self._roster.identify(fact, vehicle, now)
            if not vehicle.is_another and self._is_for_us(fact, vehicle):
                observation = vehicle.take(fact, now)
                if observation is not None:
                    self._events.append(observation)
                self._flush(vehicle, now)

    def _meet(self, frame: Frame, address: Address, now: float) -> Vehicle | None:
        """A new vehicle, if this frame makes one: from now on it gets our heartbeat."""
        vehicle = self._roster.meet(frame, address, now)
        if vehicle is not None and self._next_period_s == math.inf:
            self._next_period_s = now
        return vehicle

    def _is_for_us(self, fact: Fact, vehicle: Vehicle) -> bool:
        """Whether an answer is to a question of ours: other ground stations ask, too."""
        match fact:
            case CommandAck() | FenceFact():
                return fact.target_system in {0, self._gcs_sysid}
            case TimeSyncAnswer():
                return self._channels.has_asked(vehicle.address, fact.asked_ns)
            case _:
                return True

    def send(self, command: Command, now: float) -> None:
        """Send a command, or queue it behind those its vehicle has not acknowledged yet.

        Each command ends in one CommandOutcome (one that only repeats a command which still
        waits, or is under way, shares its outcome), but for ReadParameter and WriteParameter,
        which end in a ParameterValue, and GoTo, which leaves at once, or not at all: then it is
        counted in ``setpoints_dropped``.
        """
        if self._signing is not None:
            self._signing.advance(now)
        vehicle = self._roster.vehicles.get(command.sysid)
        personality = None if vehicle is None else vehicle.personality
        if isinstance(command, GoTo):
            frame = None
            if vehicle is not None and personality is not None and not vehicle.is_another:
                frame = vehicle.encoder.setpoint(command, now)
            if vehicle is None or frame is None:
                self.setpoints_dropped += 1
            else:
                self.setpoints_out += 1
                self._transmit(frame, vehicle.address, now)
        elif isinstance(command, ReadParameter | WriteParameter):
            self._parameter(command, vehicle, now)
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
        """Do what is due: heartbeats, reports, retries."""
        if self._signing is not None:
            self._signing.advance(now)
        if now >= self._next_period_s:
            self._next_period_s += _PERIOD_S
            if self._next_period_s <= now:  # nobody called for a while: no burst to catch up
                self._next_period_s = now + _PERIOD_S
            self._every_period(now)
        for vehicle in self._roster.vehicles.values():
            if now >= vehicle.next_timer():
                vehicle.handle_timer(now)
                self._flush(vehicle, now)

    def _every_period(self, now: float) -> None:
        """Our heartbeats and questions, reports of link quality."""
        addresses = (vehicle.address for vehicle in self._roster.vehicles.values())
        for frame, address in self._channels.period(addresses, now):
            self._transmit(frame, address, now)
        for sysid, vehicle in self._roster.vehicles.items():
            self._events.append(
                vehicle.statistics.report(sysid, now, vehicle.clock, vehicle.round_trips)
            )
        for url in self._channels.silent(now):
            self._name_silence(url, now)

    def next_timer(self) -> float:
        """When :meth:`handle_timer` is due; infinity while nobody is known and none is called."""
        retries = (vehicle.next_timer() for vehicle in self._roster.vehicles.values())
        return min((self._next_period_s, *retries))

    # --- Endpoints ---------------------------------------------------------------------

    def listen(self, urls: Sequence[str], now: float) -> None:
        """Endpoints were opened: one on which nothing is heard is named once.

        Args:
            urls: Their URLs; the place of each is the ``endpoint`` of its addresses.
            now: Monotonic time, s.
        """
        self._channels.listen(urls, now)
        self._next_period_s = min(self._next_period_s, now)

    def open(self, address: Address, now: float) -> None:
        """An endpoint that calls has a connection: it gets our heartbeat from now on."""
        self._channels.call(address)
        self._next_period_s = min(self._next_period_s, now)

    def close(self, address: Address) -> None:
        """A connection was lost."""
        self._channels.hang_up(address)

    def events(self) -> list[Observation]:
        """Drain the observations, oldest first."""
        events, self._events = self._events, []
        return events

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
        return {sysid: vehicle.address for sysid, vehicle in self._roster.vehicles.items()}

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
        self._events.append(
            InputRejected(
                received_s=now,
                source="mavlink",
                kind="silent_link",
                detail=f"Nothing was heard on {url} for {SILENT_LINK_S:.0f} s: check power, radio "
                f"and where the vehicles send their MAVLink.",
            )
        )

    def _reject(self, kind: str, detail: str, now: float) -> None:
        self.rejected[kind] += 1
        if self.rejected[kind] == 1:
            self._events.append(
                InputRejected(received_s=now, source="mavlink", kind=kind, detail=detail)
            )

    # --- What is answered --------------------------------------------------------------

    def _flush(self, vehicle: Vehicle, now: float) -> None:
        """Send and report what the vehicle's exchanges have decided."""
        for frame in vehicle.frames():
            self._transmit(frame, vehicle.address, now)
        self._events.extend(vehicle.outcomes())

    def _parameter(
        self, command: ReadParameter | WriteParameter, vehicle: Vehicle | None, now: float
    ) -> None:
        if vehicle is None or vehicle.personality is None:
            self._events.append(
                ParameterValue(
                    received_s=now,
                    sysid=command.sysid,
                    parameter=command.parameter,
                    value=None,
                    own_name=command.parameter,
                )
            )
            return
        wanted = command.value if isinstance(command, WriteParameter) else None
        spellings = vehicle.personality.spellings(command.parameter)
        vehicle.parameters.submit(command.parameter, spellings, wanted, now)
        self._flush(vehicle, now)

    def _end(
        self, command: Command, result: Literal["refused", "no_answer"], detail: str, now: float
    ) -> None:
        self._events.append(
            CommandOutcome(
                received_s=now,
                sysid=command.sysid,
                command=type(command).__name__,
                result=result,
                detail=detail,
            )
        )

    def _transmit(self, frame: bytes, address: Address, now: float) -> None:
        self._datagrams.append((frame, address))
        self._traffic.append((now, frame))
