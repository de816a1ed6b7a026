"""What a vehicle is told: the commands that go from the core to the vehicle link.

All are frozen and JSON-encodable, as :mod:`swarmctl.events` says of every record.
"""

from __future__ import annotations

from swarmctl.events import CommandKind, Mode, Record
from swarmctl.units import Vector


class Command(Record, frozen=True):
    """Something a vehicle is told.

    Attributes:
        sysid: MAVLink system id of the vehicle.
    """

    sysid: int

    @property
    def kind(self) -> CommandKind:
        """What it does: the name by which its outcome is known."""
        return CommandKind(type(self).__name__)


class Inquiry(Command, frozen=True):
    """A command that only asks for information: it changes nothing about the flight."""


class RequestHome(Inquiry, frozen=True):
    """Ask for HOME_POSITION once; acknowledged."""


class RequestVersion(Inquiry, frozen=True):
    """Ask for AUTOPILOT_VERSION once; acknowledged."""


class StreamTelemetry(Inquiry, frozen=True):
    """Ask for the telemetry the controller needs: every interval acknowledged, one outcome.

    Attributes:
        position_hz: Rate of GLOBAL_POSITION_INT, Hz; the slow messages follow at 1-2 Hz.
    """

    position_hz: float


class ReadParameter(Command, frozen=True):
    """Ask for a parameter by its newest name and unit; ends in a ParameterValue."""

    parameter: str


class WriteParameter(Command, frozen=True):
    """Set a parameter, by its newest name and unit; ends in a ParameterValue, read back."""

    parameter: str
    value: float


class UploadFence(Command, frozen=True):
    """Give the vehicle a circle to stay in, in place of any fence it had; read back.

    Attributes:
        lat_rad: Latitude of the centre, rad.
        lon_rad: Longitude of the centre, rad.
        radius_m: Radius, m.
    """

    lat_rad: float
    lon_rad: float
    radius_m: float


class SetMode(Command, frozen=True):
    """Switch the flight mode; acknowledged."""

    mode: Mode


class Arm(Command, frozen=True):
    """Arm the motors; acknowledged."""


class Disarm(Command, frozen=True):
    """Disarm the motors on the ground; acknowledged."""


class TakeOff(Command, frozen=True):
    """Climb to an altitude above the launch point; acknowledged.

    A vehicle that is guided by a stream is raised by its setpoints instead.
    """

    alt_amsl_m: float


class GoTo(Command, frozen=True):
    """Position setpoint with velocity feed-forward, streamed; never acknowledged.

    Attributes:
        lat_rad: Latitude, rad.
        lon_rad: Longitude, rad.
        alt_amsl_m: Altitude above mean sea level, m.
        velocity_enu: Velocity of the setpoint east, north, up, m/s.
    """

    lat_rad: float
    lon_rad: float
    alt_amsl_m: float
    velocity_enu: Vector
