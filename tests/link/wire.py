"""The other side of the wire, made and read with pymavlink or by hand, never with our modules."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink


class Sender:
    """A MAVLink component that packs messages with consecutive sequence numbers."""

    def __init__(self, sysid: int = 1, compid: int = 1) -> None:
        self.mav = mavlink.MAVLink(None, srcSystem=sysid, srcComponent=compid)

    def pack(self, name: str, **fields: Any) -> bytes:  # noqa: ANN401 - MAVLink fields of any type
        """A MAVLink 2 frame of the message ``name``; fields that are not given are 0."""
        return self._pack(name, fields, v1=False)

    def pack_v1(self, name: str, **fields: Any) -> bytes:  # noqa: ANN401 - MAVLink fields of any type
        """The same in MAVLink 1."""
        return self._pack(name, fields, v1=True)

    def _pack(self, name: str, fields: dict[str, Any], *, v1: bool) -> bytes:
        message = getattr(mavlink, f"MAVLink_{name.lower()}_message")
        values = {
            field: b""
            if kind == "char"
            else [0] * length
            if (length := message.array_lengths[place])
            else 0
            for field, kind, place in zip(
                message.fieldnames, message.fieldtypes, message.orders, strict=True
            )
        }
        frame: bytes = message(**(values | fields)).pack(self.mav, force_mavlink1=v1)
        self.mav.seq = (self.mav.seq + 1) % 256
        return frame

    def heartbeat(self, *, mode: int = 4, armed: bool = False, **fields: Any) -> bytes:  # noqa: ANN401 - as above
        """HEARTBEAT of an ArduCopter quadrotor."""
        return self.pack(
            "HEARTBEAT",
            **{
                "type": mavlink.MAV_TYPE_QUADROTOR,
                "autopilot": mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
                "base_mode": 1 | (128 if armed else 0),
                "custom_mode": mode,
            }
            | fields,
        )


def unpack(frame: bytes) -> Any:  # noqa: ANN401 - pymavlink is untyped
    """The message in a frame, by pymavlink."""
    return mavlink.MAVLink(None).decode(bytearray(frame))


def crc(data: bytes) -> int:
    """CRC-16/MCRF4XX bit by bit, from its definition: reflected 0x1021, start 0xFFFF."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0x8408 if value & 1 else 0)
    return value


def frame_by_hand(
    message_id: int, payload: bytes, crc_extra: int, *, seq: int = 0, sysid: int = 1
) -> bytes:
    """A MAVLink 2 frame of component 1, laid out byte by byte."""
    body = bytes(
        (
            len(payload),
            0,
            0,
            seq,
            sysid,
            1,
            message_id & 255,
            message_id >> 8 & 255,
            message_id >> 16,
        )
    )
    body += payload
    return b"\xfd" + body + crc(body + bytes((crc_extra,))).to_bytes(2, "little")
