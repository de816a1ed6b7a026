"""The flight modes of the simulated PX4."""

from __future__ import annotations

from collections.abc import Callable

from sim.autopilots.flight_modes import FlightMode, hold, sinking
from sim.autopilots.flight_tasks import Task
from sim.autopilots.parameters import Parameters
from sim.autopilots.takeoff_and_landing import Descend, ReturnClimb
from sim.mavlink import dialect

SINK_MPS = 0.7
"""Descent of the stick modes without a pilot, m/s."""

_ALWAYS = (
    dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    | dialect.MAV_MODE_FLAG_STABILIZE_ENABLED
    | dialect.MAV_MODE_FLAG_GUIDED_ENABLED
)
AUTO = _ALWAYS | dialect.MAV_MODE_FLAG_AUTO_ENABLED
"""``base_mode`` of the AUTO modes."""
_STICKS = (
    dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    | dialect.MAV_MODE_FLAG_STABILIZE_ENABLED
    | dialect.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
)


def landing(parameters: Parameters) -> Descend:
    """How it lands."""
    return Descend(
        True,
        parameters["MPC_Z_V_AUTO_DN"],
        parameters["MPC_LAND_SPEED"],
        parameters["MPC_LAND_ALT1"],
    )


def homing(parameters: Parameters) -> ReturnClimb:
    """How it returns."""
    return ReturnClimb(parameters["RTL_RETURN_ALT"], landing(parameters))


def _mode(
    name: str,
    main: int,
    sub: int,
    task: Callable[[Parameters], Task],
    *,
    can_arm: bool = True,
    base_mode: int = AUTO,
) -> FlightMode:
    return FlightMode(main << 16 | sub << 24, name, can_arm, base_mode, task)


ALTCTL = _mode("ALTCTL", 2, 0, sinking(SINK_MPS), base_mode=_STICKS)
POSCTL = _mode("POSCTL", 3, 0, sinking(SINK_MPS), base_mode=_STICKS)
TAKEOFF = _mode("AUTO_TAKEOFF", 4, 2, hold)
LOITER = _mode("AUTO_LOITER", 4, 3, hold)
MISSION = _mode("AUTO_MISSION", 4, 4, hold)
RTL = _mode("AUTO_RTL", 4, 5, homing, can_arm=False)
LAND = _mode("AUTO_LAND", 4, 6, landing, can_arm=False)
OFFBOARD = _mode("OFFBOARD", 6, 0, hold, base_mode=_ALWAYS)

MODES = {
    mode.number: mode for mode in (ALTCTL, POSCTL, TAKEOFF, LOITER, MISSION, RTL, LAND, OFFBOARD)
}
"""The modes by ``custom_mode``: main mode in the third byte, sub-mode in the fourth."""
