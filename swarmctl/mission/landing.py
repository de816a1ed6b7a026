"""Getting every vehicle back on the ground: land mode until it has disarmed, lowest first."""

from __future__ import annotations

from swarmctl.commands import Command, SetMode
from swarmctl.events import Mode
from swarmctl.mission.fleet import VehicleState
from swarmctl.mission.loss_detection import LossDetection

STAGGER_S = 2.0
"""One vehicle starts to land this long after the one before."""
RETRY_S = 4.0
"""A landing that is refused or not answered is asked for again after this long."""
LANDING_TIMEOUT_S = 300.0
"""A vehicle that has not disarmed this long after the landing began is given up."""


class Landing:
    """Land mode until disarmed, lowest vehicle first, staggered in time.

    Args:
        vehicles: The vehicles to land.
        losses: Tells which of them are lost.
        now: Controller's time, s.
    """

    def __init__(self, vehicles: list[VehicleState], losses: LossDetection, now: float) -> None:
        self._losses = losses
        ordered = sorted(vehicles, key=lambda v: v.altitude_amsl_m)
        self._vehicles = ordered
        self._since = now
        self._ask_at = {v.sysid: now + i * STAGGER_S for i, v in enumerate(ordered)}
        self._given_up: set[int] = set()

    @property
    def given_up(self) -> tuple[int, ...]:
        """System ids of the vehicles that were not seen to land."""
        return tuple(sorted(self._given_up))

    def step(self, now: float) -> list[Command]:
        """Advance with time; returns the commands that are due."""
        commands: list[Command] = []
        for vehicle in self._vehicles:
            if not vehicle.is_armed or vehicle.sysid in self._given_up:
                continue
            if self._losses.is_lost(vehicle, now) or now - self._since > LANDING_TIMEOUT_S:
                self._given_up.add(vehicle.sysid)
                continue
            landing = vehicle.heartbeat is not None and vehicle.heartbeat.mode in {
                Mode.LAND,
                Mode.RETURN,
            }
            if not landing and now >= self._ask_at[vehicle.sysid]:
                self._ask_at[vehicle.sysid] = now + RETRY_S
                commands.append(SetMode(sysid=vehicle.sysid, mode=Mode.LAND))
        return commands

    @property
    def complete(self) -> bool:
        """Whether every vehicle has disarmed or was given up."""
        return all(not v.is_armed or v.sysid in self._given_up for v in self._vehicles)
