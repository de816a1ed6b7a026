"""What travels over MQTT: topics and JSON messages, shared with whoever publishes them.

Topics, for a swarm named ``S``:

===========================  ====================================================================
``swarm/S/tdoa``             :class:`RangeDifferenceMessage`, one object or a list of them
``swarm/S/toa/ID``           :class:`ArrivalTimeMessage` of receiver ``ID``, one or a list of them
``swarm/S/estimate``         :class:`EstimateMessage`, published by the controller
``swarm/S/truth``            :class:`TruthMessage`, published by the simulator only; only the
                             recorder and reports read it
``swarm/S/truth/receivers``  list of :class:`ReceiverTruthMessage`, likewise
===========================  ====================================================================
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

VERSION = 1
"""Value of ``v`` in every message."""

SysId = Annotated[int, Meta(ge=1, le=255)]
PositiveMetres = Annotated[float, Meta(gt=0.0)]
PositiveSeconds = Annotated[float, Meta(gt=0.0)]


class _Message(msgspec.Struct, frozen=True, kw_only=True):
    v: Annotated[int, Meta(ge=VERSION, le=VERSION)] = VERSION


class RangeDifferenceMessage(_Message, frozen=True):
    """One range difference, ``rd_m = |emitter - receiver| - |emitter - reference|``.

    Attributes:
        v: Version of the message, 1.
        epoch_utc_s: Epoch of reception, UTC s. Differences with the same epoch and reference
            are one simultaneous measurement.
        reference: System id of the UAV that carries the reference receiver.
        receiver: System id of the companion.
        rd_m: Range difference, m.
        sigma_m: 1-sigma of its noise, m.
        rho: Share of ``sigma_m``² that comes from the reference receiver (equal receivers:
            one half).
        clock_sigma_s: 1-sigma of a receiver's clock error at that time, s.
        seq: Counts messages of the publisher.
    """

    epoch_utc_s: float
    reference: SysId
    receiver: SysId
    rd_m: float
    sigma_m: PositiveMetres
    rho: Annotated[float, Meta(ge=0.0, lt=1.0)]
    clock_sigma_s: Annotated[float, Meta(ge=0.0)]
    seq: Annotated[int, Meta(ge=0)]


class ArrivalTimeMessage(_Message, frozen=True):
    """When one receiver heard one burst: ``toa_s + toa_frac_s``, UTC.

    In two parts, since a float64 of UTC seconds resolves 0.24 us, which is 71 m.

    Attributes:
        v: Version of the message, 1.
        receiver: System id of the UAV that carries the receiver; that of the topic.
        toa_s: Whole seconds of UTC.
        toa_frac_s: The rest, 0 <= toa_frac_s < 1.
        burst: Number of the burst, the same at every receiver.
        sigma_s: 1-sigma of this arrival time's own error, s.
        clock_sigma_s: 1-sigma of a receiver's clock error at that time, s.
        seq: Counts messages of the publisher.
    """

    receiver: SysId
    toa_s: Annotated[int, Meta(ge=0, le=2**63 - 1)]
    toa_frac_s: Annotated[float, Meta(ge=0.0, lt=1.0)]
    burst: Annotated[int, Meta(ge=0)]
    sigma_s: PositiveSeconds
    clock_sigma_s: Annotated[float, Meta(ge=0.0)]
    seq: Annotated[int, Meta(ge=0)]


class TruthMessage(_Message, frozen=True):
    """True state of the simulated emitter; velocity east, north, up in m/s at its position."""

    epoch_utc_s: float
    lat_deg: float
    lon_deg: float
    alt_amsl_m: float
    velocity_enu: tuple[float, float, float]


class ReceiverTruthMessage(_Message, frozen=True):
    """How far off a simulated receiver is.

    Attributes:
        v: Version of the message, 1.
        epoch_utc_s: When, UTC s.
        receiver: System id of the UAV that carries the receiver.
        clock_m: Error of its clock times the speed of light, m; late stamps are positive.
        drift_mps: Rate of ``clock_m``, m/s.
        navigation_enu: Position its UAV reports less the true one, without the white part that
            is new in every report, m.
    """

    epoch_utc_s: float
    receiver: SysId
    clock_m: float
    drift_mps: float
    navigation_enu: tuple[float, float, float]


class EstimateMessage(_Message, frozen=True):
    """The controller's estimate of the emitter.

    Attributes:
        epoch_utc_s: Epoch the state refers to, UTC s.
        lat_deg: Latitude, degrees.
        lon_deg: Longitude, degrees.
        alt_amsl_m: Altitude, m.
        position_enu: Position in the mission's frame, m.
        velocity_enu: Velocity, m/s.
        covariance_enu: Row-major 3 x 3 covariance of the position, m².
        ellipse_95: Semi-major axis (m), semi-minor axis (m) and direction of the major axis
            (rad from East) of the horizontal 95 % ellipse.
        age_s: Age of the last measurement used, s.
    """

    epoch_utc_s: float
    lat_deg: float
    lon_deg: float
    alt_amsl_m: float
    position_enu: tuple[float, float, float]
    velocity_enu: tuple[float, float, float]
    covariance_enu: tuple[float, ...]
    ellipse_95: tuple[float, float, float]
    age_s: float


def tdoa_topic(swarm: str) -> str:
    """Topic of the range differences of a swarm."""
    return f"swarm/{swarm}/tdoa"


def toa_topic(swarm: str, receiver: int | Literal["+"]) -> str:
    """Topic of a receiver's arrival times; ``+`` subscribes to every receiver's."""
    return f"swarm/{swarm}/toa/{receiver}"


def estimate_topic(swarm: str) -> str:
    """Topic of the controller's estimate."""
    return f"swarm/{swarm}/estimate"


def truth_topic(swarm: str) -> str:
    """Topic of the simulator's truth."""
    return f"swarm/{swarm}/truth"


def receivers_truth_topic(swarm: str) -> str:
    """Topic of the simulator's truth about the receivers."""
    return f"{truth_topic(swarm)}/receivers"
