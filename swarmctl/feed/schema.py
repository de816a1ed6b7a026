"""What travels over MQTT: topics and JSON messages, shared with whoever publishes them.

Topics, for a swarm named ``S``:

===================  ========================================================================
``swarm/S/tdoa``     :class:`RangeDifferenceMessage`, one object or a list of them
``swarm/S/estimate`` :class:`EstimateMessage`, published by the controller
``swarm/S/truth``    :class:`TruthMessage`, published by the simulator only; only the recorder
                     and reports read it
===================  ========================================================================
"""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

SPEED_OF_LIGHT_MPS = 299_792_458.0
"""c: range differences are time differences times this."""

VERSION = 1
"""Value of ``v`` in every message."""

SysId = Annotated[int, Meta(ge=1, le=255)]
PositiveMetres = Annotated[float, Meta(gt=0.0)]


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
        clock_sigma_s: 1-sigma of the receivers' mutual clock synchronisation, s.
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


class TruthMessage(_Message, frozen=True):
    """True state of the simulated emitter; velocity east, north, up in m/s at its position."""

    epoch_utc_s: float
    lat_deg: float
    lon_deg: float
    alt_amsl_m: float
    velocity_enu: tuple[float, float, float]


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


def estimate_topic(swarm: str) -> str:
    """Topic of the controller's estimate."""
    return f"swarm/{swarm}/estimate"


def truth_topic(swarm: str) -> str:
    """Topic of the simulator's truth."""
    return f"swarm/{swarm}/truth"
