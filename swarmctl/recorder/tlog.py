"""The MAVLink log (``.tlog``) that MAVProxy, Mission Planner, QGroundControl and pymavlink read.

Per frame: 8 bytes, big-endian, microseconds of UTC; then the frame as on the wire. MAVProxy
keeps the number of the link in the two low bits of the time; there is one link here, number 0.
"""

from __future__ import annotations

import struct
from pathlib import Path

_TIME = struct.Struct(">Q")
_LINK_BITS = 3


class TlogWriter:
    """Writes a ``.tlog`` file.

    Args:
        path: File to create.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")

    def write(self, raw: bytes, utc_s: float) -> None:
        """Append one MAVLink frame, received or sent at ``utc_s`` (UTC, s)."""
        self._file.write(_TIME.pack(round(utc_s * 1e6) & ~_LINK_BITS) + raw)

    def close(self) -> None:
        """Finish the file."""
        self._file.close()
