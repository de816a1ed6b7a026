"""The MAVLink parameter protocol for one vehicle, through a lossy link.

The protocol is https://mavlink.io/en/services/parameter.html. A vehicle does not answer a question
for an unknown name, so every name that a parameter has had is asked for at once; the name that is
answered is the vehicle's. A write counts when the vehicle has told the new value.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

import msgspec

from swarmctl.events import ParameterValue
from swarmctl.link.codec.messages import ParameterMessage, Spelling

ANSWER_TIMEOUT_S = 1.0
"""Wait for a PARAM_VALUE before the next try, s."""
TRIES = 4
"""Tries before a parameter counts as unknown to the vehicle, or a write as refused."""
TOLERANCE = 1e-6
"""Greatest relative difference between a value and its copy in a 32-bit float."""

_MAX_PARAMETER_NAME = 16
_INTEGERS = {
    1: struct.Struct("<Bxxx"),
    2: struct.Struct("<bxxx"),
    3: struct.Struct("<Hxx"),
    4: struct.Struct("<hxx"),
    5: struct.Struct("<I"),
    6: struct.Struct("<i"),
}
"""Layout of each MAV_PARAM_TYPE that is an integer."""
_FLOAT = struct.Struct("<f")


def is_parameter_name(name: str) -> bool:
    """Whether this is a possible name of a parameter."""
    return name.isascii() and 0 < len(name) <= _MAX_PARAMETER_NAME


def parameter_value(message: ParameterMessage, *, bytewise: bool) -> float:
    """The value of a PARAM_VALUE.

    Args:
        message: The message.
        bytewise: Whether integers travel as their bytes
            (https://mavlink.io/en/services/parameter.html#parameter-encoding).
    """
    layout = _INTEGERS.get(message.kind, _FLOAT) if bytewise else _FLOAT
    (value,) = layout.unpack(message.raw)
    return float(value)


def parameter_bytes(value: float, kind: int, *, bytewise: bool) -> bytes | None:
    """The four bytes in which a value is set; None if they cannot hold it.

    Args:
        value: The value.
        kind: MAV_PARAM_TYPE, as the vehicle told it.
        bytewise: As for :func:`parameter_value`.
    """
    layout = _INTEGERS.get(kind) if bytewise else None
    try:
        if layout is None:
            return _FLOAT.pack(value)
        return layout.pack(int(value)) if value == int(value) else None
    except (struct.error, ValueError, OverflowError):
        return None


class ReadPacket(msgspec.Struct, frozen=True):
    """A PARAM_REQUEST_READ to send."""

    name: str


class SetPacket(msgspec.Struct, frozen=True):
    """A PARAM_SET to send: the parameter's name, the value's four bytes, MAV_PARAM_TYPE."""

    name: str
    raw: bytes
    kind: int


class _Job:
    """One parameter to read, or to read and then write."""

    def __init__(
        self, parameter: str, spellings: Sequence[Spelling], wanted: float | None, now: float
    ) -> None:
        self.parameter = parameter
        self.spellings = tuple(spellings)
        self.wanted = wanted
        self.set_packet: SetPacket | None = None
        self.heard: ParameterValue | None = None
        self.tries = 0
        self.due_s = now

    def is_write_of(self, parameter: str) -> bool:
        """Whether it writes this parameter."""
        return self.parameter == parameter and self.wanted is not None


class ParameterExchange:
    """Reads and writes the parameters of one vehicle, several at a time.

    The caller hands in what the vehicle says and the time, calls :meth:`handle_timer` when
    :meth:`next_timer` is due, and after any call sends :meth:`packets` and reports
    :meth:`values`. All times are monotonic seconds.

    Args:
        sysid: System id of the vehicle.
    """

    def __init__(self, sysid: int) -> None:
        self._sysid = sysid
        self._jobs: list[_Job] = []
        self._packets: list[ReadPacket | SetPacket] = []
        self._values: list[ParameterValue] = []

    def submit(
        self, parameter: str, spellings: Sequence[Spelling], wanted: float | None, now: float
    ) -> None:
        """Read a parameter, or write it.

        Args:
            parameter: Its newest name.
            spellings: Every name it has had; impossible names are not asked for.
            wanted: The value to write; None to read.
            now: Monotonic time, s.
        """
        usable = [s for s in spellings if is_parameter_name(s.name)]
        job = _Job(parameter, usable, wanted, now)
        if not usable:
            self._end(job, now)
            return
        if wanted is not None:
            # Two writes would undo each other with every try.
            for earlier in [j for j in self._jobs if j.is_write_of(parameter)]:
                self._end(earlier, now)
        self._jobs.append(job)
        self._try(job, now)

    def on_value(self, message: ParameterMessage, now: float, *, bytewise: bool) -> None:
        """Take a PARAM_VALUE, asked for or not.

        Args:
            message: The message.
            now: Monotonic time, s.
            bytewise: Whether its integers travel as their bytes.
        """
        for job in list(self._jobs):
            spelling = next((s for s in job.spellings if s.name == message.name), None)
            if spelling is None:
                continue
            own_value = parameter_value(message, bytewise=bytewise)
            job.heard = ParameterValue(
                received_s=now,
                sysid=self._sysid,
                parameter=job.parameter,
                value=own_value * spelling.unit,
                own_name=spelling.name,
                own_unit=spelling.unit,
            )
            if job.wanted is None or _same(own_value * spelling.unit, job.wanted):
                self._end(job, now)
            elif job.set_packet is None:
                # The type on the wire must be the vehicle's, and it has just told it.
                raw = parameter_bytes(job.wanted / spelling.unit, message.kind, bytewise=bytewise)
                if raw is None:
                    self._end(job, now)
                else:
                    job.set_packet = SetPacket(spelling.name, raw, message.kind)
                    job.tries = 0
                    self._try(job, now)
            # Else it may be the answer to the question before: only silence ends a write.

    def handle_timer(self, now: float) -> None:
        """Ask again or give up, where that is due."""
        for job in [job for job in self._jobs if now >= job.due_s]:
            if job.tries < TRIES:
                self._try(job, now)
            else:
                self._end(job, now)

    def next_timer(self) -> float:
        """When :meth:`handle_timer` is due; infinity for never."""
        return min((job.due_s for job in self._jobs), default=math.inf)

    def packets(self) -> list[ReadPacket | SetPacket]:
        """Drain what to send."""
        packets, self._packets = self._packets, []
        return packets

    def values(self) -> list[ParameterValue]:
        """Drain the values found."""
        values, self._values = self._values, []
        return values

    def _try(self, job: _Job, now: float) -> None:
        job.tries += 1
        job.due_s = now + ANSWER_TIMEOUT_S
        if job.set_packet is not None:
            self._packets.append(job.set_packet)
        else:
            self._packets += [ReadPacket(spelling.name) for spelling in job.spellings]

    def _end(self, job: _Job, now: float) -> None:
        if job in self._jobs:
            self._jobs.remove(job)
        self._values.append(job.heard or unread(job.parameter, self._sysid, now))


def unread(parameter: str, sysid: int, now: float) -> ParameterValue:
    """The outcome for a parameter that the vehicle has not told."""
    return ParameterValue(
        received_s=now, sysid=sysid, parameter=parameter, value=None, own_name=parameter
    )


def _same(value: float, wanted: float) -> bool:
    return math.isclose(value, wanted, rel_tol=TOLERANCE, abs_tol=TOLERANCE)
