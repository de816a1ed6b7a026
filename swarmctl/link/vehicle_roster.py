"""Which vehicle speaks from where: new vehicles, moved ones, two with the same system id."""

from __future__ import annotations

from collections.abc import Callable, Collection

from swarmctl.commands import RequestVersion
from swarmctl.link.address import Address
from swarmctl.link.codec import decoding
from swarmctl.link.codec.encoding import Encoder, Encoders
from swarmctl.link.codec.messages import Frame, MessageId
from swarmctl.link.vehicle_clock import BootClock
from swarmctl.link.vehicle_session import SILENT_S, VehicleSession


class AddressedSession(VehicleSession):
    """What the native link keeps about one vehicle: also where it is heard and answered.

    Args:
        sysid: Its system id.
        address: Where it was heard first.
        encoder: Writes our frames to that address.
        now: Monotonic time, s.
        clock: Its time since boot against UTC, not known yet.

    Attributes:
        address: Where it was last heard.
        encoder: Writes our frames to that address.
        rival: Another address from which its system id is heard; None if there is none.
        rival_heard_s: When it was last heard there, s.
    """

    def __init__(
        self, sysid: int, address: Address, encoder: Encoder, now: float, clock: BootClock
    ) -> None:
        super().__init__(sysid, now, clock)
        self.address = address
        self.encoder = encoder
        self.rival: Address | None = None
        self.rival_heard_s = now

    def __str__(self) -> str:
        return f"{super().__str__()} at {self.address}"


class VehicleRoster:
    """The vehicles of one link.

    Args:
        expected: System ids that belong to the swarm; None for any.
        vehicles: The vehicles met so far, by system id; the roster adds to it.
        encoders: Write our frames.
        send: Sends a question to a vehicle.
        reject: Called with the kind of a fault, a sentence and the time.
        speedup: Seconds of our time in a second of the computer's.
    """

    def __init__(
        self,
        expected: Collection[int] | None,
        vehicles: dict[int, AddressedSession],
        encoders: Encoders,
        send: Callable[[RequestVersion, float], None],
        reject: Callable[[str, str, float], None],
        speedup: float,
    ) -> None:
        self._speedup = speedup
        self._expected = None if expected is None else frozenset(expected)
        self._vehicles = vehicles
        self._encoders = encoders
        self._send = send
        self._reject = reject

    def meet(self, frame: Frame, address: Address, now: float) -> AddressedSession | None:
        """The new vehicle that this frame announces; None if it announces none."""
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
        encoder, clock = self._encoders.to(address), BootClock(self._speedup)
        vehicle = AddressedSession(frame.sysid, address, encoder, now, clock)
        self._vehicles[frame.sysid] = vehicle
        return vehicle

    def may_speak_from(self, vehicle: AddressedSession, address: Address, now: float) -> bool:
        """Whether the vehicle may speak from this address.

        A vehicle that falls silent and then speaks from elsewhere has moved. Two addresses that
        speak by turns are two vehicles with the same system id: only the first is used.
        """
        if address != vehicle.address:
            if now - vehicle.heard_s < SILENT_S:
                vehicle.rival = address
                vehicle.rival_heard_s = now
                return False
            vehicle.address = address
            vehicle.encoder = self._encoders.to(address)
        elif vehicle.rival is not None and now - vehicle.rival_heard_s < SILENT_S:
            self._reject(
                "duplicate_sysid",
                f"System id {vehicle.sysid} speaks from {address} and from {vehicle.rival} "
                f"at the same time: only the first is used; give each vehicle its own id.",
                now,
            )
        vehicle.rival = None
        if vehicle.hear(now):
            self._send(RequestVersion(sysid=vehicle.sysid), now)
        return True
