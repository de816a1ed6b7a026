"""The flight modes of the simulated ArduCopter."""

from __future__ import annotations

import math

from sim.autopilots.flight_modes import FlightMode, hold, sinking
from sim.autopilots.parameters import Parameters
from sim.autopilots.takeoff_and_landing import Descend, ReturnClimb
from sim.mavlink import dialect

SINK_MPS = 2.5
"""Descent of the stick modes without a pilot, m/s."""

_ALWAYS = (
    dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    | dialect.MAV_MODE_FLAG_STABILIZE_ENABLED
    | dialect.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
)
_BY_ITSELF = _ALWAYS | dialect.MAV_MODE_FLAG_GUIDED_ENABLED


def landing(parameters: Parameters) -> Descend:
    """How it lands."""
    fast = parameters["LAND_SPEED_HIGH"] or parameters["WPNAV_SPEED_DN"]
    slow, below = parameters["LAND_SPEED"], parameters["LAND_ALT_LOW"]
    return Descend(True, 0.01 * fast, 0.01 * slow, 0.01 * below)


def homing(parameters: Parameters) -> ReturnClimb:
    """How it returns: below the ceiling of the fence, if there is one."""
    fenced = parameters["FENCE_ENABLE"] == 1.0 and int(parameters["FENCE_TYPE"]) & 1
    highest_m = parameters["FENCE_ALT_MAX"] - parameters["FENCE_MARGIN"] if fenced else math.inf
    return ReturnClimb(0.01 * parameters["RTL_ALT"], landing(parameters), highest_m)


STABILIZE = FlightMode(0, "STABILIZE", True, _ALWAYS, sinking(SINK_MPS))
ALT_HOLD = FlightMode(2, "ALT_HOLD", True, _ALWAYS, sinking(SINK_MPS))
AUTO = FlightMode(3, "AUTO", False, _BY_ITSELF, hold)
GUIDED = FlightMode(4, "GUIDED", True, _BY_ITSELF, hold)
LOITER = FlightMode(5, "LOITER", True, _ALWAYS, sinking(SINK_MPS))
RTL = FlightMode(6, "RTL", False, _BY_ITSELF, homing)
LAND = FlightMode(9, "LAND", False, _ALWAYS, landing)
POSHOLD = FlightMode(16, "POSHOLD", True, _ALWAYS, sinking(SINK_MPS))
BRAKE = FlightMode(17, "BRAKE", False, _ALWAYS, hold)

MODES = {
    mode.number: mode
    for mode in (STABILIZE, ALT_HOLD, AUTO, GUIDED, LOITER, RTL, LAND, POSHOLD, BRAKE)
}
"""The modes by ``custom_mode``."""
