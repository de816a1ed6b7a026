"""What the controller knows of its vehicles: the latest of every fact, and how old it is."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from swarmctl.events import (
    GpsFix,
    Heartbeat,
    HomePosition,
    LandedState,
    LinkQuality,
    Mode,
    ParameterValue,
    VehicleClock,
    VehicleObservation,
    VehiclePosition,
    VehicleStatus,
    VehicleVersion,
)
from swarmctl.frames import LocalFrame
from swarmctl.units import Vector

CLOCK_WINDOW_S = 3.0
"""The vehicles' clocks are judged by the reports of this long."""
REORDERING_S = 2.0
"""Time since boot that goes back by more than this shows that a vehicle has booted again."""
RATE_REPORTS = 10
"""Their rate is told from so many of the last positions."""
AIRBORNE_M = 3.0
"""A vehicle this far above its launch point flies; position noise alone does not lift it."""


@dataclass(slots=True)
class VehicleState:
    """The latest facts about one vehicle.

    Attributes:
        sysid: MAVLink system id.
        altitude_amsl_m: The altitude the mission gives it, m.
        position_enu: Latest position, m.
        launch_enu: Where it stood before take-off (its own home position), m.
        position_boots_s: Times since boot of its latest positions, s.
        parameters: What was last told of each parameter, by its newest name.
        clock_first: First SYSTEM_TIME since it booted; with the latest it tells the clocks' rates.
        clock_last: The latest.
    """

    sysid: int
    altitude_amsl_m: float
    heartbeat: Heartbeat | None = None
    position: VehiclePosition | None = None
    position_enu: Vector | None = None
    status: VehicleStatus | None = None
    fix: GpsFix | None = None
    version: VehicleVersion | None = None
    landed: LandedState | None = None
    quality: LinkQuality | None = None
    clock_first: VehicleClock | None = None
    clock_last: VehicleClock | None = None
    launch_enu: Vector | None = None
    position_boots_s: deque[float] = field(default_factory=lambda: deque(maxlen=RATE_REPORTS))
    parameters: dict[str, ParameterValue] = field(default_factory=dict)

    @property
    def is_guided(self) -> bool:
        """Whether it takes our setpoints: armed and in guided mode by its last heartbeat."""
        beat = self.heartbeat
        return beat is not None and beat.armed and beat.mode is Mode.GUIDED

    @property
    def guided_by_stream(self) -> bool:
        """Whether its guided mode lives on a stream of setpoints (see Heartbeat)."""
        return self.heartbeat is not None and self.heartbeat.guided_by_stream

    @property
    def known_parameters(self) -> dict[str, float]:
        """Values of the parameters it has told, by their newest names."""
        told = self.parameters.items()
        return {name: value.value for name, value in told if value.value is not None}

    @property
    def is_armed(self) -> bool:
        """Whether its last heartbeat said armed."""
        return self.heartbeat is not None and self.heartbeat.armed

    @property
    def is_airborne(self) -> bool:
        """Whether its latest position is clearly above its launch point."""
        here, home = self.position_enu, self.launch_enu
        return here is not None and home is not None and here[2] - home[2] > AIRBORNE_M

    @property
    def position_hz(self) -> float | None:
        """How often it has reported its position lately, by its own clock, Hz; None if unknown."""
        boots = self.position_boots_s
        if len(boots) < RATE_REPORTS or not boots[-1] > boots[0]:
            return None
        return (len(boots) - 1) / (boots[-1] - boots[0])

    def silence_s(self, now: float) -> float:
        """Time since the older of its last heartbeat and its last position, s."""
        if self.heartbeat is None:
            return float("inf")
        heard = self.heartbeat.received_s
        if self.position is not None:
            heard = min(heard, self.position.received_s)
        return now - heard

    def position_at(self, utc_s: float) -> Vector | None:
        """Latest position carried to an instant by its velocity, ENU m; None if unknown."""
        report, enu = self.position, self.position_enu
        if report is None or enu is None or report.epoch_utc_s is None:
            return None
        dt = utc_s - report.epoch_utc_s
        v = report.velocity_enu
        return (enu[0] + v[0] * dt, enu[1] + v[1] * dt, enu[2] + v[2] * dt)


@dataclass(slots=True)
class Fleet:
    """All vehicles of the mission.

    Attributes:
        frame: The mission's local frame.
        vehicles: Their states by system id.
    """

    frame: LocalFrame
    vehicles: dict[int, VehicleState]
    _offsets: deque[tuple[float, float]] = field(default_factory=deque, init=False)

    def observe(self, event: VehicleObservation) -> None:
        """Take a fact about a vehicle of the mission; others are ignored."""
        vehicle = self.vehicles.get(event.sysid)
        if vehicle is None:
            return
        match event:
            case VehiclePosition():
                vehicle.position = event
                vehicle.position_enu = self.frame.to_enu(
                    event.lat_rad, event.lon_rad, event.alt_amsl_m
                )
                vehicle.position_boots_s.append(event.boot_s)
            case Heartbeat():
                vehicle.heartbeat = event
            case VehicleStatus():
                vehicle.status = event
            case GpsFix():
                vehicle.fix = event
            case HomePosition():
                vehicle.launch_enu = self.frame.to_enu(
                    event.lat_rad, event.lon_rad, event.alt_amsl_m
                )
            case VehicleVersion():
                vehicle.version = event
            case LandedState():
                vehicle.landed = event
            case LinkQuality():
                vehicle.quality = event
            case ParameterValue():
                vehicle.parameters[event.parameter] = event
            case VehicleClock():
                self._observe_clock(vehicle, event)

    def _observe_clock(self, vehicle: VehicleState, event: VehicleClock) -> None:
        last = vehicle.clock_last
        if last is None or event.boot_s < last.boot_s - REORDERING_S:
            vehicle.clock_first = event
        vehicle.clock_last = event
        self._offsets.append((event.received_s, event.utc_s - event.received_s))
        while self._offsets[0][0] < event.received_s - CLOCK_WINDOW_S:
            self._offsets.popleft()

    def utc(self, now: float) -> float | None:
        """UTC at the controller's time ``now``, s, by the vehicles' clocks; None if unknown.

        Delay only ever makes a report's UTC less its time of arrival smaller, so the greatest
        of the recent ones is the best; older ones may be of a simulator that has slowed down.
        """
        if not self._offsets:
            return None
        return now + max(offset for _, offset in self._offsets)
