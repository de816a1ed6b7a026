"""Simulated receivers on vehicles that others simulate (SITL) or fly, heard by their MAVLink.

A vehicle's own reports are its truth here: its position (GLOBAL_POSITION_INT) at its UTC
(SYSTEM_TIME). So there is no navigation error. All time is the vehicles' own, so that vehicles
simulated faster or slower than real time are measured in their time. The speed-up matters only for
vehicles whose UTC does not follow it, as in PX4's SITL: their UTC is sped up here.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from sim.config import SimConfig
from sim.feed_publisher import FeedPublisher, Publication
from sim.mavlink import AUTOPILOT_COMPONENT, Codec, Message
from swarmctl.frames import LocalFrame, sped_up_utc_s
from swarmctl.units import Vector

REACH_S = 1.0
"""A vehicle hears a burst only within this time of its nearest report, s."""
TRUTH_PERIOD_S = 0.5
"""Least time between publications of the emitter's true state, s."""
RECEIVERS_TRUTH_PERIOD_S = 1.0
"""Least time between publications of the receivers' true errors, s."""

_HISTORY_S = 3.0
"""Reports are kept this long, s. A report that is older than its vehicle's newest by more than
this shows that the vehicle's clock was set back."""
_PATIENCE_S = 10.0
"""A warning comes once a vehicle's reports have been too late for this long, s."""
_JUDGED_AFTER_S = 1.5
"""Time that it takes to judge whether a vehicle's UTC follows its time since boot, s."""
_SLOPE_S = 10.0
"""The rate of a sped-up UTC is taken from the SYSTEM_TIMEs of this span, s."""
_REBOOT_S = 2.0
"""A time since boot that goes back by more than this means a reboot, s."""
_TOLERANCE = 0.2
"""Greatest relative difference between the rates of UTC and time since boot of a real vehicle."""
_LEAP_S = 5.0
"""A clock that jumps by more than this was set, s; no burst was missed."""


class Report(NamedTuple):
    """Position and velocity of a vehicle, ENU (m, m/s), and whether it was high enough to hear."""

    utc_s: float
    position_enu: Vector
    velocity_enu: Vector
    hears: bool


class _Clock:
    """Converts a vehicle's time since boot to UTC, sped up if its UTC is the computer's."""

    __slots__ = ("_is_sped_up", "_speedup", "_told")

    def __init__(self, speedup: float) -> None:
        self._speedup = speedup
        self._told: list[tuple[float, float]] = []
        self._is_sped_up: bool | None = None

    def tell(self, boot_s: float, utc_s: float) -> None:
        """Take a SYSTEM_TIME: time since boot and UTC, s."""
        newest_s = self._told[-1][0] if self._told else -math.inf
        if boot_s < newest_s - _REBOOT_S:
            self._told.clear()
            self._is_sped_up = None
        elif boot_s <= newest_s:
            return
        self._told.append((boot_s, utc_s))
        rate = self.rate
        if self._is_sped_up is None and self._speedup != 1.0 and rate is not None:
            # The rate is nearer to the speed-up than to 1, on a logarithmic scale.
            self._is_sped_up = (rate > math.sqrt(self._speedup)) == (self._speedup > 1.0)
        del self._told[: bisect_left(self._told, (boot_s - _SLOPE_S,))]

    @property
    def rate(self) -> float | None:
        """Seconds since boot per second of its UTC; None until it is known."""
        if not self._told:
            return None
        boot_s, utc_s = (b - a for a, b in zip(self._told[0], self._told[-1], strict=True))
        return boot_s / utc_s if boot_s >= _JUDGED_AFTER_S and utc_s > 0.0 else None

    @property
    def is_left_behind(self) -> bool:
        """Whether its UTC does not follow its time since boot, and is not sped up for it.

        A single step of its UTC does not count: there all but one SYSTEM_TIME agree.
        """
        if self._is_sped_up or self.rate is None:
            return False
        spans = ((b - a, v - u) for (a, u), (b, v) in pairwise(self._told))
        return all(abs(boot_s - utc_s) > _TOLERANCE * boot_s for boot_s, utc_s in spans)

    def utc_s(self, boot_s: float) -> float | None:
        """UTC (s) of a time since boot (s); None until it is known."""
        if not self._told or (self._is_sped_up is None and self._speedup != 1.0):
            return None
        newest_s, utc_s = self._told[-1]
        if boot_s < newest_s - _REBOOT_S:
            return None
        if not self._is_sped_up:
            return utc_s + (boot_s - newest_s)
        rate = self.rate or self._speedup
        return sped_up_utc_s(utc_s + (boot_s - newest_s) / rate, self._speedup)


class _Vehicle:
    """The recent reports of one vehicle, oldest first, and its clock."""

    __slots__ = ("_reports", "clock")

    def __init__(self, speedup: float) -> None:
        self.clock = _Clock(speedup)
        self._reports: list[Report] = []

    @property
    def newest_s(self) -> float:
        """UTC of the newest report, s; minus infinity before any."""
        return self._reports[-1].utc_s if self._reports else -math.inf

    def add(self, report: Report) -> None:
        """Keep a report, unless a newer one has overtaken it."""
        if report.utc_s < self.newest_s - _HISTORY_S:
            self._reports.clear()
        if report.utc_s <= self.newest_s:
            return
        self._reports.append(report)
        del self._reports[: bisect_left(self._reports, (self.newest_s - _HISTORY_S,))]

    def hearing_at(self, epoch_s: float) -> Vector | None:
        """Position at an epoch (UTC, s), m; None if it is unknown or too low to hear."""
        after = bisect_left(self._reports, (epoch_s,))
        around = self._reports[max(0, after - 1) : after + 1]
        if not around:
            return None
        nearest = min(around, key=lambda report: abs(epoch_s - report.utc_s))
        since_s = epoch_s - nearest.utc_s
        if not nearest.hears or abs(since_s) > REACH_S:
            return None
        (x, y, z), (vx, vy, vz) = nearest.position_enu, nearest.velocity_enu
        return (x + since_s * vx, y + since_s * vy, z + since_s * vz)


class SitlReceivers:
    """The emitter, and receivers on vehicles that are only heard.

    A burst arrives at every whole multiple of the receivers' period in UTC. It is measured once
    every vehicle has reported from after it, or the first one is :data:`REACH_S` past it: receivers
    farther behind hear nothing. The emitter begins to drift when the first vehicle is heard.

    Args:
        config: The simulation. Only the system ids of its vehicles are used, and the launch
            point of the first one, where the frame is tangent.
        speedup: Simulated seconds per second of the computer.
    """

    def __init__(self, config: SimConfig, speedup: float = 1.0) -> None:
        first = config.vehicles[0]
        self._frame = LocalFrame(
            first.launch_lat_rad, first.launch_lon_rad, first.launch_alt_amsl_m
        )
        # A beacon may be silent for a minute, but its truth is published more often.
        self._ticks_per_burst = math.ceil(1.0 / (config.receivers.rate_hz * TRUTH_PERIOD_S))
        self._tick_hz = config.receivers.rate_hz * self._ticks_per_burst
        self._floor_m = config.receivers.minimum_altitude_m
        self._feed = FeedPublisher(config, self._frame, 1.0 / self._tick_hz)
        self._vehicles = {vehicle.sysid: _Vehicle(speedup) for vehicle in config.vehicles}
        self._codec = Codec(0)
        self._tick: int | None = None
        self._truth_s = self._receivers_truth_s = -math.inf
        self._publications: list[Publication] = []
        self._complaints: list[str] = []
        self._punctual_s: dict[int, float] = {}
        self._fast: set[int] = set()

    def receive(self, datagram: bytes) -> None:
        """Take a datagram; messages that no autopilot of the swarm sent are ignored."""
        for message in self._codec.decode(datagram):
            vehicle = self._vehicles.get(message.get_srcSystem())
            if vehicle is None or message.get_srcComponent() != AUTOPILOT_COMPONENT:
                continue
            if message.get_type() == "SYSTEM_TIME":
                # Zero until there is a GPS fix.
                if message.time_unix_usec > 0:
                    vehicle.clock.tell(1e-3 * message.time_boot_ms, 1e-6 * message.time_unix_usec)
                    self._compare_speeds(message.get_srcSystem(), vehicle.clock)
            elif message.get_type() == "GLOBAL_POSITION_INT":
                report = self._report(message, vehicle.clock.utc_s(1e-3 * message.time_boot_ms))
                if report is not None:
                    vehicle.add(report)
                    self._compare_clocks(message.get_srcSystem(), report.utc_s)
                    self._advance()

    def publications(self) -> list[Publication]:
        """MQTT messages since the last call, in order."""
        publications, self._publications = self._publications, []
        return publications

    def complaints(self) -> list[str]:
        """Warnings since the last call: vehicles that hear nothing because of their clocks."""
        complaints, self._complaints = self._complaints, []
        return complaints

    def _report(self, message: Message, utc_s: float | None) -> Report | None:
        if utc_s is None or message.lat == message.lon == 0:
            return None
        position = self._frame.to_enu(
            math.radians(1e-7 * message.lat), math.radians(1e-7 * message.lon), 1e-3 * message.alt
        )
        return Report(
            utc_s,
            position,
            (1e-2 * message.vy, 1e-2 * message.vx, -1e-2 * message.vz),
            1e-3 * message.relative_alt > self._floor_m,
        )

    def _compare_clocks(self, sysid: int, utc_s: float) -> None:
        behind_s = max(vehicle.newest_s for vehicle in self._vehicles.values()) - utc_s
        punctual_s = self._punctual_s.setdefault(sysid, utc_s)
        if behind_s <= REACH_S:
            self._punctual_s[sysid] = utc_s
        elif utc_s > punctual_s + _PATIENCE_S:
            self._punctual_s[sysid] = math.inf
            self._complaints.append(
                f"The clock of UAV {sysid} (SYSTEM_TIME) is {behind_s:.1f} s behind the first "
                f"one's: its receiver hears nothing. Start the simulated vehicles together, so "
                f"that their clocks agree to {REACH_S:g} s."
            )

    def _compare_speeds(self, sysid: int, clock: _Clock) -> None:
        if clock.is_left_behind and sysid not in self._fast:
            self._fast.add(sysid)
            self._complaints.append(
                f"UAV {sysid} is simulated {clock.rate:.2g} times as fast as the UTC that it tells "
                f"(SYSTEM_TIME), as PX4's SITL does: start `swarmctl sim --receivers-only` with "
                f"the same --speedup as the simulator and `swarmctl run`."
            )

    def _advance(self) -> None:
        """Measure every burst that is due."""
        for tick in self._due():
            epoch_s = tick / self._tick_hz
            self._feed.emitter.advance()
            if tick % self._ticks_per_burst == 0:
                hearing = {
                    sysid: position
                    for sysid, vehicle in self._vehicles.items()
                    if (position := vehicle.hearing_at(epoch_s)) is not None
                }
                self._publications += self._feed.burst(hearing, epoch_s)
            if epoch_s >= self._truth_s + TRUTH_PERIOD_S:
                self._truth_s = epoch_s
                self._publications.append(self._feed.truth(epoch_s))
            if epoch_s >= self._receivers_truth_s + RECEIVERS_TRUTH_PERIOD_S:
                self._receivers_truth_s = epoch_s
                self._publications += self._feed.receivers_truth(
                    dict.fromkeys(self._vehicles, (0.0, 0.0, 0.0)), epoch_s
                )

    def _due(self) -> Iterator[int]:
        newest = [vehicle.newest_s for vehicle in self._vehicles.values()]
        first_s = max(newest)
        if self._tick is None or abs(first_s - self._tick / self._tick_hz) > _LEAP_S:
            self._tick = math.ceil(first_s * self._tick_hz)
            self._truth_s = self._receivers_truth_s = -math.inf
            self._feed.receivers.start_clocks(self._tick / self._tick_hz)
        while (epoch_s := self._tick / self._tick_hz) <= first_s:
            if first_s < epoch_s + REACH_S and any(
                epoch_s - REACH_S < utc_s < epoch_s for utc_s in newest
            ):
                return
            yield self._tick
            self._tick += 1
