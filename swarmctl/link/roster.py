"""Who speaks: the vehicles by system id, where each is heard, and whether it is still the same."""

from __future__ import annotations

from collections.abc import Callable, Collection

from swarmctl.events import RequestVersion, VehicleVersion
from swarmctl.link import decoding
from swarmctl.link.channels import Channels
from swarmctl.link.clock import BootClock
from swarmctl.link.facts import Address, Frame, MessageId
from swarmctl.link.vehicle import Vehicle

_SAME_TIME_S = 2.0
"""Two addresses heard within this time speak at the same time."""


class Roster:
    """The vehicles of one link.

    Args:
        expected: System ids that belong to the swarm; None for any.
        channels: The addresses.
        send: Sends a question to a vehicle.
        reject: Told of what is not believed: its kind, a sentence and the time.
        speedup: Seconds of our time in a second of the computer's.

    Attributes:
        vehicles: The vehicles met, by system id.
    """

    def __init__(
        self,
        expected: Collection[int] | None,
        channels: Channels,
        send: Callable[[RequestVersion, float], None],
        reject: Callable[[str, str, float], None],
        speedup: float,
    ) -> None:
        self._speedup = speedup
        self._expected = None if expected is None else frozenset(expected)
        self._channels = channels
        self._send = send
        self._reject = reject
        self.vehicles: dict[int, Vehicle] = {}

    def meet(self, frame: Frame, address: Address, now: float) -> Vehicle | None:
        """A new vehicle, if this frame makes one."""
        if frame.message_id != MessageId.HEARTBEAT or decoding.read(frame, now) is None:
            return None
        # System id 0 would make every command a broadcast.
        if frame.sysid == 0 or (self._expected is not None and frame.sysid not in self._expected):
            self._reject(
                "unexpected_vehicle",
                f"System id {frame.sysid} at {address} is no vehicle of this mission: give "
                f"it an id of the mission's, or keep it off this port.",
                now,
            )
            return None
        encoder, clock = self._channels.encoder(address), BootClock(self._speedup)
        vehicle = Vehicle(frame.sysid, address, encoder, now, clock)
        self.vehicles[frame.sysid] = vehicle
        return vehicle

    def is_where(self, vehicle: Vehicle, address: Address, now: float) -> bool:
        """Whether the vehicle may speak from this address.

        One that falls silent and comes back elsewhere has moved. While two addresses speak by
        turns they are two vehicles with the same system id, and the first is the one.
        """
        if address == vehicle.address:
            silent_s, vehicle.heard_s = now - vehicle.heard_s, now
            if silent_s >= _SAME_TIME_S:
                self._ask_who(vehicle, now)
            if vehicle.rival is not None and now - vehicle.rival_heard_s < _SAME_TIME_S:
                self._reject(
                    "duplicate_sysid",
                    f"System id {vehicle.sysid} speaks from {address} and from {vehicle.rival} "
                    f"at the same time: only the first is used; give each vehicle its own id.",
                    now,
                )
            vehicle.rival = None
            return True
        if now - vehicle.heard_s < _SAME_TIME_S:
            vehicle.rival = address
            vehicle.rival_heard_s = now
            return False
        vehicle.address = address
        vehicle.encoder = self._channels.encoder(address)
        vehicle.heard_s = now
        vehicle.rival = None
        self._ask_who(vehicle, now)
        return True

    def _ask_who(self, vehicle: Vehicle, now: float) -> None:
        """Ask a vehicle that came back whether it is the one that we knew."""
        if vehicle.uid:
            self._send(RequestVersion(sysid=vehicle.sysid), now)

    def identify(self, version: VehicleVersion, vehicle: Vehicle, now: float) -> None:
        """Keep a vehicle's hardware id, or find that another vehicle answers in its place.

        What another vehicle says is not used, and it is told nothing, until the first is back.
        """
        if version.uid == 0:  # not known to itself
            return
        vehicle.uid = vehicle.uid or version.uid
        vehicle.is_another = version.uid != vehicle.uid
        if vehicle.is_another:
            self._reject(
                "changed_uid",
                f"System id {version.sysid} at {vehicle.address} had the hardware id "
                f"{vehicle.uid:#x} and now has {version.uid:#x}: another vehicle, which is not "
                f"commanded; give each vehicle its own system id.",
                now,
            )
