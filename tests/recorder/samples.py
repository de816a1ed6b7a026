"""One record of every kind, and a small flight with known figures."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

import msgspec

from swarmctl import commands, decisions, events
from swarmctl.events import Record
from swarmctl.results import MissionResult

R = TypeVar("R", bound=Record)


def record_types(base: type[R]) -> Iterator[type[R]]:
    """All record classes that are recorded: the leaves of the tree."""
    subclasses = base.__subclasses__()
    if not subclasses:
        yield base
    for subclass in subclasses:
        yield from record_types(subclass)


VECTOR = (1.5, -2.5, 0.25)

ONE_OF_EACH: tuple[Record, ...] = (
    events.Heartbeat(
        received_s=1.0, sysid=3, autopilot="ardupilot", is_multirotor=True,
        mode=events.Mode.GUIDED, mode_name="GUIDED", armed=True,
    ),
    events.VehiclePosition(
        received_s=1.0, sysid=3, boot_s=60.0, epoch_utc_s=None, lat_rad=0.8, lon_rad=0.1,
        alt_amsl_m=120.0, velocity_enu=VECTOR,
    ),
    events.VehicleAttitude(
        received_s=1.0, sysid=3, boot_s=60.0, roll_rad=0.1, pitch_rad=0.2, yaw_rad=0.3
    ),
    events.VehicleStatus(
        received_s=1.0, sysid=3, battery_v=15.9, battery_fraction=None, prearm_ok=True
    ),
    events.GpsFix(received_s=1.0, sysid=3, fix_type=3, satellites=14),
    events.HomePosition(received_s=1.0, sysid=3, lat_rad=0.8, lon_rad=0.1, alt_amsl_m=40.0),
    events.VehicleClock(received_s=1.0, sysid=3, utc_s=1.79e9, boot_s=60.0),
    events.VehicleVersion(received_s=1.0, sysid=3, uid=2**63 + 5, flight_sw_version=0x04060000),
    events.LandedState(received_s=1.0, sysid=3, state="in_air"),
    events.StatusText(received_s=1.0, sysid=3, severity=4, text="Größe, \"quoted\""),
    events.CommandOutcome(
        received_s=1.0, sysid=3, command=events.CommandKind.ARM, result="accepted", detail="-"
    ),
    events.LinkQuality(
        received_s=1.0, sysid=3, messages_in=100, lost=1, rate_hz=20.0, rtt_s=0.06,
        boot_offset_s=-3.5, boot_offset_error_s=0.02, utc_error_s=None,
    ),
    events.LinkConnection(received_s=1.0, url="tcp://10.0.0.1:5760", connected=False),
    events.ParameterValue(
        received_s=1.0, sysid=3, parameter="RTL_ALT_M", value=None, own_name="RTL_ALT_M",
    ),
    events.InputRejected(received_s=1.0, source="feed", kind="not_json", detail="Bytes."),
    events.RangeDifferences(
        received_s=1.0, epoch_utc_s=1.79e9, reference=1,
        items=(events.RangeDifference(receiver=2, rd_m=-12.0, sigma_m=3.0),),
        rho=0.5, clock_sigma_s=1e-9, seq=4,
    ),
    events.ArrivalTime(
        received_s=1.0, receiver=3, toa_s=1_790_000_012, toa_frac_s=0.350_007_421_9, burst=5,
        sigma_s=7e-9, clock_sigma_s=1e-9, seq=4,
    ),
    events.FeedConnection(received_s=1.0, connected=False),
    events.EmitterTruth(
        received_s=1.0, epoch_utc_s=1.79e9, lat_rad=0.8, lon_rad=0.1, alt_amsl_m=0.0,
        velocity_enu=VECTOR,
    ),
    events.ReceiverTruth(
        received_s=1.0, epoch_utc_s=1.79e9, receiver=2, clock_m=4.5, drift_mps=0.06,
        navigation_enu=VECTOR,
    ),
    events.OperatorRequest(received_s=1.0, request="return_home"),
    commands.RequestHome(sysid=3),
    commands.RequestVersion(sysid=3),
    commands.StreamTelemetry(sysid=3, position_hz=10.0),
    commands.ReadParameter(sysid=3, parameter="RTL_ALT_M"),
    commands.WriteParameter(sysid=3, parameter="RTL_ALT_M", value=40.0),
    commands.UploadFence(sysid=3, lat_rad=0.9, lon_rad=0.1, radius_m=4030.0),
    commands.SetMode(sysid=3, mode=events.Mode.RETURN),
    commands.Arm(sysid=3),
    commands.Disarm(sysid=3),
    commands.TakeOff(sysid=3, alt_amsl_m=120.0),
    commands.GoTo(sysid=3, lat_rad=0.8, lon_rad=0.1, alt_amsl_m=120.0, velocity_enu=VECTOR),
    decisions.PhaseChanged(at_s=1.0, phase="observe", trigger="formed", reason="All in place."),
    decisions.EstimateMade(
        at_s=1.0, epoch_utc_s=1.79e9, position_enu=VECTOR, velocity_enu=VECTOR,
        covariance=tuple(float(k) for k in range(36)), nis=3.2, rd_count=3,
    ),
    decisions.ReceiverEstimate(
        at_s=1.0, epoch_utc_s=1.79e9, receiver=2, relative_to=1, clock_m=4.5, clock_sigma_m=1.2,
        drift_mps=0.06, drift_sigma_mps=0.01, navigation_enu=VECTOR, navigation_sigma_enu=VECTOR,
    ),
    decisions.HealthChanged(at_s=1.0, status="tracking", cause=None, detail="All is well."),
    decisions.HealthChanged(at_s=1.0, status="degraded", cause="noise", detail="A sentence."),
    decisions.Plan(
        at_s=1.0, reference=1, los_rad=0.5, formed=True,
        slots=(
            decisions.Slot(
                sysid=1, position_enu=VECTOR, velocity_enu=VECTOR, error_m=None,
                range_to_reference_m=None, joined=True,
            ),
            decisions.Slot(
                sysid=2, position_enu=VECTOR, velocity_enu=VECTOR, error_m=1.5,
                range_to_reference_m=200.0, joined=False,
            ),
        ),
    ),
    decisions.Notice(at_s=1.0, level="warning", text="A sentence."),
    decisions.MissionEnded(at_s=1.0, result=MissionResult.LOCATED, detail="Within 3 m."),
)  # fmt: skip


def again(record: Record) -> Record:
    """The record after a trip through JSON."""
    return msgspec.json.decode(msgspec.json.encode(record), type=type(record))
