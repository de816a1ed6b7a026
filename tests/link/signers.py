"""Vehicles and stations that sign MAVLink, by pymavlink."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.link.signing import timestamp_at
from tests.link.wire import Sender

KEY = bytes(range(32))
START = timestamp_at(1_790_000_000.0)


class Signer(Sender):
    """A vehicle that signs, by pymavlink."""

    def __init__(
        self, sysid: int = 1, key: bytes = KEY, timestamp: int = START, link_id: int = 0
    ) -> None:
        super().__init__(sysid)
        self.mav.signing.secret_key = key
        self.mav.signing.timestamp = timestamp
        self.mav.signing.link_id = link_id
        self.mav.signing.sign_outgoing = True


def receiver(timestamp: int = START) -> Any:  # noqa: ANN401 - pymavlink is untyped
    """A station that believes what is signed with KEY, by pymavlink."""
    mav = mavlink.MAVLink(None)
    mav.signing.secret_key = KEY
    mav.signing.timestamp = timestamp
    return mav
