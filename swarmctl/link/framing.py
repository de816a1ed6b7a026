"""Whole frames out of a stream of bytes: what TCP and serial lines need and UDP does not."""

from __future__ import annotations

from swarmctl.link import codec


class Framer:
    """Cuts one connection's stream where no frame is under way.

    What it hands out can be treated as a datagram: it holds whole frames, and whatever lies
    between them, for :func:`swarmctl.link.codec.split` to check and to count. What it keeps is
    the beginning of a frame, so never more than the longest frame (280 bytes). A connection
    that is opened anew needs a new framer.
    """

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> bytes:
        """Take what was read; returns what is complete, perhaps nothing."""
        data = self._rest + data
        end = codec.end_of_whole_frames(data)
        self._rest = data[end:]
        return data[:end]
