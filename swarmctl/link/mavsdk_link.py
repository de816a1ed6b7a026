"""The vehicle link on MAVSDK 4, which holds the sockets and speaks MAVLink itself.

MAVSDK opens the connections, finds the vehicles, and reads and writes every message by its
MavlinkDirect plugin. Its typed plugins do not suffice: they lack the time since boot of a position
and SYSTEM_TIME, and the Offboard plugin repeats the last setpoint for ever, even when the
controller has stopped, and knows no global position with a velocity. How each autopilot is asked,
and when a command counts as done, is the same as on the native link.

MAVSDK calls back on a thread of its own; there a message is only put into the inbox, and
:meth:`MavsdkLink.handle_timer` takes it out again.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection, Sequence
from typing import Any

from mavsdk.component_type import ComponentType
from mavsdk.exceptions import ConnectionError as MavsdkConnectionError
from mavsdk.logging import log_subscribe
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.mavlink_direct import MavlinkDirect, MavlinkDirectError, MavlinkMessage

from swarmctl.commands import Command, GoTo, RequestVersion, UploadFence
from swarmctl.errors import LinkError
from swarmctl.link import mavsdk_messages as messages
from swarmctl.link.codec.messages import AUTOPILOT_COMPONENT, CommandLong, DataStream, Fault
from swarmctl.link.command_request import Attempt
from swarmctl.link.endpoints.url import parse_url
from swarmctl.link.link_base import PERIOD_S, LinkBase
from swarmctl.link.parameter_protocol import ReadPacket, SetPacket
from swarmctl.link.vehicle_clock import BootClock
from swarmctl.link.vehicle_session import Packet, VehicleSession


class _MavsdkSession(VehicleSession):
    """A vehicle and MAVSDK's way to it."""

    def __init__(self, sysid: int, direct: MavlinkDirect, now: float, clock: BootClock) -> None:
        super().__init__(sysid, now, clock)
        self.direct = direct


class MavsdkLink(LinkBase[_MavsdkSession]):
    """The vehicles of a swarm by MAVSDK; :meth:`close` ends its connections.

    MAVSDK tells neither addresses nor sequence numbers: two vehicles with the same system id are
    told apart only by their hardware ids, and losses are not counted. Fences are not uploaded.

    Args:
        gcs_sysid: Our own system id.
        vehicles: System ids that belong to the swarm; None for any.
        speedup: Seconds of our time in a second of the computer's.
    """

    def __init__(
        self, *, gcs_sysid: int, vehicles: Collection[int] | None, speedup: float = 1.0
    ) -> None:
        super().__init__(gcs_sysid)
        self._speedup = speedup
        self._expected = None if vehicles is None else frozenset(vehicles)
        self._wake: Callable[[], object]
        self._woken = False
        self._inbox: deque[MavlinkMessage | None] = deque()  # None: MAVSDK has found a system
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

    def close(self) -> None:
        """Close the connections; the link is of no use afterwards."""
        self._mavsdk.destroy()

    # --- In and out --------------------------------------------------------------------

    def send(self, command: Command, now: float) -> None:
        """See :class:`swarmctl.link.vehicle_link.VehicleLink`."""
        if isinstance(command, UploadFence):
            self._end(command, "refused", "no fence is uploaded by MAVSDK here", now)
        else:
            super().send(command, now)

    def handle_timer(self, now: float) -> None:
        """Take what came in, and do what is due."""
        self._woken = False
        while self._inbox:
            message = self._inbox.popleft()
            if message is None:
                self._meet(now)
            else:
                self._hear(message, now)
        super().handle_timer(now)

    def next_timer(self) -> float:
        """See :class:`swarmctl.link.vehicle_link.VehicleLink`; at once if something has come in."""
        return -math.inf if self._inbox else super().next_timer()

    # --- What is heard -----------------------------------------------------------------

    def _put(self, message: MavlinkMessage | None) -> None:
        """Put a message into the inbox; called on a thread of MAVSDK's."""
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
            self._vehicles[sysid] = _MavsdkSession(sysid, direct, now, BootClock(self._speedup))
            self._begin(now)
            for name in messages.MESSAGES:
                direct.subscribe_message(name, lambda message, _: self._put(message))

    def _hear(self, message: Any, now: float) -> None:  # noqa: ANN401 - untyped package
        vehicle = self._vehicles.get(message.system_id)
        if vehicle is None or message.component_id != AUTOPILOT_COMPONENT:
            return
        self.messages_in += 1
        vehicle.statistics.count(vehicle.statistics.messages_in & 0xFF)
        if vehicle.hear(now):
            self.send(RequestVersion(sysid=vehicle.sysid), now)
        said = messages.read(message.message_name, message.fields_json, vehicle.sysid, now)
        if isinstance(said, Fault):
            self._reject(said.kind, f"{said.detail}.", now)
        elif said is not None:
            self._take(said, vehicle, now)

    def _has_asked(self, vehicle: _MavsdkSession, asked_ns: int, now: float) -> bool:
        # MAVSDK asks, too, by another clock: a time in the future or long ago is not ours.
        return now - PERIOD_S <= asked_ns / 1e9 <= now

    # --- What is said ------------------------------------------------------------------

    def _every_period(self, now: float) -> None:
        for vehicle in self._vehicles.values():
            # MAVSDK sends its own heartbeat by the wall clock, which a simulation may outrun.
            self._transmit(vehicle, "HEARTBEAT", messages.HEARTBEAT)
            self._transmit(vehicle, "TIMESYNC", messages.timesync(round(now * 1e9)))

    def _send_setpoint(self, goto: GoTo, vehicle: _MavsdkSession, now: float) -> bool:
        name = "SET_POSITION_TARGET_GLOBAL_INT"
        return self._transmit(vehicle, name, messages.setpoint(goto, now))

    def _send_packet(self, packet: Packet, vehicle: _MavsdkSession, now: float) -> None:
        sysid = vehicle.sysid
        match packet:
            case Attempt(command=DataStream() as stream):
                wanted = messages.request_data_stream(sysid, stream)
                self._transmit(vehicle, "REQUEST_DATA_STREAM", wanted)
            case Attempt(command=CommandLong() as command):
                fields = messages.command_long(sysid, command, packet.confirmation)
                self._transmit(vehicle, "COMMAND_LONG", fields)
            case ReadPacket():
                asked = messages.param_request_read(sysid, packet.name)
                self._transmit(vehicle, "PARAM_REQUEST_READ", asked)
            case SetPacket():
                setting = messages.param_set(sysid, packet.name, packet.raw, packet.kind)
                self._transmit(vehicle, "PARAM_SET", setting)

    @staticmethod
    def _transmit(vehicle: _MavsdkSession, name: str, fields: str | None) -> bool:
        """Send a message; returns whether there was one and MAVSDK sent it."""
        if fields is None:
            return False
        try:
            vehicle.direct.send_message(MavlinkMessage(message_name=name, fields_json=fields))
        except MavlinkDirectError:
            return False
        return True
