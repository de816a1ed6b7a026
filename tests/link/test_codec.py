"""Bytes to facts and commands to bytes, against pymavlink and against numbers worked by hand."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.events import (
    GoTo,
    GpsFix,
    HomePosition,
    LandedState,
    StatusText,
    VehicleAttitude,
    VehicleClock,
    VehicleStatus,
    VehicleVersion,
)
from swarmctl.link import codec
from swarmctl.link.facts import (
    CommandAck,
    CommandLong,
    Fact,
    Fault,
    Frame,
    HeartbeatFact,
    MavCmd,
    MessageId,
    PositionFact,
)
from tests.link.wire import Sender, frame_by_hand, unpack

INT16 = st.integers(-32768, 32767)
INT32 = st.integers(-(2**31), 2**31 - 1)


def read(frame: bytes) -> Fact | Fault | None:
    frames, faults = codec.split(frame)
    assert faults == []
    assert [found.raw for found in frames] == [frame]
    return codec.read(frames[0], 5.0)


def kinds(datagram: bytes) -> list[str]:
    return [fault.kind for fault in codec.split(datagram)[1]]


def known(datagram: bytes) -> list[bytes]:
    return [
        frame.raw for frame in codec.split(datagram)[0] if frame.message_id in mavlink.mavlink_map
    ]


# --- Names and numbers -----------------------------------------------------------------


@pytest.mark.parametrize("command", MavCmd)
def test_command_numbers_are_mavlinks(command: MavCmd) -> None:
    assert getattr(mavlink, f"MAV_CMD_{command.name}") == command


@pytest.mark.parametrize("message_id", MessageId)
def test_message_numbers_are_mavlinks(message_id: MessageId) -> None:
    assert mavlink.mavlink_map[message_id].msgname == message_id.name


# --- Frames ----------------------------------------------------------------------------


def test_header_of_both_versions() -> None:
    sender = Sender(sysid=7, compid=9)
    sender.mav.seq = 41
    one = sender.pack_v1("ATTITUDE", roll=1.0)
    two = sender.pack("ATTITUDE", roll=1.0)
    frames, faults = codec.split(one + two)
    assert faults == []
    # MAVLink 1 carries the whole payload of 28 bytes, MAVLink 2 cuts trailing zeros.
    payload = struct.pack("<If", 0, 1.0)
    assert frames == [
        Frame(one, 7, 9, 41, 30, payload + bytes(20)),
        Frame(two, 7, 9, 42, 30, payload),
    ]


def test_a_frame_laid_out_by_hand() -> None:
    payload = struct.pack("<BB", 0, 2)
    fact = read(frame_by_hand(245, payload, 130))
    assert fact == LandedState(received_s=5.0, sysid=1, state="in_air")


def test_fields_of_a_newer_dialect_at_the_end_are_ignored() -> None:
    payload = struct.pack("<BB", 0, 2) + b"\x07\x08"
    fact = read(frame_by_hand(245, payload, 130))
    assert fact == LandedState(received_s=5.0, sysid=1, state="in_air")


def test_a_signed_frame_is_taken_whole() -> None:
    sender = Sender()
    sender.mav.signing.secret_key = bytes(32)
    sender.mav.signing.sign_outgoing = True
    signed = sender.heartbeat()
    plain = Sender().heartbeat()
    assert len(signed) == len(plain) + 13
    assert known(signed + plain) == [signed, plain]


@given(st.lists(st.sampled_from(["HEARTBEAT", "ATTITUDE", "STATUSTEXT", "RAW_IMU"]), max_size=5))
def test_every_message_of_a_datagram_is_found(names: list[str]) -> None:
    sender = Sender()
    frames = [
        sender.pack(name, **({"text": b"x"} if name == "STATUSTEXT" else {})) for name in names
    ]
    assert known(b"".join(frames)) == frames


def test_an_unknown_message_between_frames_counts_but_says_nothing() -> None:
    unknown = frame_by_hand(99_999, b"new", 0, seq=3)
    good = Sender().heartbeat()
    frames, faults = codec.split(good + unknown + good)
    assert [frame.raw for frame in frames] == [good, unknown, good]
    assert faults == []
    fault = codec.read(frames[1], 5.0)
    assert isinstance(fault, Fault)
    assert (fault.kind, frames[1].seq) == ("unknown_message", 3)
    assert "99999" in fault.detail


def test_a_message_nobody_needs_is_not_read() -> None:
    assert read(Sender().pack("RAW_IMU")) is None


# --- Facts -----------------------------------------------------------------------------


def test_heartbeat() -> None:
    armed_quad = read(Sender().heartbeat(mode=4, armed=True))
    assert armed_quad == HeartbeatFact("ardupilot", True, 4, True, False)
    px4_plane = Sender().heartbeat(mode=0x04030000, autopilot=12, type=1)
    assert read(px4_plane) == HeartbeatFact("px4", False, 0x04030000, False, False)
    assert read(Sender().heartbeat(autopilot=0)) == HeartbeatFact("other", True, 4, False, False)


@pytest.mark.parametrize(
    ("system_status", "failsafe"), [(3, False), (4, False), (5, True), (6, True), (8, False)]
)
def test_a_heartbeat_says_whether_it_flies_on_a_failsafe(
    system_status: int, failsafe: bool
) -> None:
    fact = read(Sender().heartbeat(system_status=system_status))
    assert isinstance(fact, HeartbeatFact)
    assert fact.failsafe is failsafe


@pytest.mark.parametrize("fields", [{"type": 6}, {"type": 30, "autopilot": 8}], ids=str)
def test_heartbeat_of_no_flight_controller(fields: dict[str, Any]) -> None:
    assert read(Sender().heartbeat(**fields)) is None


@pytest.mark.parametrize(("mav_type", "expected"), [(2, True), (13, True), (14, True), (4, False)])
def test_multirotors(mav_type: int, expected: bool) -> None:
    fact = read(Sender().heartbeat(type=mav_type))
    assert isinstance(fact, HeartbeatFact)
    assert fact.is_multirotor is expected


def test_position_with_numbers_worked_by_hand() -> None:
    # 45 degrees are pi/4, -90 degrees -pi/2. North 1 m/s, east -2 m/s, down 3 m/s.
    fact = read(
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
    assert isinstance(fact, PositionFact)
    assert fact.boot_s == 123.456
    assert fact.lat_rad == pytest.approx(0.785_398_163_397_448_3, abs=1e-15)
    assert fact.lon_rad == pytest.approx(-1.570_796_326_794_896_6, abs=1e-15)
    assert fact.alt_amsl_m == -12.345
    assert fact.velocity_enu == (-2.0, 1.0, -3.0)


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
    fact = read(
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
    assert isinstance(fact, PositionFact)
    assert round(fact.boot_s * 1000) == boot_ms
    assert round(math.degrees(fact.lat_rad) * 1e7) == lat
    assert round(math.degrees(fact.lon_rad) * 1e7) == lon
    assert round(fact.alt_amsl_m * 1000) == alt
    assert [round(speed * 100) for speed in fact.velocity_enu] == [east, north, -down]


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
    assert isinstance(position, PositionFact)
    home = read(Sender().pack("HOME_POSITION", latitude=lat, longitude=lon))
    assert isinstance(home, HomePosition)


def test_home_position() -> None:
    frame = Sender().pack(
        "HOME_POSITION", latitude=300_000_000, longitude=-600_000_000, altitude=51_200
    )
    fact = read(frame)
    assert isinstance(fact, HomePosition)
    assert (fact.sysid, fact.received_s, fact.alt_amsl_m) == (1, 5.0, 51.2)
    assert fact.lat_rad == pytest.approx(math.pi / 6, abs=1e-15)
    assert fact.lon_rad == pytest.approx(-math.pi / 3, abs=1e-15)


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
    fact = read(Sender().pack("EXTENDED_SYS_STATE", landed_state=wire))
    assert isinstance(fact, LandedState)
    assert fact.state == state


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


# --- Corrupt input ---------------------------------------------------------------------

GOOD = Sender().pack("GLOBAL_POSITION_INT", time_boot_ms=1, lat=471_234_567, lon=82_345_678, hdg=9)
OTHER = Sender(sysid=2).pack(
    "ATTITUDE", time_boot_ms=77, roll=0.1, pitch=0.2, yaw=0.3, yawspeed=1.0
)


def test_kinds_of_faults() -> None:
    assert kinds(b"") == ["not_mavlink"]
    assert kinds(b"GET / HTTP/1.1") == ["not_mavlink"]
    assert kinds(GOOD[:5]) == ["truncated"]
    assert kinds(GOOD[:-1]) == ["truncated"]
    assert kinds(b"\xfe\x09\x00") == ["truncated"]
    assert kinds(GOOD[:-1] + bytes((GOOD[-1] ^ 1,))) == ["bad_crc"]
    assert kinds(GOOD[:2] + b"\x04" + GOOD[3:]) == ["unsupported_flags"]
    assert kinds(frame_by_hand(99_999, b"new", 0) + b"junk") == ["unknown_message"]


def test_a_corrupt_stretch_is_one_fault() -> None:
    assert kinds(b"\xfejunk\xfdjunk\xfejunk" + GOOD + b"\xfd") == ["truncated", "truncated"]


@pytest.mark.parametrize("length", range(1, len(GOOD)))
def test_the_part_behind_a_truncated_frame_is_taken(length: int) -> None:
    assert known(OTHER + GOOD[:length] + OTHER) == [OTHER, OTHER]
    assert known(OTHER + GOOD[:length]) == [OTHER]
    assert known(OTHER) == [OTHER]


@given(st.integers(0, len(GOOD) - 1), st.integers(1, 255))
def test_the_parts_around_a_corrupt_byte_are_taken(place: int, mask: int) -> None:
    corrupt = bytearray(GOOD)
    corrupt[place] ^= mask
    assert known(OTHER + corrupt + OTHER) == [OTHER, OTHER]


@given(st.binary(max_size=400))
def test_random_bytes_never_raise(data: bytes) -> None:
    frames, faults = codec.split(data)
    assert faults or frames
    for frame in frames:
        codec.read(frame, 0.0)
    assert known(OTHER) == [OTHER]


@given(st.sampled_from(sorted(mavlink.mavlink_map)), st.binary(max_size=255))
def test_any_payload_under_a_right_checksum_never_raises(message_id: int, payload: bytes) -> None:
    frame = frame_by_hand(message_id, payload, mavlink.mavlink_map[message_id].crc_extra)
    frames, faults = codec.split(frame)
    assert (len(frames), faults) == (1, [])
    codec.read(frames[0], 0.0)


@pytest.mark.parametrize("message_id", MessageId)
@given(payload=st.binary(max_size=255))
def test_any_payload_of_a_message_we_read_never_raises(message_id: int, payload: bytes) -> None:
    frame = frame_by_hand(message_id, payload, mavlink.mavlink_map[message_id].crc_extra)
    fact = read(frame)
    if isinstance(fact, PositionFact):
        assert abs(fact.lat_rad) <= math.pi / 2
        assert abs(fact.lon_rad) <= math.pi


def test_a_datagram_full_of_start_markers_is_given_up() -> None:
    # Each marker could cost a checksum; a sound frame behind 30 of them is found, behind 3000 not.
    assert known(b"\xfe" * 30 + GOOD) == [GOOD]
    assert known(b"\xfe" * 3000 + GOOD) == []


# --- Sending ---------------------------------------------------------------------------


def test_our_heartbeat() -> None:
    message = unpack(codec.Encoder(245).heartbeat())
    assert message.get_type() == "HEARTBEAT"
    assert (message.get_srcSystem(), message.get_srcComponent()) == (245, 190)
    assert message.type == mavlink.MAV_TYPE_GCS
    assert message.autopilot == mavlink.MAV_AUTOPILOT_INVALID


def test_sequence_numbers_are_consecutive() -> None:
    encoder = codec.Encoder(255)
    assert [unpack(encoder.heartbeat()).get_seq() for _ in range(258)] == [*range(256), 0, 1]


def test_command_long() -> None:
    command = CommandLong(MavCmd.DO_SET_MODE, (1.0, 4.0))
    message = unpack(codec.Encoder(255).command_long(7, command, 2))
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
    frame = codec.Encoder(255).setpoint(goto(lat_rad=math.pi / 4, lon_rad=-math.pi / 3), 12.3456)
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
    frame = codec.Encoder(255).setpoint(command, 0.0)
    assert frame is not None
    message = unpack(frame)
    assert message.lat_int == pytest.approx(lat_deg * 1e7, abs=0.5 + 1e-6)
    assert message.lon_int == pytest.approx(lon_deg * 1e7, abs=0.5 + 1e-6)
    assert message.alt == alt_amsl_m
    assert (message.vy, message.vx, -message.vz) == velocity_enu


def test_time_since_boot_wraps_as_on_the_wire() -> None:
    frame = codec.Encoder(255).setpoint(goto(), 2**32 / 1000 + 1.0)
    assert frame is not None
    assert unpack(frame).time_boot_ms == 1000


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300])
def test_a_setpoint_that_is_no_number_never_leaves(value: float) -> None:
    encoder = codec.Encoder(255)
    assert encoder.setpoint(goto(lat_rad=value), 0.0) is None
    assert encoder.setpoint(goto(lon_rad=value), 0.0) is None
    assert encoder.setpoint(goto(alt_amsl_m=value), 0.0) is None
    for axis in range(3):
        velocity = [0.0, 0.0, 0.0]
        velocity[axis] = value
        command = goto(velocity_enu=(velocity[0], velocity[1], velocity[2]))
        assert encoder.setpoint(command, 0.0) is None
    assert unpack(encoder.heartbeat()).get_seq() == 0


# --- Whom a frame is for ---------------------------------------------------------------


@pytest.mark.parametrize(
    "message",
    [m for m in mavlink.mavlink_map.values() if "target_system" in m.fieldnames],
    ids=lambda m: m.msgname,
)
def test_the_target_of_every_message_that_has_one(message: Any) -> None:  # noqa: ANN401 - untyped
    for target in (0, 201):
        raw = Sender().pack(message.msgname, target_system=target)
        (frame,), _ = codec.split(raw)
        assert codec.target_of(frame) == target


def test_a_message_without_a_target_is_for_everybody() -> None:
    (frame,), _ = codec.split(Sender().heartbeat())
    assert codec.target_of(frame) == 0
