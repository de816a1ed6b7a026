"""Who gets a frame when other ground stations listen in: as mavlink-router does, without I/O.

The rules are those of https://github.com/mavlink-router/mavlink-router for its endpoints. A
frame goes to everybody, or, if it names a target system, to where that system was heard. It is
never sent where its own sender was heard; this prevents loops. Frames are passed on unchanged,
with their signatures. Nothing is passed from one station to another, and our own frames stay
between us and the vehicles.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from swarmctl.link.address import Address
from swarmctl.link.codec.framing import target_of
from swarmctl.link.codec.messages import Frame


class Forwarder:
    """Routes between the vehicles' addresses and the stations'.

    Args:
        gcs_sysid: Our own system id.
        stations: Where the stations are.
    """

    def __init__(self, gcs_sysid: int, stations: Iterable[Address]) -> None:
        self._gcs_sysid = gcs_sysid
        # Systems heard from each station.
        self._stations: dict[Address, set[int]] = {station: set() for station in stations}
        # Where each system on the vehicles' side was last heard.
        self._vehicles: dict[int, Address] = {}

    def is_station(self, address: Address) -> bool:
        """Whether an address is a station's."""
        return address in self._stations

    def from_vehicles(self, frame: Frame, address: Address) -> list[Address]:
        """The stations that a frame heard on the vehicles' side goes to."""
        if frame.sysid == self._gcs_sysid:
            return []
        senders = [sysids for sysids in self._stations.values() if frame.sysid in sysids]
        if not senders:
            self._vehicles[frame.sysid] = address
        target = target_of(frame)
        return [
            station
            for station, sysids in self._stations.items()
            if frame.sysid not in sysids and (target == 0 or target in sysids)
        ]

    def from_station(
        self, frame: Frame, station: Address
    ) -> list[Address] | Literal["loop", "our_sysid"]:
        """The vehicles' addresses that a station's frame goes to.

        Returns:
            The addresses; none if the frame is for us or for a system that was never heard. Or
            why the frame must not be passed on: its sender's system id is a vehicle's (the frame
            came back by another way) or ours.
        """
        if frame.sysid == self._gcs_sysid:
            return "our_sysid"
        if frame.sysid in self._vehicles:
            return "loop"
        self._stations[station].add(frame.sysid)
        target = target_of(frame)
        if target == 0:
            return list(dict.fromkeys(self._vehicles.values()))
        address = self._vehicles.get(target)
        return [] if address is None else [address]
