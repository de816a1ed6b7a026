"""The simulated autopilots: how all fly (``flight``), what all understand, and each personality."""

from __future__ import annotations

from sim.autopilots.ardupilot import ArduPilot
from sim.autopilots.autopilot import Autopilot
from sim.autopilots.px4 import Px4

__all__ = ["AUTOPILOTS", "Autopilot"]

AUTOPILOTS: dict[str, type[ArduPilot] | type[Px4]] = {"ardupilot": ArduPilot, "px4": Px4}
"""By :attr:`sim.config.VehicleConfig.autopilot`."""
