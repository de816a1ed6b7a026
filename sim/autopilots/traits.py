"""What distinguishes one autopilot from another and does not change in flight."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from sim.autopilots.flight_modes import FlightMode
from sim.mavlink import dialect


@dataclass(frozen=True)
class Timeline:
    """Times from power-up, s.

    Attributes:
        heartbeat_s: First HEARTBEAT.
        gps_fix_s: GPS fix, and with it UTC.
        home_set_s: Position, origin and home.
        armable_s: Arming checks pass.
    """

    heartbeat_s: float
    gps_fix_s: float
    home_set_s: float
    armable_s: float


CAPABILITIES: int = (
    dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    | dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
)
"""What every simulated autopilot can do, as AUTOPILOT_VERSION says it."""

SHORT = Timeline(heartbeat_s=0.0, gps_fix_s=1.0, home_set_s=2.0, armable_s=4.0)
"""For who does not want to wait."""


@dataclass(frozen=True)
class Manners:
    """One kind of autopilot.

    Attributes:
        autopilot: MAV_AUTOPILOT.
        flight_sw_version: Of AUTOPILOT_VERSION.
        capabilities: MAV_PROTOCOL_CAPABILITY flags of AUTOPILOT_VERSION.
        uid_base: Added to the system id it makes the hardware uid.
        boot: What happens when after power-up.
        first_mode: The mode it boots in.
        always_healthy: SYS_STATUS health bits set even for what is not there.
        streams: Interval of each message sent unasked, s.
        refused: MAV_RESULT of arming, disarming or rebooting when that cannot be.
        unknown_message: MAV_RESULT of REQUEST_MESSAGE for a message it does not have.
        unknown_interval: MAV_RESULT of SET_MESSAGE_INTERVAL for such a message.
        parameters_per_s: Pace of a parameter list.
    """

    autopilot: int
    flight_sw_version: int
    capabilities: int
    uid_base: int
    boot: Timeline
    first_mode: FlightMode
    always_healthy: int
    streams: Mapping[int, float]
    refused: int
    unknown_message: int
    unknown_interval: int
    parameters_per_s: float
