"""What the core decided or computed: phases, estimates, plans, notices.

All are frozen and JSON-encodable, as :mod:`swarmctl.events` says of every record.
"""

from __future__ import annotations

from typing import Literal

import msgspec

from swarmctl.events import Record
from swarmctl.results import MissionResult
from swarmctl.units import Vector


class Decision(Record, frozen=True):
    """Something the core decided or computed.

    Attributes:
        at_s: Controller's monotonic time, s.
    """

    at_s: float


class PhaseChanged(Decision, frozen=True):
    """The mission entered a phase.

    Attributes:
        phase: The new phase's name.
        trigger: What moved it there.
        reason: One sentence for the operator.
    """

    phase: str
    trigger: str
    reason: str


class EstimateMade(Decision, frozen=True, tag="Estimate"):
    """The emitter's estimated state after a measurement update.

    Attributes:
        epoch_utc_s: Epoch the state refers to, UTC s.
        position_enu: Position, m.
        velocity_enu: Velocity, m/s.
        covariance: Row-major 6 x 6 covariance of (position, velocity), SI.
        probability: That the emitter is here and not at another place that is still possible;
            the covariance spans all of them.
        nis: Normalised innovation squared of the update (chi-squared, ``rd_count`` degrees of
            freedom, if the filter is consistent).
        rd_count: Range differences in the update that were not set aside.
        measured_utc_s: Epoch of the range differences that the update was given, UTC s; earlier
            than ``epoch_utc_s`` if they came late.
        reference: System id of the UAV that these are differenced against; None if unknown.
        receivers: System ids of the companions, those set aside included.
        sigma_m: White 1-sigma of each range difference, m.
        rho: Share of each variance that comes from the reference receiver, 0..1.
    """

    epoch_utc_s: float
    position_enu: Vector
    velocity_enu: Vector
    covariance: tuple[float, ...]
    nis: float
    rd_count: int
    probability: float = 1.0
    measured_utc_s: float = 0.0
    reference: int | None = None
    receivers: tuple[int, ...] = ()
    sigma_m: tuple[float, ...] = ()
    rho: tuple[float, ...] = ()


class ReceiverEstimate(Decision, frozen=True):
    """What one receiver's clock and navigation are estimated to be off, against another's.

    Everything is the receiver's less the same of ``relative_to``: only differences can be
    observed. What is not modelled is 0 with a sigma of 0.

    Attributes:
        epoch_utc_s: Epoch the states refer to, UTC s.
        receiver: System id of the UAV that carries the receiver.
        relative_to: System id of the one it is compared with, the reference.
        clock_m: Clock error times the speed of light, m; late stamps are positive.
        clock_sigma_m: Its 1-sigma, m.
        drift_mps: Rate of ``clock_m``, m/s.
        drift_sigma_mps: Its 1-sigma, m/s.
        navigation_enu: Navigation error, reported less true position, m.
        navigation_sigma_enu: Its 1-sigma per axis, m.
    """

    epoch_utc_s: float
    receiver: int
    relative_to: int
    clock_m: float
    clock_sigma_m: float
    drift_mps: float
    drift_sigma_mps: float
    navigation_enu: Vector
    navigation_sigma_enu: Vector


class HealthChanged(Decision, frozen=True):
    """The track's health is another from here on.

    Attributes:
        status: What the track is worth now.
        cause: What is wrong with it; None if nothing is, or it has just begun.
        detail: One sentence for the operator.
    """

    status: Literal["initialising", "tracking", "degraded", "diverged"]
    cause: Literal["noise", "correlated", "rejected", "too_quiet", "repeated"] | None
    detail: str


class Slot(msgspec.Struct, frozen=True):
    """Where one vehicle should be now, the velocity commanded to it, and its measured error.

    Attributes:
        sysid: MAVLink system id.
        position_enu: Where it should be: a follower's slot, the reference's plan, m.
        velocity_enu: Commanded velocity, m/s.
        error_m: 3-D distance between the vehicle and this position at the same instant; None
            without a recent position.
        range_to_reference_m: 3-D distance of the vehicle from the reference UAV; None without
            recent positions, and for the reference itself.
        joined: Whether it is in the formation: neither lost nor on its way back.
    """

    sysid: int
    position_enu: Vector
    velocity_enu: Vector
    error_m: float | None
    range_to_reference_m: float | None
    joined: bool


class Plan(Decision, frozen=True):
    """The formation as commanded in one control period.

    Attributes:
        reference: System id of the reference UAV.
        los_rad: LOS angle the formation is drawn against, rad from East.
        formed: Whether every follower has reached its slot since forming up began.
        slots: One entry per vehicle, the reference included.
    """

    reference: int
    los_rad: float
    formed: bool
    slots: tuple[Slot, ...]


class Notice(Decision, frozen=True):
    """A sentence for the operator."""

    level: Literal["info", "warning", "error"]
    text: str


class MissionEnded(Decision, frozen=True):
    """The flight is over.

    Attributes:
        result: How it ended.
        detail: One sentence.
    """

    result: MissionResult
    detail: str
