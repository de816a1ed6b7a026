"""The vehicles' link on MAVSDK 4: it holds the sockets and speaks MAVLink, for teams that run it.

MAVSDK opens the connections, finds the vehicles, and reads and writes every message, by its
MavlinkDirect plugin. For what its typed plugins leave out is needed here: the time since boot of
a position, SYSTEM_TIME, and a setpoint that is gone when the controller stops (its Offboard
plugin repeats the last one for ever, and knows no global position with a velocity). How each
autopilot is asked, and when a command counts as done, is the same as on the native link.

MAVSDK calls back on a thread of its own; there a message is only put into the inbox, and
:meth:`MavsdkLink.handle_timer` takes it out again.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Collection, Sequence
from typing import Any, Literal

from mavsdk.component_type import ComponentType
from mavsdk.exceptions import ConnectionError as MavsdkConnectionError
from mavsdk.logging import log_subscribe
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.mavlink_direct import MavlinkDirect, MavlinkDirectError, MavlinkMessage

from swarmctl.errors import LinkError
from swarmctl.events import (
    Command,
    CommandOutcome,
    GoTo,
    Heartbeat,
    HomePosition,
    InputRejected,
    LandedState,
    Mode,
    Observation,
    ParameterValue,
    ReadParameter,
    RequestVersion,
    StatusText,
    VehicleClock,
    VehiclePosition,
    VehicleVersion,
    WriteParameter,
)
from swarmctl.link import mavsdk_messages as messages
from swarmctl.link.autopilots.personality import PERSONALITIES, Personality
from swarmctl.link.clock import BootClock, RoundTrips
from swarmctl.link.endpoints.url import parse_url
from swarmctl.link.exchange import Exchange
from swarmctl.link.facts import (
    CommandAck,
    DataStream,
    Fact,
    Fault,
    HeartbeatFact,
    ParameterFact,
    PositionFact,
    TimeSyncAnswer,
)
from swarmctl.link.parameters import ParameterExchange, ReadPacket
from swarmctl.link.statistics import LinkStatistics
from swarmctl.link.vehicle import WHO_ARE_YOU, mapped

_PERIOD_S = 1.0
"""Between two of our heartbeats, and between two reports of link quality."""
_SILENT_S = 2.0
"""A vehicle that comes back after this time is asked whether it is the one that we knew."""


class _Vehicle:
    """What the link keeps about one vehicle."""

    def __init__(self, sysid: int, direct: MavlinkDirect, now: float, speedup: float) -> None:
        self.direct = direct
        self.heard_s = now
        self.personality: Personality | None = None
        self.home_alt_amsl_m: float | None = None
        self.uid = 0
        self.is_another = False
        self.clock = BootClock(speedup)
        self.round_trips = RoundTrips()
        self.statistics = LinkStatistics(now)
        self.exchange = Exchange(sysid)
        self.parameters = ParameterExchange(sysid)

    def next_timer(self) -> float:
        """When its exchanges are due."""
        return min(self.exchange.next_timer(), self.parameters.next_timer())


class MavsdkLink:
    """The vehicles of a swarm by MAVSDK; a context manager that closes its connections.

    It is driven as :class:`swarmctl.link.backend.Backend` says. MAVSDK tells neither addresses
    nor sequence numbers, so two vehicles with the same system id are told apart only by their
    hardware ids, and losses are not counted.

    Args:
        gcs_sysid: Our own system id.
        vehicles: System ids that belong to the swarm; None for any.
        speedup: Seconds of our time in a second of the computer's.

    Attributes:
        messages_in: Messages taken from the vehicles, of those kinds that are read.
        setpoints_out: Setpoints sent.
        setpoints_dropped: Setpoints not sent: the vehicle is unknown or of an unknown kind, a
            field is not finite, or MAVSDK would not send it.
        rejected: How often each kind of fault was met; the first of each kind was named in an
            InputRejected.
    """

    def __init__(
        self, *, gcs_sysid: int, vehicles: Collection[int] | None, speedup: float = 1.0
    ) -> None:
        self._speedup = speedup
        self._gcs_sysid = gcs_sysid
        self._expected = None if vehicles is None else frozenset(vehicles)
        self._wake: Callable[[], object]
        self._woken = False
        self._inbox: deque[MavlinkMessage | None] = deque()  # None: a system is new
        self._vehicles: dict[int, _Vehicle] = {}
        self._events: list[Observation] = []
        self._next_period_s = math.inf
        self.messages_in = 0
        self.setpoints_out = 0
        self.setpoints_dropped = 0
        self.rejected: Counter[str] = Counter()
        log_subscribe(lambda *_: True)  # it would print into the operator's console
        settings = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        settings.system_id = gcs_sysid
        self._mavsdk = Mavsdk(settings)
        self._mavsdk.subscribe_on_new_system(lambda _: self._put(None))

    def connect(self, urls: Sequence[str], wake: Callable[[], object]) -> None:
        """Open connections.

        Args:
            urls: See :func:`swarmctl.link.endpoints.url.parse_url`.
            wake: Called on a thread of MAVSDK's when there is something in the inbox again.

        Raises:
            UsageError: A URL is none.
            LinkError: MAVSDK cannot open one.
        """
        self._wake = wake
        for url in map(parse_url, urls):
            try:
                # What is tcp:// to everybody else is tcpout:// to MAVSDK.
                name = str(url).replace("tcp://", "tcpout://")
                self._mavsdk.add_any_connection_with_handle(name)
            except MavsdkConnectionError as error:
                raise LinkError(
                    f"MAVSDK cannot open {url} ({error}): is the port in use, is the device there?"
                ) from error

    def __enter__(self) -> MavsdkLink:
        return self

    def __exit__(self, *_: object) -> None:
        self._mavsdk.destroy()

    # --- In and out --------------------------------------------------------------------

    def send(self, command: Command, now: float) -> None:
        """Send a command, or queue it; the outcomes are those of MavlinkLink."""
        vehicle = self._vehicles.get(command.sysid)
        personality = None if vehicle is None else vehicle.personality
        if isinstance(command, GoTo):
            self._set_point(command, vehicle, now)
        elif isinstance(command, ReadParameter | WriteParameter):
            self._parameter(command, vehicle, now)
        elif vehicle is None:
            self._end(command, "no_answer", "no HEARTBEAT was heard from it", now)
        elif vehicle.is_another and not isinstance(command, RequestVersion):
            self._end(command, "refused", "another vehicle answers under its system id", now)
        elif personality is None:
            detail = "its HEARTBEAT says that it is no multirotor with ArduCopter or PX4"
            self._end(command, "refused", detail, now)
        else:
            request = personality.request_for(command, vehicle.home_alt_amsl_m)
            if isinstance(request, str):
                self._end(command, "refused", request, now)
            else:
                vehicle.exchange.submit(request, now)
                self._flush(vehicle, command.sysid, now)

    def handle_timer(self, now: float) -> None:
        """Take what came in, and do what is due: questions, reports, retries."""
        self._woken = False
        while self._inbox:
            message = self._inbox.popleft()
            if message is None:
                self._meet(now)
            else:
                self._hear(message, now)
        if now >= self._next_period_s:
            self._next_period_s += _PERIOD_S
            if self._next_period_s <= now:  # nobody called for a while: no burst to catch up
                self._next_period_s = now + _PERIOD_S
            for sysid, vehicle in self._vehicles.items():
                # MAVSDK's own comes by the wall clock, which a simulation may outrun.
                self._transmit(vehicle, "HEARTBEAT", messages.HEARTBEAT)
                self._transmit(vehicle, "TIMESYNC", messages.timesync(round(now * 1e9)))
                self._events.append(
                    vehicle.statistics.report(sysid, now, vehicle.clock, vehicle.round_trips)
                )
        for sysid, vehicle in self._vehicles.items():
            if now >= vehicle.next_timer():
                vehicle.exchange.handle_timer(now)
                vehicle.parameters.handle_timer(now)
                self._flush(vehicle, sysid, now)

    def next_timer(self) -> float:
        """When :meth:`handle_timer` is due: at once if something has come in."""
        if self._inbox:
            return -math.inf
        return min((self._next_period_s, *(v.next_timer() for v in self._vehicles.values())))

    def events(self) -> list[Observation]:
        """Drain the observations, oldest first."""
        events, self._events = self._events, []
        return events

    # --- What is heard -----------------------------------------------------------------

    def _put(self, message: MavlinkMessage | None) -> None:
        """On a thread of MAVSDK's."""
        self._inbox.append(message)
        if not self._woken:
            self._woken = True
            self._wake()

    def _meet(self, now: float) -> None:
        """Take up the systems that MAVSDK has found."""
        for system in self._mavsdk.get_systems():
            sysid = system.get_system_id()
            if sysid in self._vehicles:
                continue
            if self._expected is not None and sysid not in self._expected:
                detail = f"System id {sysid} is no vehicle of this mission: keep it off this port."
                self._reject("unexpected_vehicle", detail, now)
                continue
            direct = MavlinkDirect(system)
            self._vehicles[sysid] = _Vehicle(sysid, direct, now, self._speedup)
            self._next_period_s = min(self._next_period_s, now)
            for name in messages.MESSAGES:
                direct.subscribe_message(name, lambda message, _: self._put(message))

    def _hear(self, message: Any, now: float) -> None:  # noqa: ANN401 - untyped package
        vehicle = self._vehicles.get(message.system_id)
        if vehicle is None or message.component_id != messages.AUTOPILOT_COMPONENT:
            return
        self.messages_in += 1
        vehicle.statistics.count(vehicle.statistics.messages_in & 0xFF)
        sysid = message.system_id
        silent_s, vehicle.heard_s = now - vehicle.heard_s, now
        if silent_s >= _SILENT_S and vehicle.uid:
            self.send(RequestVersion(sysid=sysid), now)
        fact = messages.read(message.message_name, message.fields_json, sysid, now)
        if isinstance(fact, Fault):
            self._reject(fact.kind, f"{fact.detail}.", now)
        elif fact is not None:
            if isinstance(fact, VehicleVersion):
                self._identify(fact, vehicle, now)
            if not vehicle.is_another:
                self._take(fact, sysid, vehicle, now)

    def _identify(self, version: VehicleVersion, vehicle: _Vehicle, now: float) -> None:
        """Keep a vehicle's hardware id, or find that another vehicle answers in its place."""
        if version.uid == 0:  # not known to itself
            return
        vehicle.uid = vehicle.uid or version.uid
        vehicle.is_another = version.uid != vehicle.uid
        if vehicle.is_another:
            self._reject(
                "changed_uid",
                f"System id {version.sysid} had the hardware id {vehicle.uid:#x} and now has "
                f"{version.uid:#x}: another vehicle, which is not commanded; give each vehicle "
                f"its own system id.",
                now,
            )

    def _take(self, fact: Fact, sysid: int, vehicle: _Vehicle, now: float) -> None:
        """Report a fact and let those who wait for it know."""
        match fact:
            case PositionFact():
                self._events.append(
                    VehiclePosition(
                        received_s=now,
                        sysid=sysid,
                        boot_s=fact.boot_s,
                        epoch_utc_s=vehicle.clock.to_utc(fact.boot_s),
                        lat_rad=fact.lat_rad,
                        lon_rad=fact.lon_rad,
                        alt_amsl_m=fact.alt_amsl_m,
                        velocity_enu=fact.velocity_enu,
                    )
                )
                return
            case HeartbeatFact():
                heartbeat = _heartbeat(fact, sysid, vehicle, now)
                self._events.append(heartbeat)
                vehicle.exchange.on_state(heartbeat, now)
            case CommandAck():
                if fact.target_system in {0, self._gcs_sysid}:
                    vehicle.exchange.on_ack(fact, now)
            case TimeSyncAnswer():
                # MAVSDK may ask, too, by another clock: the future and the far past are not ours.
                if now - _PERIOD_S <= fact.asked_ns / 1e9 <= now:
                    vehicle.round_trips.add(fact.asked_ns / 1e9, fact.boot_s, now)
                return
            case ParameterFact():
                if vehicle.personality is not None:
                    bytewise = vehicle.personality.BYTEWISE_PARAMETERS
                    vehicle.parameters.on_value(fact, now, bytewise=bytewise)
            case VehicleClock():
                clock = mapped(fact, vehicle.clock)
                if clock is not None:
                    self._events.append(clock)
            case Observation():
                self._events.append(fact)
                if isinstance(fact, LandedState):
                    vehicle.exchange.on_state(fact, now)
                elif isinstance(fact, StatusText):
                    vehicle.exchange.on_text(fact.text, now)
                elif isinstance(fact, HomePosition):
                    vehicle.home_alt_amsl_m = fact.alt_amsl_m
        self._flush(vehicle, sysid, now)

    def _reject(self, kind: str, detail: str, now: float) -> None:
        self.rejected[kind] += 1
        if self.rejected[kind] == 1:
            self._events.append(
                InputRejected(received_s=now, source="mavlink", kind=kind, detail=detail)
            )

    # --- What is said ------------------------------------------------------------------

    def _set_point(self, command: GoTo, vehicle: _Vehicle | None, now: float) -> None:
        fields = messages.setpoint(command, now)
        if (
            vehicle is not None
            and vehicle.personality is not None
            and not vehicle.is_another
            and fields is not None
            and self._transmit(vehicle, "SET_POSITION_TARGET_GLOBAL_INT", fields)
        ):
            self.setpoints_out += 1
        else:
            self.setpoints_dropped += 1

    def _parameter(
        self, command: ReadParameter | WriteParameter, vehicle: _Vehicle | None, now: float
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
        self._flush(vehicle, command.sysid, now)

    def _flush(self, vehicle: _Vehicle, sysid: int, now: float) -> None:
        """Send and report what the vehicle's exchanges have decided."""
        for attempt in vehicle.exchange.attempts():
            if isinstance(attempt.command, DataStream):
                if not vehicle.is_another:
                    wanted = messages.request_data_stream(sysid, attempt.command)
                    self._transmit(vehicle, "REQUEST_DATA_STREAM", wanted)
            elif not vehicle.is_another or attempt.command.command in WHO_ARE_YOU:
                fields = messages.command_long(sysid, attempt.command, attempt.confirmation)
                self._transmit(vehicle, "COMMAND_LONG", fields)
        self._events.extend(vehicle.exchange.outcomes())
        for packet in vehicle.parameters.packets():
            if vehicle.is_another:
                continue
            if isinstance(packet, ReadPacket):
                asked = messages.param_request_read(sysid, packet.name)
                self._transmit(vehicle, "PARAM_REQUEST_READ", asked)
            else:
                setting = messages.param_set(sysid, packet.name, packet.raw, packet.kind)
                if setting is not None:
                    self._transmit(vehicle, "PARAM_SET", setting)
        self._events.extend(vehicle.parameters.values())

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

    @staticmethod
    def _transmit(vehicle: _Vehicle, name: str, fields: str) -> bool:
        """Whether MAVSDK sent the message; whoever waits for an answer asks again if not."""
        try:
            vehicle.direct.send_message(MavlinkMessage(message_name=name, fields_json=fields))
        except MavlinkDirectError:
            return False
        return True


def _heartbeat(fact: HeartbeatFact, sysid: int, vehicle: _Vehicle, now: float) -> Heartbeat:
    personality = PERSONALITIES.get(fact.autopilot) if fact.is_multirotor else None
    vehicle.personality = personality
    if personality is not None:
        mode, mode_name = personality.mode_of(fact.custom_mode)
    else:
        mode, mode_name = Mode.OTHER, str(fact.custom_mode)
    return Heartbeat(
        received_s=now,
        sysid=sysid,
        autopilot=fact.autopilot,
        is_multirotor=fact.is_multirotor,
        mode=mode,
        mode_name=mode_name,
        armed=fact.armed,
        failsafe=fact.failsafe,
        guided_by_stream=personality is not None and personality.GUIDED_BY_STREAM,
    )
