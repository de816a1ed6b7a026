"""Frames to messages, against pymavlink and against numbers worked by hand."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.events import (
    GpsFix,
    HomePosition,
    LandedState,
    StatusText,
    VehicleAttitude,
    VehicleClock,
    VehicleStatus,
    VehicleVersion,
)
from swarmctl.link.codec import decoding
from swarmctl.link.codec.framing import split
from swarmctl.link.codec.messages import (
    CommandAck,
    Fault,
    HeartbeatMessage,
    Message,
    MessageId,
    PositionMessage,
)
from tests.link.wire import Sender, frame_by_hand

INT16 = st.integers(-32768, 32767)
INT32 = st.integers(-(2**31), 2**31 - 1)


def read(frame: bytes) -> Message | Fault | None:
    frames, faults = split(frame)
    assert faults == []
    assert [found.raw for found in frames] == [frame]
    return decoding.read(frames[0], 5.0)


def test_a_frame_laid_out_by_hand() -> None:
    payload = struct.pack("<BB", 0, 2)
    message = read(frame_by_hand(245, payload, 130))
    assert message == LandedState(received_s=5.0, sysid=1, state="in_air")


def test_fields_of_a_newer_dialect_at_the_end_are_ignored() -> None:
    payload = struct.pack("<BB", 0, 2) + b"\x07\x08"
    message = read(frame_by_hand(245, payload, 130))
    assert message == LandedState(received_s=5.0, sysid=1, state="in_air")


def test_a_message_nobody_needs_is_not_read() -> None:
    assert read(Sender().pack("RAW_IMU")) is None


def test_heartbeat() -> None:
    armed_quad = read(Sender().heartbeat(mode=4, armed=True))
    assert armed_quad == HeartbeatMessage("ardupilot", True, 4, True, False)
    px4_plane = Sender().heartbeat(mode=0x04030000, autopilot=12, type=1)
    assert read(px4_plane) == HeartbeatMessage("px4", False, 0x04030000, False, False)
    assert read(Sender().heartbeat(autopilot=0)) == HeartbeatMessage("other", True, 4, False, False)


@pytest.mark.parametrize(
    ("system_status", "failsafe"), [(3, False), (4, False), (5, True), (6, True), (8, False)]
)
def test_a_heartbeat_says_whether_it_flies_on_a_failsafe(
    system_status: int, failsafe: bool
) -> None:
    message = read(Sender().heartbeat(system_status=system_status))
    assert isinstance(message, HeartbeatMessage)
    assert message.failsafe is failsafe


@pytest.mark.parametrize("fields", [{"type": 6}, {"type": 30, "autopilot": 8}], ids=str)
def test_heartbeat_of_no_flight_controller(fields: dict[str, Any]) -> None:
    assert read(Sender().heartbeat(**fields)) is None


@pytest.mark.parametrize(("mav_type", "expected"), [(2, True), (13, True), (14, True), (4, False)])
def test_multirotors(mav_type: int, expected: bool) -> None:
    message = read(Sender().heartbeat(type=mav_type))
    assert isinstance(message, HeartbeatMessage)
    assert message.is_multirotor is expected


def test_position_with_numbers_worked_by_hand() -> None:
    # 45 degrees are pi/4, -90 degrees -pi/2. North 1 m/s, east -2 m/s, down 3 m/s.
    message = read(
        Sender().pack(
            "GLOBAL_POSITION_INT",
            time_boot_ms=123_456,
            lat=450_000_000,
            lon=-900_000_000,
            alt=-12_345,
            relative_alt=99_000,
            vx=100,
            vy=-200,
            vz=300,
        )
    )
    assert isinstance(message, PositionMessage)
    assert message.boot_s == 123.456
    assert message.lat_rad == pytest.approx(0.785_398_163_397_448_3, abs=1e-15)
    assert message.lon_rad == pytest.approx(-1.570_796_326_794_896_6, abs=1e-15)
    assert message.alt_amsl_m == -12.345
    assert message.velocity_enu == (-2.0, 1.0, -3.0)


@given(
    boot_ms=st.integers(0, 2**32 - 1),
    lat=st.integers(-900_000_000, 900_000_000),
    lon=st.integers(1, 1_800_000_000),
    alt=st.integers(-100_000_000, 100_000_000),
    velocity=st.tuples(INT16, INT16, INT16),
)
def test_every_plausible_position_is_taken(
    boot_ms: int, lat: int, lon: int, alt: int, velocity: tuple[int, int, int]
) -> None:
    north, east, down = velocity
    message = read(
        Sender().pack(
            "GLOBAL_POSITION_INT",
            time_boot_ms=boot_ms,
            lat=lat,
            lon=lon,
            alt=alt,
            vx=north,
            vy=east,
            vz=down,
        )
    )
    assert isinstance(message, PositionMessage)
    assert round(message.boot_s * 1000) == boot_ms
    assert round(math.degrees(message.lat_rad) * 1e7) == lat
    assert round(math.degrees(message.lon_rad) * 1e7) == lon
    assert round(message.alt_amsl_m * 1000) == alt
    assert [round(speed * 100) for speed in message.velocity_enu] == [east, north, -down]


@pytest.mark.parametrize(
    "fields",
    [{"lat": 900_000_001}, {"lat": -(2**31)}, {"lon": 1_800_000_001}, {"alt": 2**31 - 1}],
    ids=str,
)
@pytest.mark.parametrize("name", ["GLOBAL_POSITION_INT", "HOME_POSITION"])
def test_a_position_out_of_range_is_a_fault(name: str, fields: dict[str, int]) -> None:
    sound = {"lat": 1, "lon": 1, "alt": 1} | fields
    if name == "HOME_POSITION":
        sound = dict(zip(("latitude", "longitude", "altitude"), sound.values(), strict=True))
        fault = read(Sender().pack(name, **sound))
    else:
        fault = read(Sender().pack(name, **sound))
    assert isinstance(fault, Fault)
    assert fault.kind == "implausible"
    assert name in fault.detail
    assert str(next(iter(fields.values()))) in fault.detail


def test_a_position_not_known_yet_is_no_position() -> None:
    assert read(Sender().pack("GLOBAL_POSITION_INT", time_boot_ms=9, alt=500)) is None
    assert read(Sender().pack("HOME_POSITION", altitude=500)) is None


@pytest.mark.parametrize(
    ("lat", "lon"),
    [
        (0, 1),
        (1, 0),
        (900_000_000, 0),
        (-900_000_000, 0),
        (0, 1_800_000_000),
        (0, -1_800_000_000),
    ],
)
def test_equator_prime_meridian_poles_and_date_line_are_positions(lat: int, lon: int) -> None:
    position = read(Sender().pack("GLOBAL_POSITION_INT", lat=lat, lon=lon))
    assert isinstance(position, PositionMessage)
    home = read(Sender().pack("HOME_POSITION", latitude=lat, longitude=lon))
    assert isinstance(home, HomePosition)


def test_home_position() -> None:
    frame = Sender().pack(
        "HOME_POSITION", latitude=300_000_000, longitude=-600_000_000, altitude=51_200
    )
    message = read(frame)
    assert isinstance(message, HomePosition)
    assert (message.sysid, message.received_s, message.alt_amsl_m) == (1, 5.0, 51.2)
    assert message.lat_rad == pytest.approx(math.pi / 6, abs=1e-15)
    assert message.lon_rad == pytest.approx(-math.pi / 3, abs=1e-15)


def test_attitude() -> None:
    frame = Sender().pack("ATTITUDE", time_boot_ms=2500, roll=0.5, pitch=-0.25, yaw=3.0)
    assert read(frame) == VehicleAttitude(
        received_s=5.0, sysid=1, boot_s=2.5, roll_rad=0.5, pitch_rad=-0.25, yaw_rad=3.0
    )


@pytest.mark.parametrize("field", ["roll", "pitch", "yaw"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_an_attitude_that_is_no_number_is_a_fault(field: str, value: float) -> None:
    fault = read(Sender().pack("ATTITUDE", **{field: value}))
    assert isinstance(fault, Fault)
    assert fault.kind == "implausible"


@pytest.mark.parametrize(
    ("voltage", "remaining", "health", "expected"),
    [
        (12_600, 87, 1 << 28, (12.6, 0.87, True)),
        (65_535, -1, ~(1 << 28) & 0xFFFFFFFF, (None, None, False)),
        (0, 101, 0, (None, None, False)),
        (1, 0, 0, (0.001, 0.0, False)),
        (65_534, 100, 0, (65.534, 1.0, False)),
    ],
)
def test_sys_status(
    voltage: int, remaining: int, health: int, expected: tuple[float | None, float | None, bool]
) -> None:
    frame = Sender().pack(
        "SYS_STATUS",
        voltage_battery=voltage,
        battery_remaining=remaining,
        onboard_control_sensors_health=health,
    )
    battery_v, battery_fraction, prearm_ok = expected
    assert read(frame) == VehicleStatus(
        received_s=5.0,
        sysid=1,
        battery_v=battery_v,
        battery_fraction=battery_fraction,
        prearm_ok=prearm_ok,
    )


def test_system_time() -> None:
    frame = Sender().pack("SYSTEM_TIME", time_unix_usec=1_790_000_000_250_000, time_boot_ms=61_500)
    assert read(frame) == VehicleClock(received_s=5.0, sysid=1, utc_s=1_790_000_000.25, boot_s=61.5)


def test_system_time_not_known_yet() -> None:
    assert read(Sender().pack("SYSTEM_TIME", time_unix_usec=0, time_boot_ms=500)) is None


@pytest.mark.parametrize("utc_usec", [1, 61_500_000, 2**64 - 1])
def test_system_time_of_another_century_is_a_fault(utc_usec: int) -> None:
    fault = read(Sender().pack("SYSTEM_TIME", time_unix_usec=utc_usec))
    assert isinstance(fault, Fault)
    assert fault.kind == "implausible"


@pytest.mark.parametrize(("satellites", "expected"), [(12, 12), (0, 0), (255, 0)])
def test_gps_raw_int(satellites: int, expected: int) -> None:
    frame = Sender().pack("GPS_RAW_INT", fix_type=3, satellites_visible=satellites)
    assert read(frame) == GpsFix(received_s=5.0, sysid=1, fix_type=3, satellites=expected)


@pytest.mark.parametrize(
    ("wire", "state"),
    [
        (0, "unknown"),
        (1, "on_ground"),
        (2, "in_air"),
        (3, "taking_off"),
        (4, "landing"),
        (9, "unknown"),
    ],
)
def test_extended_sys_state(wire: int, state: str) -> None:
    message = read(Sender().pack("EXTENDED_SYS_STATE", landed_state=wire))
    assert isinstance(message, LandedState)
    assert message.state == state


def test_autopilot_version() -> None:
    frame = Sender().pack(
        "AUTOPILOT_VERSION", uid=0xFEDC_BA98_7654_3210, flight_sw_version=0x04_07_00_00
    )
    assert read(frame) == VehicleVersion(
        received_s=5.0, sysid=1, uid=0xFEDC_BA98_7654_3210, flight_sw_version=0x04_07_00_00
    )


@pytest.mark.parametrize(
    ("wire", "text"),
    [
        (b"Arm: Need Position Estimate", "Arm: Need Position Estimate"),
        (b"x" * 50, "x" * 50),
        (b"cut\0here", "cut"),
        (b"", ""),
        (b"\x1b[2Jgone", "?[2Jgone"),
        (b"bad \xff byte", "bad \N{REPLACEMENT CHARACTER} byte"),
    ],
)
def test_statustext(wire: bytes, text: str) -> None:
    assert read(Sender().pack("STATUSTEXT", severity=2, text=wire)) == StatusText(
        received_s=5.0, sysid=1, severity=2, text=text
    )


@pytest.mark.parametrize(
    ("wire", "result"), [(0, "ACCEPTED"), (2, "DENIED"), (5, "IN_PROGRESS"), (77, "MAV_RESULT 77")]
)
def test_command_ack(wire: int, result: str) -> None:
    frame = Sender().pack("COMMAND_ACK", command=400, result=wire, target_system=255)
    assert read(frame) == CommandAck(400, result, 255)


def test_command_ack_of_mavlink_1_names_no_target() -> None:
    frame = frame_by_hand(77, struct.pack("<HB", 400, 4), 143)
    assert read(frame) == CommandAck(400, "FAILED", 0)


@given(st.sampled_from(sorted(mavlink.mavlink_map)), st.binary(max_size=255))
def test_any_payload_under_a_right_checksum_never_raises(message_id: int, payload: bytes) -> None:
    frame = frame_by_hand(message_id, payload, mavlink.mavlink_map[message_id].crc_extra)
    frames, faults = split(frame)
    assert (len(frames), faults) == (1, [])
    decoding.read(frames[0], 0.0)


@pytest.mark.parametrize("message_id", MessageId)
@given(payload=st.binary(max_size=255))
def test_any_payload_of_a_message_we_read_never_raises(message_id: int, payload: bytes) -> None:
    frame = frame_by_hand(message_id, payload, mavlink.mavlink_map[message_id].crc_extra)
    message = read(frame)
    if isinstance(message, PositionMessage):
        assert abs(message.lat_rad) <= math.pi / 2
        assert abs(message.lon_rad) <= math.pi
