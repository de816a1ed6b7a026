"""The simulated world: vehicles, emitter and receivers on one virtual clock."""

from __future__ import annotations

import math
from collections import deque

from sim.config import SimConfig
from sim.dynamics import State
from sim.emitter import EmitterState
from sim.feed_publisher import FeedPublisher, Publication
from sim.vehicle import Vehicle
from swarmctl.errors import SimulationError
from swarmctl.frames import LocalFrame
from swarmctl.units import Vector

STEP_HZ = 50
"""Steps per second of everything: physics, autopilots, epochs."""
STEP_S = 1.0 / STEP_HZ
TRUTH_STEPS = STEP_HZ // 2
"""The true position of the emitter is published every this many steps: twice a second."""
RECEIVERS_TRUTH_STEPS = STEP_HZ
"""The true errors of the receivers are published every this many steps: once a second."""

_EARLY_STEPS = 1e-6


class World:
    """A whole simulation, without I/O and deterministic.

    Give it datagrams, advance its clock, and take what the vehicles and the receivers sent. Time
    moves in steps of ``STEP_S`` on a fixed grid. The same configuration and the same datagrams at
    the same times give the same bytes, however :meth:`advance` is divided.

    Args:
        config: The simulation.

    Attributes:
        frame: Frame of all ENU positions: tangent at the first vehicle's launch point.

    Raises:
        SimulationError: The configuration contradicts itself.
    """

    def __init__(self, config: SimConfig) -> None:
        _check(config)
        first = config.vehicles[0]
        self.frame = LocalFrame(first.launch_lat_rad, first.launch_lon_rad, first.launch_alt_amsl_m)
        self._config = config
        self._vehicles = {v.sysid: Vehicle(v, config, self.frame, STEP_S) for v in config.vehicles}
        self._feed = FeedPublisher(config, self.frame, STEP_S)
        self._steps_per_epoch = STEP_HZ / config.receivers.rate_hz
        self._epochs = 0
        self._delay_steps = math.ceil(config.receivers.delay_s * STEP_HZ - _EARLY_STEPS)
        self._steps = 0
        self._time_s = 0.0
        self._delayed: deque[tuple[int, list[Publication]]] = deque()
        self._datagrams: list[tuple[int, bytes]] = []
        self._publications: list[Publication] = []

    # --- Time --------------------------------------------------------------------------

    @property
    def time_s(self) -> float:
        """Simulation time reached, s."""
        return self._time_s

    @property
    def utc_s(self) -> float:
        """UTC of ``time_s``, s."""
        return self._config.utc_start_s + self._time_s

    def advance(self, until_s: float) -> None:
        """Simulate up to a simulation time (s); a time in the past does nothing."""
        while (self._steps + 1) * STEP_S <= until_s + _EARLY_STEPS * STEP_S:
            self._step()
        self._time_s = max(self._time_s, until_s)

    def _step(self) -> None:
        self._steps += 1
        now_s = self._steps * STEP_S
        self._feed.emitter.advance()
        for vehicle in self._vehicles.values():
            vehicle.advance(now_s)
            self._collect(vehicle, now_s)
        self._publish(now_s)

    # --- Bytes -------------------------------------------------------------------------

    def receive_datagram(self, sysid: int, data: bytes) -> None:
        """Deliver a datagram to a vehicle now.

        Args:
            sysid: System id of the vehicle that receives it; the datagram may name another.
            data: Any bytes.
        """
        vehicle = self._vehicles[sysid]
        if vehicle.config.faults.is_on_air(self._time_s):
            vehicle.autopilot.receive(data, self._time_s)
            self._collect(vehicle, self._time_s)

    def datagrams(self) -> list[tuple[int, bytes]]:
        """Datagrams that the vehicles sent since the last call, with system ids, in order."""
        datagrams, self._datagrams = self._datagrams, []
        return datagrams

    def publications(self) -> list[Publication]:
        """MQTT messages since the last call, in order."""
        publications, self._publications = self._publications, []
        return publications

    def _collect(self, vehicle: Vehicle, now_s: float) -> None:
        datagrams = vehicle.autopilot.datagrams()
        if datagrams and vehicle.config.faults.is_on_air(now_s):
            sysid = vehicle.config.sysid
            self._datagrams.extend((sysid, datagram) for datagram in datagrams)

    def _publish(self, now_s: float) -> None:
        # An epoch is at the first step at or after its due time, where positions are exact.
        if self._steps + _EARLY_STEPS >= (self._epochs + 1) * self._steps_per_epoch:
            self._epochs += 1
            self._delayed.append((self._steps + self._delay_steps, self._measure(now_s)))
        while self._delayed and self._delayed[0][0] <= self._steps:
            self._publications += self._delayed.popleft()[1]
        if self._steps % TRUTH_STEPS == 0:
            self._publications.append(self._feed.truth(self._config.utc_start_s + now_s))
        if self._steps % RECEIVERS_TRUTH_STEPS == 0:
            self._publications += self._feed.receivers_truth(
                {sysid: v.navigation_error_enu for sysid, v in self._vehicles.items()},
                self._config.utc_start_s + now_s,
            )

    def _measure(self, now_s: float) -> list[Publication]:
        """What the receivers publish of one burst."""
        floor_m = self._config.receivers.minimum_altitude_m
        hearing = {
            sysid: vehicle.state.position_enu
            for sysid, vehicle in self._vehicles.items()
            if vehicle.config.faults.is_on_air(now_s)
            and vehicle.state.position_enu[2] - vehicle.ground_up_m() > floor_m
        }
        return self._feed.burst(hearing, self._config.utc_start_s + now_s)

    # --- Truth -------------------------------------------------------------------------

    def vehicle_state(self, sysid: int) -> State:
        """True state of a vehicle, as of the last whole step."""
        return self._vehicles[sysid].state

    def vehicle_position_enu(self, sysid: int) -> Vector:
        """True position of a vehicle, m, as of the last whole step."""
        return self._vehicles[sysid].state.position_enu

    def emitter_state(self) -> EmitterState:
        """True state of the emitter, as of the last whole step."""
        return self._feed.emitter.state


def _check(config: SimConfig) -> None:
    sysids = [vehicle.sysid for vehicle in config.vehicles]
    if len(set(sysids)) != len(sysids) or not sysids:
        raise SimulationError(
            f"The simulated vehicles have system ids {sysids}: "
            "at least one is needed, and no two may be the same."
        )
    if config.receivers.reference not in sysids:
        raise SimulationError(
            f"The reference receiver is on UAV {config.receivers.reference}, "
            f"which is not simulated: name one of {sysids}."
        )
    if not 0.0 < config.receivers.rate_hz <= STEP_HZ:
        raise SimulationError(
            f"The receivers' rate is {config.receivers.rate_hz} Hz: "
            f"more than 0 and at most {STEP_HZ} Hz can be simulated."
        )
