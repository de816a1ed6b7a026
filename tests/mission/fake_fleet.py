"""Vehicles and receivers made of observations alone: no MAVLink, no simulator, no clock.

Each vehicle does at once what it is told and flies exactly to its setpoints within a speed
limit, so that a controller test is about the controller.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from swarmctl.commands import (
    Arm,
    Command,
    GoTo,
    ReadParameter,
    RequestHome,
    RequestVersion,
    SetMode,
    StreamTelemetry,
    TakeOff,
    WriteParameter,
)
from swarmctl.decisions import Decision, PhaseChanged
from swarmctl.events import (
    CommandKind,
    CommandOutcome,
    GpsFix,
    Heartbeat,
    HomePosition,
    Mode,
    Observation,
    ParameterValue,
    RangeDifference,
    RangeDifferences,
    VehicleClock,
    VehiclePosition,
    VehicleStatus,
    VehicleVersion,
)
from swarmctl.mission.controller import Controller
from swarmctl.mission.mission_file import Mission
from swarmctl.units import Vector

UTC0 = 1_790_000_000.0
PERIOD_S = 0.1
SPEED_MPS = 20.0
CLIMB_MPS = 5.0
STREAM_LOST_S = 1.1
ARDUPILOT_SAFE = {
    "FS_GCS_ENABLE": 1.0,
    "FS_GCS_TIMEOUT": 10.0,
    "MAV_GCS_SYSID": 245.0,
    "RTL_ALT_M": 0.0,
    "RTL_CLIMB_MIN_M": 0.0,
    "FS_EKF_ACTION": 1.0,
    "GUID_OPTIONS": 0.0,
    "WP_SPD": 20.0,
    "WP_ACC": 5.0,
    "FS_OPTIONS": 16.0,
    "FS_THR_ENABLE": 0.0,
    "BATT_FS_LOW_ACT": 2.0,
    "BATT_FS_CRT_ACT": 1.0,
    "BATT_LOW_VOLT": 10.5,
    "BATT_LOW_MAH": 0.0,
    "FENCE_ENABLE": 0.0,
    "FENCE_AUTOENABLE": 0.0,
    "FENCE_TYPE": 7.0,
    "FENCE_MARGIN": 2.0,
    "FENCE_ALT_MAX": 100.0,
    "FENCE_RADIUS": 300.0,
}
PX4_SAFE = {
    "NAV_DLL_ACT": 2.0,
    "COM_OBL_RC_ACT": 5.0,
    "COM_OBL_ACT": 1.0,
    "COM_OF_LOSS_T": 1.0,
    "RTL_RETURN_ALT": 0.0,
    "NAV_RCL_ACT": 2.0,
    "COM_RCL_EXCEPT": 4.0,
    "COM_RC_IN_MODE": 3.0,
    "COM_LOW_BAT_ACT": 3.0,
    "MPC_XY_VEL_MAX": 20.0,
    "GF_ACTION": 2.0,
    "GF_MAX_VER_DIST": 0.0,
    "GF_MAX_HOR_DIST": 0.0,
}


@dataclass
class FakeVehicle:
    """One vehicle; tests set its attributes to make trouble.

    With ``by_stream`` it has PX4's manners: guided mode needs setpoints, and they raise it.
    """

    sysid: int
    home: Vector
    position: list[float]
    goal: list[float]
    velocity: Vector = (0.0, 0.0, 0.0)
    mode: Mode = Mode.OTHER
    armed: bool = False
    streaming: bool = False
    silent: bool = False
    refuses: frozenset[CommandKind] = frozenset()
    ignores: frozenset[str] = frozenset()
    battery: float = 0.9
    prearm_ok: bool = True
    clock_rate: float = 1.0
    position_every: int = 1
    uid: int = 0
    autopilot: Literal["ardupilot", "px4", "other"] = "ardupilot"
    by_stream: bool = False
    setpoint_s: float = -math.inf
    failsafe: bool = False
    stuck: bool = False
    parameters: dict[str, float] = field(default_factory=ARDUPILOT_SAFE.copy)
    commands: list[Command] = field(default_factory=list)


class FakeFleet:
    """All vehicles of a mission and an emitter that their receivers hear."""

    def __init__(self, mission: Mission, seed: int = 0) -> None:
        self.mission = mission
        self.frame = mission.frame
        self.vehicles = {
            sysid: FakeVehicle(
                sysid, (20.0 * i, 0.0, 0.0), [20.0 * i, 0.0, 0.0], [20.0 * i, 0.0, 0.0], uid=1 + i
            )
            for i, sysid in enumerate(mission.swarm.sysids)
        }
        assert mission.sim is not None
        self.emitter = np.array(self.frame.to_enu(*mission.sim.emitter.geodetic))
        self.drift = np.array([1.4, 0.5, 0.0])
        self.rng = np.random.default_rng(seed)
        self.feed_on = True
        self.claimed_sigma_m = 3.0
        self._slow_at = 0.0

    def obey(self, command: Command, now: float) -> Iterator[Observation]:
        """Carry a command out at once."""
        vehicle = self.vehicles[command.sysid]
        vehicle.commands.append(command)
        if isinstance(command, ReadParameter | WriteParameter):
            yield self._parameter(vehicle, command, now)
            return
        if isinstance(command, GoTo):
            vehicle.setpoint_s = now
            if vehicle.failsafe and not vehicle.stuck:
                vehicle.failsafe, vehicle.mode = False, Mode.GUIDED
            if vehicle.mode is Mode.GUIDED and vehicle.armed:
                vehicle.goal = list(
                    self.frame.to_enu(command.lat_rad, command.lon_rad, command.alt_amsl_m)
                )
                vehicle.velocity = command.velocity_enu
            return
        result = "refused" if command.kind in vehicle.refuses else "accepted"
        if vehicle.silent or command.kind in vehicle.ignores:
            result = "no_answer"
        if isinstance(command, SetMode) and command.mode is Mode.GUIDED and vehicle.by_stream:
            result = result if now - vehicle.setpoint_s < STREAM_LOST_S else "refused"
        if isinstance(command, TakeOff) and vehicle.by_stream:
            result = "refused"
        if result == "accepted":
            self._change(vehicle, command)
        yield CommandOutcome(
            received_s=now,
            sysid=vehicle.sysid,
            command=command.kind,
            result=result,  # type: ignore[arg-type]  # a str here, a Literal there
            detail="FAILED (Arm: Compass not healthy)" if result == "refused" else "",
        )
        if not vehicle.silent:
            yield self._heartbeat(vehicle, now)
        if result == "accepted" and isinstance(command, RequestHome):
            lat, lon, alt = self.frame.to_geodetic(*vehicle.home)
            yield HomePosition(
                received_s=now, sysid=vehicle.sysid, lat_rad=lat, lon_rad=lon, alt_amsl_m=alt
            )
        if result == "accepted" and isinstance(command, RequestVersion):
            yield VehicleVersion(
                received_s=now, sysid=vehicle.sysid, uid=vehicle.uid, flight_sw_version=0
            )

    def _parameter(
        self, vehicle: FakeVehicle, command: ReadParameter | WriteParameter, now: float
    ) -> ParameterValue:
        name = command.parameter
        answers = name in vehicle.parameters and not vehicle.silent
        if answers and isinstance(command, WriteParameter) and name not in vehicle.ignores:
            vehicle.parameters[name] = command.value
        return ParameterValue(
            received_s=now,
            sysid=vehicle.sysid,
            parameter=name,
            value=vehicle.parameters[name] if answers else None,
            own_name=name,
        )

    def _change(self, vehicle: FakeVehicle, command: Command) -> None:
        match command:
            case StreamTelemetry():
                vehicle.streaming = True
            case SetMode():
                vehicle.mode = command.mode
                vehicle.velocity = (0.0, 0.0, 0.0)
                vehicle.goal = list(vehicle.position)
                if command.mode is Mode.LAND:
                    vehicle.goal[2] = vehicle.home[2]
            case Arm():
                vehicle.armed = True
            case TakeOff():
                vehicle.goal[2] = command.alt_amsl_m - self.mission.origin.alt_amsl_m

    def observe(self, now: float) -> Iterator[Observation]:
        """Fly one period and report."""
        slow = now >= self._slow_at
        self._slow_at = now + 1.0 - 1e-9 if slow else self._slow_at
        for vehicle in self.vehicles.values():
            starved = vehicle.by_stream and now - vehicle.setpoint_s > STREAM_LOST_S
            if vehicle.mode is Mode.GUIDED and vehicle.armed and starved:
                vehicle.failsafe, vehicle.mode = True, Mode.OTHER
                vehicle.goal = list(vehicle.position)
            self._fly(vehicle)
            if vehicle.silent:
                continue
            if slow:
                yield self._heartbeat(vehicle, now)
            if not vehicle.streaming:
                continue
            if slow:
                yield GpsFix(received_s=now, sysid=vehicle.sysid, fix_type=3, satellites=12)
                yield VehicleClock(
                    received_s=now,
                    sysid=vehicle.sysid,
                    utc_s=UTC0 + now * vehicle.clock_rate,
                    boot_s=now,
                )
                yield VehicleStatus(
                    received_s=now,
                    sysid=vehicle.sysid,
                    battery_v=15.0,
                    battery_fraction=vehicle.battery,
                    prearm_ok=vehicle.prearm_ok,
                )
            if round(now / PERIOD_S) % vehicle.position_every:
                continue
            lat, lon, alt = self.frame.to_geodetic(*vehicle.position)
            yield VehiclePosition(
                received_s=now,
                sysid=vehicle.sysid,
                boot_s=now,
                epoch_utc_s=UTC0 + now,
                lat_rad=lat,
                lon_rad=lon,
                alt_amsl_m=alt,
                velocity_enu=vehicle.velocity,
            )
        self.emitter = self.emitter + self.drift * PERIOD_S
        if self.feed_on and all(v.position[2] > 5.0 for v in self.vehicles.values()):
            yield self._measure(now)

    def _fly(self, vehicle: FakeVehicle) -> None:
        if not vehicle.armed:
            return
        gap = [g - p for g, p in zip(vehicle.goal, vehicle.position, strict=True)]
        level = math.hypot(gap[0], gap[1])
        share = min(1.0, SPEED_MPS * PERIOD_S / level) if level > 0.0 else 0.0
        climb = max(-CLIMB_MPS * PERIOD_S, min(CLIMB_MPS * PERIOD_S, gap[2]))
        vehicle.position[0] += share * gap[0]
        vehicle.position[1] += share * gap[1]
        vehicle.position[2] += climb
        if vehicle.mode is Mode.LAND and vehicle.position[2] <= vehicle.home[2] + 0.01:
            vehicle.armed = False

    def _heartbeat(self, vehicle: FakeVehicle, now: float) -> Heartbeat:
        return Heartbeat(
            received_s=now,
            sysid=vehicle.sysid,
            autopilot="px4" if vehicle.by_stream else vehicle.autopilot,
            is_multirotor=True,
            mode=vehicle.mode,
            mode_name=vehicle.mode.upper(),
            armed=vehicle.armed,
            failsafe=vehicle.failsafe,
            guided_by_stream=vehicle.by_stream,
        )

    def _measure(self, now: float) -> RangeDifferences:
        reference = self.mission.swarm.reference
        ranges = {
            v.sysid: float(np.linalg.norm(self.emitter - v.position))
            + float(self.rng.normal(0.0, 3.0 / math.sqrt(2.0)))
            for v in self.vehicles.values()
        }
        return RangeDifferences(
            received_s=now,
            epoch_utc_s=UTC0 + now,
            reference=reference,
            items=tuple(
                RangeDifference(sysid, r - ranges[reference], self.claimed_sigma_m)
                for sysid, r in ranges.items()
                if sysid != reference
            ),
            rho=0.5,
            clock_sigma_s=0.0,
            seq=0,
        )


class Flight:
    """A controller flying a fake fleet in virtual time."""

    def __init__(self, mission: Mission, seed: int = 0) -> None:
        self.fleet = FakeFleet(mission, seed)
        self.controller = Controller(mission, 0.0)
        self.now = 0.0
        self.decisions: list[Decision] = []
        self.commands: list[Command] = []
        self.least_separation_m = math.inf
        self.least_stand_off_m = math.inf

    def receive(self, event: Observation) -> None:
        """Hand the controller one observation."""
        self.controller.receive(event, self.now)
        self._settle()

    def step(self) -> None:
        """One control period."""
        self.now = round(self.now + PERIOD_S, 6)
        for event in self.fleet.observe(self.now):
            self.controller.receive(event, self.now)
        if self.now >= self.controller.next_tick():
            self.controller.tick(self.now)
        self._settle()
        self._measure()

    def run(self, until: str, limit_s: float = 1500.0) -> None:
        """Fly until a phase is entered (or the mission has ended)."""
        while self.controller.phase != until:
            assert self.now < limit_s, f"still {self.controller.phase} after {limit_s} s"
            assert not self.controller.ended, f"ended: {self.controller.result}"
            self.step()

    def phases(self) -> list[str]:
        """Names of the phases entered, in order."""
        return [d.phase for d in self.decisions if isinstance(d, PhaseChanged)]

    def _settle(self) -> None:
        while commands := self.controller.commands():
            for command in commands:
                self.commands.append(command)
                for event in self.fleet.obey(command, self.now):
                    self.controller.receive(event, self.now)
        self.decisions += self.controller.decisions()

    def _measure(self) -> None:
        flying = [v.position for v in self.fleet.vehicles.values() if v.position[2] > 3.0]
        for i, a in enumerate(flying):
            distance = float(np.linalg.norm(self.fleet.emitter - a))
            self.least_stand_off_m = min(self.least_stand_off_m, distance)
            for b in flying[i + 1 :]:
                self.least_separation_m = min(self.least_separation_m, math.dist(a, b))
