"""Commands to frames: units and frames of what is sent are converted here, once.

rad, m, m/s and ENU become 1e7-degrees and NED. pymavlink's own ``pack`` writes the frames, as
MAVLink 2, or as MAVLink 1 where nothing else was heard.
"""

from __future__ import annotations

import math
import struct
from typing import Any, assert_never

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.commands import GoTo, UploadFence
from swarmctl.link.address import Address
from swarmctl.link.codec.messages import (
    AUTOPILOT_COMPONENT,
    AskForItem,
    AskForPlan,
    CommandLong,
    DataStream,
    EndPlan,
    Frame,
    PlanPacket,
    SendItem,
    StartPlan,
)
from swarmctl.link.signing import Signing

OUR_COMPONENT = 190
"""MAV_COMP_ID_MISSIONPLANNER: the component id of ground stations."""

_E7_PER_RAD = 1.0 / math.radians(1e-7)
_FENCE = mavlink.MAV_MISSION_TYPE_FENCE
_SET_POSITION_AND_VELOCITY = (
    mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
)


class Encoder:
    """Writes our frames to one address, with consecutive sequence numbers.

    Args:
        sysid: Our system id.
        signing: Signs every frame; None for unsigned frames.
        link_id: Number of the address, 0..255, in the signatures.

    Attributes:
        mavlink_1: Whether MAVLink 1 is written, because nothing else was heard at that address.
            Signed frames are always MAVLink 2.
    """

    def __init__(self, sysid: int, signing: Signing | None = None, link_id: int = 0) -> None:
        self._mav = mavlink.MAVLink(None, srcSystem=sysid, srcComponent=OUR_COMPONENT)
        self._signing = signing
        self._has_heard = False
        self.mavlink_1 = False
        if signing is not None:
            self._mav.signing.secret_key = signing.key
            self._mav.signing.link_id = link_id
            self._mav.signing.sign_outgoing = True

    def hear(self, frame: Frame) -> None:
        """Take note of the MAVLink version that an autopilot at the address speaks."""
        is_1 = frame.raw[0] == mavlink.PROTOCOL_MARKER_V1
        self.mavlink_1 = is_1 and (self.mavlink_1 or not self._has_heard)
        self._has_heard = True

    def heartbeat(self) -> bytes:
        """HEARTBEAT of a ground station."""
        return self._pack(
            mavlink.MAVLink_heartbeat_message(
                type=mavlink.MAV_TYPE_GCS,
                autopilot=mavlink.MAV_AUTOPILOT_INVALID,
                base_mode=0,
                custom_mode=0,
                system_status=mavlink.MAV_STATE_ACTIVE,
                mavlink_version=3,
            )
        )

    def timesync(self, asked_ns: int) -> bytes:
        """TIMESYNC that asks every vehicle at the address for its time since boot."""
        return self._pack(mavlink.MAVLink_timesync_message(0, asked_ns))

    def command_long(self, target: int, command: CommandLong, confirmation: int) -> bytes:
        """COMMAND_LONG to the autopilot of system ``target``; confirmation counts repeats."""
        params = command.params + (0.0,) * (7 - len(command.params))
        return self._pack(
            mavlink.MAVLink_command_long_message(
                target, AUTOPILOT_COMPONENT, command.command, confirmation, *params
            )
        )

    def request_data_stream(self, target: int, wanted: DataStream) -> bytes:
        """REQUEST_DATA_STREAM of the autopilot of system ``target``."""
        return self._pack(
            mavlink.MAVLink_request_data_stream_message(
                target, AUTOPILOT_COMPONENT, wanted.stream, wanted.rate_hz, 1
            )
        )

    def param_request_read(self, target: int, name: str) -> bytes:
        """PARAM_REQUEST_READ of a parameter by its name."""
        return self._pack(
            mavlink.MAVLink_param_request_read_message(
                target, AUTOPILOT_COMPONENT, name.encode("ascii"), -1
            )
        )

    def param_set(self, target: int, name: str, raw: bytes, kind: int) -> bytes:
        """PARAM_SET of a parameter; ``raw`` holds the value's four bytes."""
        (carrier,) = struct.unpack("<f", raw)
        return self._pack(
            mavlink.MAVLink_param_set_message(
                target, AUTOPILOT_COMPONENT, name.encode("ascii"), carrier, kind
            )
        )

    def plan(self, target: int, packet: PlanPacket) -> bytes:
        """A message of the upload of a fence, or of its reading back."""
        to = (target, AUTOPILOT_COMPONENT)
        message: object
        match packet:
            case StartPlan():
                message = mavlink.MAVLink_mission_count_message(*to, 1, _FENCE)
            case SendItem(fence=fence):
                message = _fence_item(fence)
            case AskForPlan():
                message = mavlink.MAVLink_mission_request_list_message(*to, _FENCE)
            case AskForItem():
                message = mavlink.MAVLink_mission_request_int_message(*to, 0, _FENCE)
            case EndPlan():
                accepted = mavlink.MAV_MISSION_ACCEPTED
                message = mavlink.MAVLink_mission_ack_message(*to, accepted, _FENCE)
            case _:
                assert_never(packet)
        return self._pack(message)

    def setpoint(self, goto: GoTo, now: float) -> bytes | None:
        """SET_POSITION_TARGET_GLOBAL_INT: altitude AMSL, position and velocity used.

        The frame is MAV_FRAME_GLOBAL_INT (5), the only one with altitudes AMSL that every
        autopilot takes: PX4 refuses MAV_FRAME_GLOBAL (0) and _RELATIVE_ALT (3).

        Returns:
            The frame; None if a field is not finite or does not fit into its wire field: such a
            setpoint must never leave.
        """
        velocity_east, velocity_north, velocity_up = goto.velocity_enu
        if not math.isfinite(goto.alt_amsl_m + velocity_east + velocity_north + velocity_up):
            return None
        try:
            return self._pack(
                mavlink.MAVLink_set_position_target_global_int_message(
                    int(now * 1000.0) & 0xFFFFFFFF,
                    goto.sysid,
                    AUTOPILOT_COMPONENT,
                    mavlink.MAV_FRAME_GLOBAL_INT,
                    _SET_POSITION_AND_VELOCITY,
                    round(goto.lat_rad * _E7_PER_RAD),
                    round(goto.lon_rad * _E7_PER_RAD),
                    goto.alt_amsl_m,
                    velocity_north,
                    velocity_east,
                    -velocity_up,
                    *(0.0, 0.0, 0.0, 0.0, 0.0),
                )
            )
        except (ValueError, OverflowError, struct.error):
            return None

    def _pack(self, message: Any) -> bytes:  # noqa: ANN401 - untyped package
        if self._signing is not None:
            self._mav.signing.timestamp = self._signing.next_timestamp()
            frame: bytes = message.pack(self._mav)
        else:
            frame = message.pack(self._mav, force_mavlink1=self.mavlink_1)
        self._mav.seq = (self._mav.seq + 1) & 0xFF
        return frame


class Encoders:
    """One encoder for each address, because sequence numbers count per channel.

    Args:
        sysid: Our own system id.
        signing: Signs what is sent; None without a key.
    """

    def __init__(self, sysid: int, signing: Signing | None) -> None:
        self._sysid = sysid
        self._signing = signing
        self._encoders: dict[Address, Encoder] = {}

    def to(self, address: Address) -> Encoder:
        """The encoder of our frames to an address."""
        if address not in self._encoders:
            link_id = len(self._encoders) & 0xFF
            self._encoders[address] = Encoder(self._sysid, self._signing, link_id)
        return self._encoders[address]


def _fence_item(fence: UploadFence) -> object:
    return mavlink.MAVLink_mission_item_int_message(
        fence.sysid,
        AUTOPILOT_COMPONENT,
        seq=0,
        frame=mavlink.MAV_FRAME_GLOBAL,
        command=mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
        current=0,
        autocontinue=1,
        param1=fence.radius_m,
        param2=0.0,
        param3=0.0,
        param4=0.0,
        x=round(fence.lat_rad * _E7_PER_RAD),
        y=round(fence.lon_rad * _E7_PER_RAD),
        z=0.0,
        mission_type=_FENCE,
    )
