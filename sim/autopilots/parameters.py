"""The parameters of a simulated autopilot and the MAVLink parameter protocol."""

from __future__ import annotations

import math
import struct
from collections import deque
from collections.abc import Callable, Mapping
from typing import NamedTuple

from sim.mavlink import Message, dialect

INT8: int = dialect.MAV_PARAM_TYPE_INT8
INT16: int = dialect.MAV_PARAM_TYPE_INT16
INT32: int = dialect.MAV_PARAM_TYPE_INT32
REAL32: int = dialect.MAV_PARAM_TYPE_REAL32

_BITS = {INT8: 8, INT16: 16, INT32: 32}
_LETTERS = {"b": INT8, "h": INT16, "i": INT32, "f": REAL32}


class Parameter(NamedTuple):
    """One parameter: its MAV_PARAM_TYPE and its value."""

    type: int
    value: float


def table(text: str) -> dict[str, Parameter]:
    """Parameters from ``NAME type value``, one per line or separated by semicolons.

    Args:
        text: The types are ``b``, ``h``, ``i`` for integers of 8, 16 and 32 bits, ``f`` for
            floats.
    """
    entries = (entry.split() for line in text.splitlines() for entry in line.split(";"))
    return {
        name: Parameter(_LETTERS[letter], float(value))
        for name, letter, value in (entry for entry in entries if entry)
    }


class Parameters:
    """The parameters of one vehicle.

    Args:
        defaults: Name, type and value of each.
        bytewise: Whether integers are copied byte by byte into the message's float (PX4) or
            converted to it (ArduPilot).
        renamed: For each parameter that the simulator knows by another name and in another
            unit, its present name and the factor to the present unit.

    Attributes:
        names: All names, in the order of their index.
        changes: Counts the changes of values.
    """

    __slots__ = ("_bytewise", "_index", "_renamed", "_types", "_values", "changes", "names")

    def __init__(
        self,
        defaults: Mapping[str, Parameter],
        *,
        bytewise: bool,
        renamed: Mapping[str, tuple[str, float]] | None = None,
    ) -> None:
        self.names = tuple(sorted(defaults))
        self._index = {name: i for i, name in enumerate(self.names)}
        self._types = {name: parameter.type for name, parameter in defaults.items()}
        self._values = {name: parameter.value for name, parameter in defaults.items()}
        self._bytewise = bytewise
        self._renamed = renamed or {}
        self.changes = 0

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __getitem__(self, name: str) -> float:
        present, factor = self._renamed.get(name, (name, 1.0))
        return self._values[present] / factor

    def assign(self, name: str, value: float) -> None:
        """Give a parameter a value; an integer parameter rounds and bounds it."""
        kind = self._types[name]
        if kind != REAL32:
            bound = 2 ** (_BITS[kind] - 1)
            value = float(max(-bound, min(bound - 1, round(value))))
        self._values[name] = value
        self.changes += 1

    def take(self, message: Message) -> bool:
        """Take a PARAM_SET; returns whether its name, type and value are usable."""
        name = message.param_id
        if name not in self._values:
            return False
        value = message.param_value
        if self._bytewise:
            if message.param_type != self._types[name]:
                return False
            if message.param_type == INT32:
                value = float(struct.unpack("<i", struct.pack("<f", value))[0])
        if not math.isfinite(value):
            return False
        self.assign(name, value)
        return True

    def message(self, name: str) -> Message:
        """PARAM_VALUE of a parameter."""
        value, kind = self._values[name], self._types[name]
        if self._bytewise and kind == INT32:
            value = struct.unpack("<f", struct.pack("<i", int(value)))[0]
        return dialect.MAVLink_param_value_message(
            name.encode(), value, kind, len(self.names), self._index[name]
        )


class ParameterServer:
    """The parameter protocol of one vehicle; it does not answer for an unknown name.

    Args:
        parameters: Its parameters.
        rate_hz: Parameters sent per second when all are asked for.
        send: Sends a message.
    """

    __slots__ = ("_allowance", "_due", "_parameters", "_rate_hz", "_send")

    def __init__(
        self, parameters: Parameters, rate_hz: float, send: Callable[[Message], None]
    ) -> None:
        self._parameters = parameters
        self._rate_hz = rate_hz
        self._send = send
        self._due: deque[str] = deque()
        self._allowance = 0.0

    def on_request_list(self, _message: Message, _now_s: float) -> None:
        """Begin to send all parameters (PARAM_REQUEST_LIST)."""
        self._due = deque(self._parameters.names)

    def on_request_read(self, message: Message, _now_s: float) -> None:
        """Send one parameter (PARAM_REQUEST_READ), by index or else by name."""
        names, index = self._parameters.names, message.param_index
        if 0 <= index < len(names):
            self._send(self._parameters.message(names[index]))
        elif index < 0 and message.param_id in self._parameters:
            self._send(self._parameters.message(message.param_id))

    def on_set(self, message: Message, _now_s: float) -> None:
        """Take a PARAM_SET and send the value in force, changed or not."""
        if message.param_id in self._parameters:
            self._parameters.take(message)
            self._send(self._parameters.message(message.param_id))

    def advance(self, step_s: float) -> None:
        """Send the parameters that are due after a time step (s)."""
        if not self._due:
            return
        self._allowance += step_s * self._rate_hz
        while self._due and self._allowance >= 1.0:
            self._allowance -= 1.0
            self._send(self._parameters.message(self._due.popleft()))

    def abort(self) -> None:
        """Stop sending all parameters."""
        self._due.clear()
