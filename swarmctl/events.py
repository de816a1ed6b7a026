"""The vocabulary of the system: what happened, what was decided, what is commanded.

Three families, all frozen and all JSON-encodable by msgspec, so that a broadcast stays safe
and the recording holds exactly what the core saw:

* **Observations** come in from the edges (vehicle link, measurement feed, operator). They are
  past-tense facts and carry ``received_s``, the controller's monotonic time of arrival.
* **Decisions** come out of the core: phase changes, estimates, plans, notices.
* **Commands** come out of the core for the vehicle link.

Units and frames as in the package docstring: SI, radians, ENU, AMSL.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Literal

import msgspec

from swarmctl.units import Vector


class Record(msgspec.Struct, frozen=True, tag=True, kw_only=True):
    """Base of everything that can be recorded; ``type`` in JSON is the class's name or tag."""


# --- Observations: vehicle link --------------------------------------------------------


class Observation(Record, frozen=True):
    """A fact that reached the controller.

    Attributes:
        received_s: Controller's monotonic time of arrival, s.
    """

    received_s: float


class VehicleObservation(Observation, frozen=True):
    """A fact about one vehicle.

    Attributes:
        sysid: MAVLink system id.
    """

    sysid: int


class Mode(StrEnum):
    """Flight modes the controller tells apart, whatever the autopilot calls them."""

    GUIDED = "guided"
    LAND = "land"
    RETURN = "return"
    HOLD = "hold"
    OTHER = "other"


class Heartbeat(VehicleObservation, frozen=True):
    """HEARTBEAT of an autopilot.

    Attributes:
        autopilot: ``ardupilot``, ``px4`` or ``other``.
        is_multirotor: Whether MAV_TYPE is a multirotor.
        mode: The flight mode, in this system's terms.
        mode_name: The autopilot's own name or number for it.
        armed: Whether the motors are armed.
        failsafe: Whether the vehicle says that it flies on a failsafe of its own.
        guided_by_stream: Whether guided mode lives on a stream of setpoints: it is entered
            only after some have come, they raise the vehicle from the ground, it is left when
            they stop for about a second, and taken up again by the vehicle when they resume.
    """

    autopilot: Literal["ardupilot", "px4", "other"]
    is_multirotor: bool
    mode: Mode
    mode_name: str
    armed: bool
    failsafe: bool = False
    guided_by_stream: bool = False


class VehiclePosition(VehicleObservation, frozen=True):
    """GLOBAL_POSITION_INT with a usable position (lat = lon = 0 is not reported).

    Attributes:
        boot_s: Vehicle's time since boot of the sample, s.
        epoch_utc_s: The same instant in UTC, s; None until the vehicle's SYSTEM_TIME is known.
        lat_rad: Latitude, rad.
        lon_rad: Longitude, rad.
        alt_amsl_m: Altitude above mean sea level, m.
        velocity_enu: Velocity east, north, up, m/s.
    """

    boot_s: float
    epoch_utc_s: float | None
    lat_rad: float
    lon_rad: float
    alt_amsl_m: float
    velocity_enu: Vector


class VehicleAttitude(VehicleObservation, frozen=True):
    """ATTITUDE, rad (roll right, pitch up, yaw clockwise from north, as on the wire)."""

    boot_s: float
    roll_rad: float
    pitch_rad: float
    yaw_rad: float


class VehicleStatus(VehicleObservation, frozen=True):
    """SYS_STATUS.

    Attributes:
        battery_v: Battery voltage, V; None where the vehicle does not measure it.
        battery_fraction: Charge left, 0..1; None where unknown.
        prearm_ok: Whether the vehicle says it would arm.
    """

    battery_v: float | None
    battery_fraction: float | None
    prearm_ok: bool


class GpsFix(VehicleObservation, frozen=True):
    """GPS_RAW_INT: fix type as in MAVLink (3 = 3-D) and satellites used."""

    fix_type: int
    satellites: int


class HomePosition(VehicleObservation, frozen=True):
    """HOME_POSITION: where the vehicle itself would return to."""

    lat_rad: float
    lon_rad: float
    alt_amsl_m: float


class VehicleClock(VehicleObservation, frozen=True):
    """SYSTEM_TIME: the vehicle's UTC and its time since boot, s, at one instant."""

    utc_s: float
    boot_s: float


class VehicleVersion(VehicleObservation, frozen=True):
    """AUTOPILOT_VERSION: hardware uid and flight software version."""

    uid: int
    flight_sw_version: int


class LandedState(VehicleObservation, frozen=True):
    """EXTENDED_SYS_STATE."""

    state: Literal["on_ground", "taking_off", "in_air", "landing", "unknown"]


class StatusText(VehicleObservation, frozen=True):
    """STATUSTEXT: the vehicle speaks; severity as in MAVLink (0 emergency .. 7 debug)."""

    severity: int
    text: str


class CommandKind(StrEnum):
    """What a command does; the value is the name of its class in :mod:`swarmctl.commands`."""

    REQUEST_HOME = "RequestHome"
    REQUEST_VERSION = "RequestVersion"
    STREAM_TELEMETRY = "StreamTelemetry"
    READ_PARAMETER = "ReadParameter"
    WRITE_PARAMETER = "WriteParameter"
    UPLOAD_FENCE = "UploadFence"
    SET_MODE = "SetMode"
    ARM = "Arm"
    DISARM = "Disarm"
    TAKE_OFF = "TakeOff"
    GO_TO = "GoTo"


class CommandOutcome(VehicleObservation, frozen=True):
    """The end of a command's exchange, once for every acknowledged command sent.

    Attributes:
        command: The kind of the command.
        result: ``accepted``; ``refused`` (the vehicle said no); ``no_answer`` (every try
            went unanswered).
        detail: What the vehicle said, for a person: the MAV_RESULT's name or the tries made.
    """

    command: CommandKind
    result: Literal["accepted", "refused", "no_answer"]
    detail: str


class ParameterValue(VehicleObservation, frozen=True):
    """The end of a parameter's exchange, once for every ReadParameter and WriteParameter.

    Attributes:
        parameter: The name it was asked for by.
        value: Its value as the vehicle tells it; None if the vehicle told none, for unknown
            names are met with silence.
        own_name: What the vehicle calls it: older firmware has other names.
        own_unit: One of the vehicle's units, in those of ``value``.
    """

    parameter: str
    value: float | None
    own_name: str
    own_unit: float = 1.0


class LinkQuality(VehicleObservation, frozen=True):
    """Link statistics of one vehicle, reported once a second.

    Attributes:
        messages_in: Messages taken from this vehicle since the start.
        lost: Messages missing by sequence number since the start.
        rate_hz: Messages a second over the last second.
        rtt_s: Latest round trip of a TIMESYNC, s; None where none was answered.
        boot_offset_s: The vehicle's time since boot less the controller's monotonic time, s.
        boot_offset_error_s: How far that may be off: half the shortest recent round trip, s.
        utc_error_s: How far its time since boot, mapped to UTC by SYSTEM_TIME, may be off, s.
    """

    messages_in: int
    lost: int
    rate_hz: float
    rtt_s: float | None
    boot_offset_s: float | None
    boot_offset_error_s: float | None
    utc_error_s: float | None


class LinkConnection(Observation, frozen=True):
    """A link that connects (TCP, serial) was lost (``connected`` false) or is back.

    Attributes:
        url: The link, as the mission names it.
        connected: Whether it is connected now.
    """

    url: str
    connected: bool


class InputRejected(Observation, frozen=True):
    """Bytes from outside that could not be used: named once per kind, then only counted.

    Attributes:
        source: ``mavlink`` or ``feed``.
        kind: A short stable name of the fault, for example ``bad_crc`` or ``not_json``.
        detail: One sentence: what was wrong with the first of its kind, and where from.
    """

    source: Literal["mavlink", "feed"]
    kind: str
    detail: str


# --- Observations: measurement feed and operator ---------------------------------------


class RangeDifference(msgspec.Struct, frozen=True):
    """One range difference: range(emitter, receiver) - range(emitter, reference).

    Attributes:
        receiver: System id of the companion.
        rd_m: Range difference, m.
        sigma_m: 1-sigma of its noise, m.
    """

    receiver: int
    rd_m: float
    sigma_m: float


class RangeDifferences(Observation, frozen=True):
    """The range differences of one epoch against one reference receiver.

    Attributes:
        epoch_utc_s: Epoch of reception, UTC s.
        reference: System id of the reference receiver.
        items: One entry per companion.
        rho: Share of each variance that comes from the common reference receiver, 0..1.
        clock_sigma_s: 1-sigma of a receiver's clock error at that time, s.
        seq: Sequence number of the message.
    """

    epoch_utc_s: float
    reference: int
    items: tuple[RangeDifference, ...]
    rho: float
    clock_sigma_s: float
    seq: int


class ArrivalTime(Observation, frozen=True):
    """When one receiver heard one burst: ``toa_s + toa_frac_s``, UTC.

    Attributes:
        receiver: System id of the UAV that carries the receiver.
        toa_s: Whole seconds of UTC.
        toa_frac_s: The rest, 0 <= toa_frac_s < 1.
        burst: Number of the burst, the same at every receiver.
        sigma_s: 1-sigma of this arrival time's own error, s.
        clock_sigma_s: 1-sigma of a receiver's clock error at that time, s.
        seq: Sequence number of the message.
    """

    receiver: int
    toa_s: int
    toa_frac_s: float
    burst: int
    sigma_s: float
    clock_sigma_s: float
    seq: int


class FeedConnection(Observation, frozen=True):
    """The broker was lost (``connected`` false) or is back."""

    connected: bool


class EmitterTruth(Observation, frozen=True):
    """True emitter state published by the simulator. Only the recorder and reports see it."""

    epoch_utc_s: float
    lat_rad: float
    lon_rad: float
    alt_amsl_m: float
    velocity_enu: Vector


class ReceiverTruth(Observation, frozen=True):
    """How far off a simulated receiver truly is. Only the recorder and reports see it.

    Attributes:
        epoch_utc_s: When, UTC s.
        receiver: System id of the UAV that carries the receiver.
        clock_m: Error of its clock times the speed of light, m; late stamps are positive.
        drift_mps: Rate of ``clock_m``, m/s.
        navigation_enu: Position its UAV reports less the true one, without the white part that
            is new in every report, m.
    """

    epoch_utc_s: float
    receiver: int
    clock_m: float
    drift_mps: float
    navigation_enu: Vector


class OperatorRequest(Observation, frozen=True):
    """The operator asks: ``return_home`` brings the swarm home and lands it."""

    request: Literal["return_home"]
