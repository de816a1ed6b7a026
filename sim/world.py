"""The simulated world: vehicles, emitter and receivers on one virtual clock."""

from __future__ import annotations

import math
from collections import deque

from sim.autopilots import PERSONALITIES
from sim.autopilots.onboard_state import Fitting
from sim.clock import Clock
from sim.config import SimConfig, VehicleConfig
from sim.dynamics import Command, State, step
from sim.emitter import EmitterState
from sim.errors import SimError
from sim.feed_publisher import Broadcast, Publication
from sim.navigation_error import PositionError
from sim.noise import GaussMarkov, Normals, generator
from swarmctl.frames import LocalFrame
from swarmctl.units import Vector

STEP_HZ = 50
"""Steps a second of everything: physics, autopilots, epochs."""
STEP_S = 1.0 / STEP_HZ
TRUTH_STEPS = STEP_HZ // 2
"""The emitter's truth is published twice a second."""
RECEIVERS_TRUTH_STEPS = STEP_HZ
"""The receivers' once a second."""

_EARLY_STEPS = 1e-6


class Vehicle:
    """One UAV: airframe, autopilot, its wind and its faults.

    Args:
        config: The UAV.
        sim: The simulation.
        frame: Frame of the simulated world.

    Attributes:
        state: True state of the airframe.
    """

    __slots__ = (
        "_command",
        "_frame",
        "_gust",
        "_mean_wind",
        "_navigation",
        "autopilot",
        "config",
        "state",
    )

    def __init__(self, config: VehicleConfig, sim: SimConfig, frame: LocalFrame) -> None:
        self.config = config
        self._frame = frame
        self._mean_wind = sim.wind.mean_enu
        self._gust = GaussMarkov(
            sim.wind.gust_sigma_mps,
            sim.wind.gust_tau_s,
            STEP_S,
            Normals(generator(sim.seed, "gust", config.sysid)),
        )
        self._navigation = PositionError(
            sim.navigation, STEP_S, generator(sim.seed, "navigation", config.sysid)
        )
        self.state = State(
            frame.to_enu(config.launch_lat_rad, config.launch_lon_rad, config.launch_alt_amsl_m)
        )
        self._command: Command | None = None
        clock = Clock(config.clock, sim.utc_start_s, generator(sim.seed, "clock", config.sysid))
        fitting = Fitting(config, frame, clock, self._navigation, self.state)
        self.autopilot = PERSONALITIES[config.autopilot](fitting)

    def advance(self, now_s: float) -> None:
        """Live through the step that ends at a simulation time (s)."""
        self._gust.advance()
        self._navigation.advance()
        (wx, wy, wz), (gx, gy, gz) = self._mean_wind, self._gust.value
        self.state = step(
            self.state,
            self._command,
            (wx + gx, wy + gy, wz + gz),
            self.config.limits,
            self.ground_up_m(),
            STEP_S,
        )
        self._command = self.autopilot.advance(now_s, self.state)

    def ground_up_m(self) -> float:
        """Up coordinate of the ground below: level with the launch point everywhere, m."""
        x, y, _ = self.state.position_enu
        return self._frame.up_at(x, y, self.config.launch_alt_amsl_m)

    @property
    def navigation_error_enu(self) -> Vector:
        """Its own solution of where it is less where it is, m."""
        return self._navigation.correlated_enu

    def on_air(self, now_s: float) -> bool:
        """Whether anything of it can be received at a simulation time (s)."""
        dies_at_s = self.config.dies_at_s
        return not self.config.silent and (dies_at_s is None or now_s < dies_at_s)


class World:
    """A whole simulation, sans-I/O and deterministic.

    Feed it datagrams, advance its clock, and take out what the vehicles and the receivers
    sent. Time moves in steps of ``STEP_S`` on a fixed grid; the same configuration and the
    same datagrams at the same times give the same bytes, however :meth:`advance` is sliced.

    A vehicle that is off the air (``silent``, or past ``dies_at_s``) flies on by itself but
    neither hears nor is heard, and its receiver delivers nothing.

    Args:
        config: The simulation.

    Attributes:
        frame: Frame of every ``_enu`` the world shows: tangent at the first vehicle's launch
            point.

    Raises:
        SimError: The configuration contradicts itself.
    """

    def __init__(self, config: SimConfig) -> None:
        _check(config)
        first = config.vehicles[0]
        self.frame = LocalFrame(first.launch_lat_rad, first.launch_lon_rad, first.launch_alt_amsl_m)
        self._config = config
        self._vehicles = {v.sysid: Vehicle(v, config, self.frame) for v in config.vehicles}
        self._broadcast = Broadcast(config, self.frame, STEP_S)
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
        """Let time pass until a simulation time (s); earlier than now does nothing."""
        while (self._steps + 1) * STEP_S <= until_s + _EARLY_STEPS * STEP_S:
            self._step()
        self._time_s = max(self._time_s, until_s)

    def _step(self) -> None:
        self._steps += 1
        now_s = self._steps * STEP_S
        self._broadcast.emitter.advance()
        for vehicle in self._vehicles.values():
            vehicle.advance(now_s)
            self._collect(vehicle, now_s)
        self._publish(now_s)

    # --- Bytes -------------------------------------------------------------------------

    def receive_datagram(self, sysid: int, data: bytes) -> None:
        """Deliver a datagram to a vehicle now.

        Args:
            sysid: The vehicle whose socket it reaches, whatever the datagram says.
            data: Any bytes.
        """
        vehicle = self._vehicles[sysid]
        if vehicle.on_air(self._time_s):
            vehicle.autopilot.receive(data, self._time_s)
            self._collect(vehicle, self._time_s)

    def datagrams(self) -> list[tuple[int, bytes]]:
        """What the vehicles sent since the last call: system id and datagram, in order."""
        datagrams, self._datagrams = self._datagrams, []
        return datagrams

    def publications(self) -> list[Publication]:
        """What was published over MQTT since the last call: topic and payload, in order."""
        publications, self._publications = self._publications, []
        return publications

    def _collect(self, vehicle: Vehicle, now_s: float) -> None:
        datagrams = vehicle.autopilot.datagrams()
        if datagrams and vehicle.on_air(now_s):
            sysid = vehicle.config.sysid
            self._datagrams.extend((sysid, datagram) for datagram in datagrams)

    def _publish(self, now_s: float) -> None:
        # An epoch is the first step at or after its due time: positions are then exact.
        if self._steps + _EARLY_STEPS >= (self._epochs + 1) * self._steps_per_epoch:
            self._epochs += 1
            self._delayed.append((self._steps + self._delay_steps, self._measure(now_s)))
        while self._delayed and self._delayed[0][0] <= self._steps:
            self._publications += self._delayed.popleft()[1]
        if self._steps % TRUTH_STEPS == 0:
            self._publications.append(self._broadcast.truth(self._config.utc_start_s + now_s))
        if self._steps % RECEIVERS_TRUTH_STEPS == 0:
            self._publications += self._broadcast.receivers_truth(
                {sysid: v.navigation_error_enu for sysid, v in self._vehicles.items()},
                self._config.utc_start_s + now_s,
            )

    def _measure(self, now_s: float) -> list[Publication]:
        """What the receivers publish of one burst."""
        floor_m = self._config.receivers.minimum_altitude_m
        hearing = {
            sysid: vehicle.state.position_enu
            for sysid, vehicle in self._vehicles.items()
            if vehicle.on_air(now_s)
            and vehicle.state.position_enu[2] - vehicle.ground_up_m() > floor_m
        }
        return self._broadcast.burst(hearing, self._config.utc_start_s + now_s)

    # --- Truth -------------------------------------------------------------------------

    def vehicle_state(self, sysid: int) -> State:
        """True state of a vehicle, as of the last whole step."""
        return self._vehicles[sysid].state

    def vehicle_position_enu(self, sysid: int) -> Vector:
        """True position of a vehicle, m, as of the last whole step."""
        return self._vehicles[sysid].state.position_enu

    def emitter_state(self) -> EmitterState:
        """True state of the emitter, as of the last whole step."""
        return self._broadcast.emitter.state


def _check(config: SimConfig) -> None:
    sysids = [vehicle.sysid for vehicle in config.vehicles]
    if len(set(sysids)) != len(sysids) or not sysids:
        raise SimError(
            f"The simulated vehicles have system ids {sysids}: "
            "at least one is needed, and no two may be the same."
        )
    if config.receivers.reference not in sysids:
        raise SimError(
            f"The reference receiver is on UAV {config.receivers.reference}, "
            f"which is not simulated: name one of {sysids}."
        )
    if not 0.0 < config.receivers.rate_hz <= STEP_HZ:
        raise SimError(
            f"The receivers' rate is {config.receivers.rate_hz} Hz: "
            f"more than 0 and at most {STEP_HZ} Hz can be simulated."
        )
