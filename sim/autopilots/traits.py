"""The constant traits in which simulated autopilots differ: ids, answers, rates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from sim.autopilots.boot_sequence import BootSequence
from sim.autopilots.flight_modes import FlightMode
from sim.mavlink import dialect

CAPABILITIES: int = (
    dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    | dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
)
"""Capabilities that every simulated autopilot states in AUTOPILOT_VERSION."""


@dataclass(frozen=True)
class Traits:
    """Traits of one kind of autopilot.

    Attributes:
        autopilot: MAV_AUTOPILOT.
        flight_sw_version: Version stated in AUTOPILOT_VERSION.
        capabilities: MAV_PROTOCOL_CAPABILITY flags of AUTOPILOT_VERSION.
        uid_base: Added to the system id it makes the hardware uid.
        boot: Its boot sequence.
        first_mode: The mode it boots in.
        always_healthy: SYS_STATUS health bits that it sets even for sensors it does not have.
        unasked_s: Interval of each message that it sends unasked, s, by message id.
        refused: MAV_RESULT of arming, disarming or rebooting when it refuses.
        unknown_message: MAV_RESULT of REQUEST_MESSAGE for a message it does not have.
        unknown_interval: MAV_RESULT of SET_MESSAGE_INTERVAL for such a message.
        parameters_per_s: Parameters sent per second when all are asked for, 1/s.
    """

    autopilot: int
    flight_sw_version: int
    capabilities: int
    uid_base: int
    boot: BootSequence
    first_mode: FlightMode
    always_healthy: int
    unasked_s: Mapping[int, float]
    refused: int
    unknown_message: int
    unknown_interval: int
    parameters_per_s: float
