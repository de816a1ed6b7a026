"""The simulated autopilots, ArduCopter and PX4, behind MAVLink.

Both alike
    ``autopilot`` (bytes in, bytes out), ``command_handler``, ``flight`` (step by step),
    ``flight_tasks``, ``takeoff_and_landing``, ``flight_modes``, ``mission_flight``, ``geofence``.
State
    ``onboard_state``, ``battery``, ``boot_sequence``, ``traits`` (what differs and never changes).
MAVLink
    ``telemetry``, ``message_intervals``, ``parameters``, ``setpoints``, ``mission_protocol``,
    ``mission_items``.
ArduCopter
    ``ardupilot`` and ``ardupilot_{failsafes,fence,modes,parameters,setpoints}``.
PX4
    ``px4`` and ``px4_{failsafes,modes,parameters,setpoints}``.
"""

from __future__ import annotations

from sim.autopilots.ardupilot import ArduPilot
from sim.autopilots.autopilot import Autopilot
from sim.autopilots.px4 import Px4

__all__ = ["AUTOPILOTS", "Autopilot"]

AUTOPILOTS: dict[str, type[ArduPilot] | type[Px4]] = {"ardupilot": ArduPilot, "px4": Px4}
"""The autopilots by :attr:`sim.config.VehicleConfig.autopilot`."""
