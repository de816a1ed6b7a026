"""ArduCopter's flight modes, as far as they are simulated, as one table."""

from __future__ import annotations

from dataclasses import dataclass

from sim.guidance import Descend, Hold, ReturnClimb, Task
from sim.mavlink import dialect

_ALWAYS = (
    dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    | dialect.MAV_MODE_FLAG_STABILIZE_ENABLED
    | dialect.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
)


@dataclass(frozen=True)
class FlightMode:
    """One flight mode.

    Attributes:
        number: ``custom_mode`` of HEARTBEAT.
        name: ArduCopter's name.
        can_arm: Whether arming is allowed in it.
        base_mode: ``base_mode`` of HEARTBEAT, disarmed.
        task: What the vehicle does on entering it in the air.
    """

    number: int
    name: str
    can_arm: bool
    base_mode: int
    task: Task


STABILIZE = FlightMode(0, "STABILIZE", True, _ALWAYS, Descend(landing=False))
GUIDED = FlightMode(4, "GUIDED", True, _ALWAYS | dialect.MAV_MODE_FLAG_GUIDED_ENABLED, Hold())
LOITER = FlightMode(5, "LOITER", True, _ALWAYS, Descend(landing=False))
RTL = FlightMode(6, "RTL", False, _ALWAYS | dialect.MAV_MODE_FLAG_GUIDED_ENABLED, ReturnClimb())
LAND = FlightMode(9, "LAND", False, _ALWAYS, Descend(landing=True))
BRAKE = FlightMode(17, "BRAKE", False, _ALWAYS, Hold())

MODES = {mode.number: mode for mode in (STABILIZE, GUIDED, LOITER, RTL, LAND, BRAKE)}
"""By ``custom_mode``. Without a pilot's radio the stick modes sink to the ground."""
