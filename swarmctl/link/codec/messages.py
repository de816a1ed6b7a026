"""The MAVLink messages that are read and sent, in our units and frames.

``decoding`` makes them from frames and ``encoding`` makes frames from them. A message whose meaning
is all on the wire is decoded to an event of :mod:`swarmctl.events` at once.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Literal

import msgspec

from swarmctl.commands import UploadFence
from swarmctl.events import (
    GpsFix,
    HomePosition,
    LandedState,
    StatusText,
    VehicleAttitude,
    VehicleClock,
    VehicleStatus,
    VehicleVersion,
)
from swarmctl.units import Vector

AUTOPILOT_COMPONENT = 1
"""MAV_COMP_ID_AUTOPILOT1."""


class MavCmd(IntEnum):
    """The MAV_CMDs in use."""

    NAV_TAKEOFF = 22
    DO_SET_MODE = 176
    COMPONENT_ARM_DISARM = 400
    GET_HOME_POSITION = 410
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_AUTOPILOT_CAPABILITIES = 520


class MessageId(IntEnum):
    """The messages that are read."""

    HEARTBEAT = 0
    SYS_STATUS = 1
    SYSTEM_TIME = 2
    PARAM_VALUE = 22
    GPS_RAW_INT = 24
    ATTITUDE = 30
    GLOBAL_POSITION_INT = 33
    MISSION_REQUEST = 40
    MISSION_COUNT = 44
    MISSION_ACK = 47
    MISSION_REQUEST_INT = 51
    MISSION_ITEM_INT = 73
    COMMAND_ACK = 77
    TIMESYNC = 111
    AUTOPILOT_VERSION = 148
    HOME_POSITION = 242
    EXTENDED_SYS_STATE = 245
    STATUSTEXT = 253


class Frame(msgspec.Struct, frozen=True, gc=False):
    """One checked MAVLink frame.

    Attributes:
        raw: The whole frame as it was on the wire.
        sysid: System id of the sender.
        compid: Component id of the sender.
        seq: Sequence number, 0..255.
        message_id: MAVLink message id.
        payload: Payload; MAVLink 2 cuts trailing zeros.
    """

    raw: bytes
    sysid: int
    compid: int
    seq: int
    message_id: int
    payload: bytes


class Fault(msgspec.Struct, frozen=True, gc=False):
    """Why bytes could not be used.

    Attributes:
        kind: ``not_mavlink``, ``truncated``, ``bad_crc``, ``unknown_message``,
            ``unsupported_flags``, ``implausible``, ``unsigned``, ``wrongly_signed`` or
            ``replayed``.
        detail: What was wrong, without where it came from and without a full stop.
    """

    kind: str
    detail: str


class HeartbeatMessage(msgspec.Struct, frozen=True, gc=False):
    """HEARTBEAT of a flight controller; what ``custom_mode`` means depends on the autopilot.

    Attributes:
        autopilot: The flight stack.
        is_multirotor: Whether MAV_TYPE is a multirotor.
        custom_mode: The autopilot's own mode number.
        armed: Whether the motors are armed.
        failsafe: Whether it says that it flies on a failsafe (MAV_STATE_CRITICAL or worse).
    """

    autopilot: Literal["ardupilot", "px4", "other"]
    is_multirotor: bool
    custom_mode: int
    armed: bool
    failsafe: bool


class PositionMessage(msgspec.Struct, frozen=True):
    """GLOBAL_POSITION_INT, not yet mapped to UTC; fields as VehiclePosition."""

    boot_s: float
    lat_rad: float
    lon_rad: float
    alt_amsl_m: float
    velocity_enu: Vector


class CommandAck(msgspec.Struct, frozen=True, gc=False):
    """COMMAND_ACK.

    Attributes:
        command: MAV_CMD that is answered.
        result: MAV_RESULT's name without its prefix, for example ``DENIED``.
        target_system: System id of the ground station that asked; 0 if not given.
    """

    command: int
    result: str
    target_system: int


class TimeSyncAnswer(msgspec.Struct, frozen=True, gc=False):
    """TIMESYNC that answers a question.

    Attributes:
        boot_s: The vehicle's time since boot when it answered, s.
        asked_ns: The time stamp of the question, as it was sent.
    """

    boot_s: float
    asked_ns: int


class ParameterMessage(msgspec.Struct, frozen=True, gc=False):
    """PARAM_VALUE; what its bytes mean depends on the autopilot.

    Attributes:
        name: The vehicle's own name of the parameter.
        raw: The four bytes of the value.
        kind: MAV_PARAM_TYPE.
    """

    name: str
    raw: bytes
    kind: int


class FenceMessage(msgspec.Struct, frozen=True, gc=False):
    """A message of the vehicle about its geofence (mission type FENCE).

    Attributes:
        target_system: System id of the ground station that it is for; 0 for all.
    """

    target_system: int


class FenceRequest(FenceMessage, frozen=True, gc=False):
    """MISSION_REQUEST or MISSION_REQUEST_INT: the vehicle asks for an item by its number."""

    seq: int


class FenceAck(FenceMessage, frozen=True, gc=False):
    """MISSION_ACK; ``result`` is MAV_MISSION_RESULT's name without its prefix."""

    result: str


class FenceCount(FenceMessage, frozen=True, gc=False):
    """MISSION_COUNT: how many items its fence has."""

    count: int


class FenceItem(FenceMessage, frozen=True, gc=False):
    """MISSION_ITEM_INT.

    Attributes:
        seq: Its number.
        command: MAV_CMD.
        is_circle_inclusion: Whether the item is a circle to stay in.
        radius_m: Radius of a circle, m.
        lat_rad: Latitude of its centre, rad.
        lon_rad: Longitude of its centre, rad.
    """

    seq: int
    command: int
    is_circle_inclusion: bool
    radius_m: float
    lat_rad: float
    lon_rad: float


Message = (
    HeartbeatMessage
    | PositionMessage
    | CommandAck
    | ParameterMessage
    | FenceMessage
    | GpsFix
    | HomePosition
    | LandedState
    | StatusText
    | TimeSyncAnswer
    | VehicleAttitude
    | VehicleClock
    | VehicleStatus
    | VehicleVersion
)
"""What a frame says; an event if its meaning is all on the wire."""


class CommandLong(msgspec.Struct, frozen=True):
    """COMMAND_LONG to an autopilot.

    Attributes:
        command: MAV_CMD.
        params: The first of the seven parameters; the others are 0.
    """

    command: MavCmd
    params: tuple[float, ...]


class DataStream(msgspec.Struct, frozen=True):
    """REQUEST_DATA_STREAM, the older form of SET_MESSAGE_INTERVAL; it is not acknowledged.

    Attributes:
        stream: MAV_DATA_STREAM.
        rate_hz: Messages a second of each kind in the stream.
    """

    stream: int
    rate_hz: int


class Spelling(msgspec.Struct, frozen=True):
    """How one version of a flight stack writes a parameter.

    Attributes:
        name: Its name there.
        unit: One unit of it there, in units of the parameter's newest name.
    """

    name: str
    unit: float = 1.0


class StartPlan(msgspec.Struct, frozen=True):
    """MISSION_COUNT of a fence of one item."""


class SendItem(msgspec.Struct, frozen=True):
    """MISSION_ITEM_INT of a fence's only item."""

    fence: UploadFence


class AskForPlan(msgspec.Struct, frozen=True):
    """MISSION_REQUEST_LIST of the fence."""


class AskForItem(msgspec.Struct, frozen=True):
    """MISSION_REQUEST_INT of the fence's first item."""


class EndPlan(msgspec.Struct, frozen=True):
    """MISSION_ACK: the fence has been read."""


PlanPacket = StartPlan | SendItem | AskForPlan | AskForItem | EndPlan
"""What is sent to upload a fence and to read it back."""
