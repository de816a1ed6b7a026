"""Commands to frames, read again by pymavlink and against numbers worked by hand."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.commands import GoTo
from swarmctl.link.codec.encoding import Encoder
from swarmctl.link.codec.messages import CommandLong, MavCmd
from tests.link.wire import unpack


def test_our_heartbeat() -> None:
    message = unpack(Encoder(245).heartbeat())
    assert message.get_type() == "HEARTBEAT"
    assert (message.get_srcSystem(), message.get_srcComponent()) == (245, 190)
    assert message.type == mavlink.MAV_TYPE_GCS
    assert message.autopilot == mavlink.MAV_AUTOPILOT_INVALID


def test_sequence_numbers_are_consecutive() -> None:
    encoder = Encoder(255)
    assert [unpack(encoder.heartbeat()).get_seq() for _ in range(258)] == [*range(256), 0, 1]


def test_command_long() -> None:
    command = CommandLong(MavCmd.DO_SET_MODE, (1.0, 4.0))
    message = unpack(Encoder(255).command_long(7, command, 2))
    assert message.get_type() == "COMMAND_LONG"
    assert (message.target_system, message.target_component) == (7, 1)
    assert (message.command, message.confirmation) == (176, 2)
    params = [getattr(message, f"param{n}") for n in range(1, 8)]
    assert params == [1.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0]


def goto(
    *,
    lat_rad: float = 0.8,
    lon_rad: float = 0.1,
    alt_amsl_m: float = 120.5,
    velocity_enu: tuple[float, float, float] = (1.5, -2.5, 0.5),
) -> GoTo:
    return GoTo(
        sysid=9, lat_rad=lat_rad, lon_rad=lon_rad, alt_amsl_m=alt_amsl_m, velocity_enu=velocity_enu
    )


def test_setpoint_with_numbers_worked_by_hand() -> None:
    frame = Encoder(255).setpoint(goto(lat_rad=math.pi / 4, lon_rad=-math.pi / 3), 12.3456)
    assert frame is not None
    message = unpack(frame)
    assert message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT"
    assert (message.target_system, message.target_component) == (9, 1)
    assert message.time_boot_ms == 12_345
    assert message.coordinate_frame == 5  # MAV_FRAME_GLOBAL_INT: altitude above mean sea level
    assert message.type_mask == 3520
    assert (message.lat_int, message.lon_int, message.alt) == (450_000_000, -600_000_000, 120.5)
    assert (message.vx, message.vy, message.vz) == (-2.5, 1.5, -0.5)  # north, east, down
    unused = (message.afx, message.afy, message.afz, message.yaw, message.yaw_rate)
    assert unused == (0.0, 0.0, 0.0, 0.0, 0.0)


@given(
    lat_deg=st.floats(-90.0, 90.0),
    lon_deg=st.floats(-180.0, 180.0),
    alt_amsl_m=st.floats(-500.0, 9000.0, width=32),
    velocity_enu=st.tuples(*[st.floats(-30.0, 30.0, width=32)] * 3),
)
def test_every_setpoint_arrives_to_half_a_unit_of_the_wire(
    lat_deg: float, lon_deg: float, alt_amsl_m: float, velocity_enu: tuple[float, float, float]
) -> None:
    command = goto(
        lat_rad=math.radians(lat_deg),
        lon_rad=math.radians(lon_deg),
        alt_amsl_m=alt_amsl_m,
        velocity_enu=velocity_enu,
    )
    frame = Encoder(255).setpoint(command, 0.0)
    assert frame is not None
    message = unpack(frame)
    assert message.lat_int == pytest.approx(lat_deg * 1e7, abs=0.5 + 1e-6)
    assert message.lon_int == pytest.approx(lon_deg * 1e7, abs=0.5 + 1e-6)
    assert message.alt == alt_amsl_m
    assert (message.vy, message.vx, -message.vz) == velocity_enu


def test_time_since_boot_wraps_as_on_the_wire() -> None:
    frame = Encoder(255).setpoint(goto(), 2**32 / 1000 + 1.0)
    assert frame is not None
    assert unpack(frame).time_boot_ms == 1000


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300])
def test_a_setpoint_that_is_no_number_never_leaves(value: float) -> None:
    encoder = Encoder(255)
    assert encoder.setpoint(goto(lat_rad=value), 0.0) is None
    assert encoder.setpoint(goto(lon_rad=value), 0.0) is None
    assert encoder.setpoint(goto(alt_amsl_m=value), 0.0) is None
    for axis in range(3):
        velocity = [0.0, 0.0, 0.0]
        velocity[axis] = value
        command = goto(velocity_enu=(velocity[0], velocity[1], velocity[2]))
        assert encoder.setpoint(command, 0.0) is None
    assert unpack(encoder.heartbeat()).get_seq() == 0
