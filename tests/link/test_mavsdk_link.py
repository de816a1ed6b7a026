"""The link on MAVSDK beside the native one: the same bytes mean, and say, the same."""

from __future__ import annotations

import math
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import pytest

from swarmctl.commands import (
    Arm,
    Command,
    GoTo,
    ReadParameter,
    RequestHome,
    SetMode,
    StreamTelemetry,
    TakeOff,
    UploadFence,
    WriteParameter,
)
from swarmctl.errors import LinkError
from swarmctl.events import (
    CommandOutcome,
    Heartbeat,
    HomePosition,
    InputRejected,
    LinkQuality,
    Mode,
    Observation,
    ParameterValue,
    StatusText,
)
from swarmctl.link.address import Address
from swarmctl.link.mavlink_link import MavlinkLink
from swarmctl.link.mavsdk_link import MavsdkLink
from tests.brokers import free_port
from tests.link.wire import Sender, unpack

pytestmark = pytest.mark.live

GCS = 245
SYSIDS = range(1, 9)
NOW = 50.0
PATIENCE_S = 10.0
(INTEGER_1,) = struct.unpack("<f", struct.pack("<i", 1))
"""What PX4 puts into a float field for the integer 1."""
PX4: dict[str, Any] = {"autopilot": 12, "mode": 6 << 16}


class Rig:
    """Both links, and a socket that is every vehicle."""

    def __init__(self) -> None:
        self.native = MavlinkLink(gcs_sysid=GCS, vehicles=SYSIDS)
        self.link = MavsdkLink(gcs_sysid=GCS, vehicles=SYSIDS)
        self.woken = threading.Event()
        port = free_port(socket.SOCK_DGRAM)
        self.link.connect([f"udpin://127.0.0.1:{port}"], self.woken.set)
        self.radio = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.radio.connect(("127.0.0.1", port))
        self.radio.setblocking(False)
        self.senders = {sysid: Sender(sysid) for sysid in SYSIDS}
        self.heard: list[Observation] = []

    def close(self) -> None:
        self.link.close()
        self.radio.close()

    def say(self, frame: bytes) -> None:
        self.radio.send(frame)
        self.native.receive_datagram(frame, Address("10.0.0.1", 14550), NOW)

    def until(self, holds: Callable[[], bool]) -> None:
        """Let MAVSDK work, at one instant of the link's own time."""
        end = time.monotonic() + PATIENCE_S
        while not holds():
            assert time.monotonic() < end, "MAVSDK has not done it"
            self.woken.wait(0.02)
            self.woken.clear()
            if self.link.next_timer() <= NOW:
                self.link.handle_timer(NOW)
            self.heard += self.link.events()

    def meet(self, **heartbeat: Any) -> None:  # noqa: ANN401 - MAVLink fields of any type
        """Make every vehicle known to both."""
        for sender in self.senders.values():
            self.say(sender.heartbeat(**heartbeat))

        def known() -> bool:
            beats = {event.sysid for event in self.heard if isinstance(event, Heartbeat)}
            for sysid in set(SYSIDS) - beats:
                self.radio.send(self.senders[sysid].heartbeat(**heartbeat))
            return beats == set(SYSIDS)

        self.until(known)
        # Heartbeats may still be on their way: what was sent last comes last.
        self.radio.send(self.senders[1].pack("STATUSTEXT", text=b"that was all"))
        self.until(lambda: any(isinstance(event, StatusText) for event in self.heard))
        self.heard.clear()
        self.radio_messages()
        self.native.events()
        self.native.datagrams()

    def radio_messages(self) -> list[Any]:
        messages = []
        while True:
            try:
                messages.append(unpack(self.radio.recv(2048)))
            except BlockingIOError:
                return messages


@pytest.fixture
def rig() -> Iterator[Rig]:
    rig = Rig()
    yield rig
    rig.close()


def told(events: list[Observation]) -> list[object]:
    """What does not depend on who reads it: a fault's wording does."""
    return [
        event.kind if isinstance(event, InputRejected) else msgspec.structs.asdict(event)
        for event in events
        if not isinstance(event, LinkQuality)
    ]


def test_what_a_vehicle_says_means_the_same_as_on_the_native_link(rig: Rig) -> None:
    rig.meet()
    one, px4 = rig.senders[1], rig.senders[2]
    position = {"lat": 544_360_123, "lon": -111_960_456, "alt": 50_250, "vx": 310, "vy": -7}
    for frame in (
        one.pack("GLOBAL_POSITION_INT", time_boot_ms=6_900, **position, vz=-120),
        one.pack("SYSTEM_TIME", time_boot_ms=7_000),
        one.pack("SYSTEM_TIME", time_boot_ms=7_000, time_unix_usec=1_790_000_000_123_456),
        one.pack("GLOBAL_POSITION_INT", time_boot_ms=7_100, **position, vz=-120),
        one.pack("GLOBAL_POSITION_INT", time_boot_ms=7_200, alt=50_250),
        one.pack("HOME_POSITION", latitude=544_360_123, longitude=111_960_456, altitude=-3_500),
        one.pack("HOME_POSITION"),
        one.pack("ATTITUDE", time_boot_ms=7_300, roll=0.1, pitch=-0.2, yaw=3.0),
        one.pack("SYS_STATUS", voltage_battery=12_600, battery_remaining=77),
        one.pack(
            "SYS_STATUS",
            voltage_battery=0xFFFF,
            battery_remaining=-1,
            onboard_control_sensors_health=0x1000_0000,
        ),
        one.pack("GPS_RAW_INT", fix_type=3, satellites_visible=11),
        one.pack("GPS_RAW_INT", fix_type=1, satellites_visible=255),
        *(one.pack("EXTENDED_SYS_STATE", landed_state=state) for state in range(6)),
        one.pack("AUTOPILOT_VERSION", uid=2**63 + 5, flight_sw_version=0x04060001),
        one.pack("STATUSTEXT", severity=4, text=b'PreArm: "x\xff\x1b[31m'),
        one.heartbeat(armed=True, mode=9, system_status=5),
        px4.heartbeat(armed=True, **PX4, type=13),
        px4.heartbeat(autopilot=12, mode=4 << 16 | 5 << 24),
        rig.senders[3].heartbeat(type=1),
        one.pack("GLOBAL_POSITION_INT", lat=910_000_000, lon=1),
    ):
        rig.say(frame)
    rig.until(lambda: any(isinstance(event, InputRejected) for event in rig.heard))
    expected = told(rig.native.events())
    assert len(expected) == 22
    assert told(rig.heard) == expected
    # What is not finite is named, too: JSON has no word for it.
    rig.radio.send(one.pack("ATTITUDE", roll=math.nan))
    rig.until(lambda: rig.link.rejected["implausible"] == 2)


@pytest.mark.parametrize(
    ("heartbeat", "failsafe", "value"),
    [({"mode": 4}, "FS_GCS_ENABLE", 1.0), (PX4, "NAV_DLL_ACT", INTEGER_1)],
    ids=["ardupilot", "px4"],
)
def test_what_a_vehicle_is_told_is_the_same_as_on_the_native_link(
    rig: Rig, heartbeat: dict[str, Any], failsafe: str, value: float
) -> None:
    rig.meet(**heartbeat)
    where = {"lat_rad": 0.95, "lon_rad": -0.19537, "alt_amsl_m": 61.5}
    rig.say(rig.senders[3].pack("HOME_POSITION", latitude=1, longitude=1, altitude=4_000))
    rig.until(lambda: any(isinstance(event, HomePosition) for event in rig.heard))
    commands: list[Command] = [
        SetMode(sysid=1, mode=Mode.GUIDED),
        Arm(sysid=2),
        TakeOff(sysid=3, alt_amsl_m=25.0),
        RequestHome(sysid=4),
        StreamTelemetry(sysid=5, position_hz=10.0),
        ReadParameter(sysid=6, parameter=failsafe),
        GoTo(sysid=7, **where, velocity_enu=(5.0, -2.5, 0.25)),
        WriteParameter(sysid=8, parameter=failsafe, value=2.0),
    ]
    for command in commands:
        rig.link.send(command, NOW)
        rig.native.send(command, NOW)
    answer = {"param_id": failsafe.encode(), "param_type": 6, "param_value": value}
    rig.say(rig.senders[8].pack("PARAM_VALUE", **answer))
    wanted = [
        str(message)
        for frame, _ in rig.native.datagrams()
        if (message := unpack(frame)).get_type() not in {"HEARTBEAT", "TIMESYNC"}
    ]
    assert len(wanted) == len(commands) + 1
    told_to: list[str] = []

    def all_told() -> bool:
        told_to.extend(str(message) for message in rig.radio_messages())
        return set(wanted) <= set(told_to)

    rig.until(all_told)
    assert sum("SET_POSITION" in text for text in told_to) == 1
    assert rig.link.setpoints_out == 1
    for lat in (math.nan, 2.0):
        rig.link.send(
            GoTo(sysid=7, **(where | {"lat_rad": lat}), velocity_enu=(0.0, 0.0, 0.0)), NOW
        )
    assert rig.link.setpoints_dropped == 2


def test_a_vehicle_that_is_another_is_named_and_not_commanded(rig: Rig) -> None:
    rig.meet()
    for uid in (7, 8):
        rig.say(rig.senders[1].pack("AUTOPILOT_VERSION", uid=uid))
    rig.until(lambda: rig.link.rejected["changed_uid"] == 1)
    rig.link.send(Arm(sysid=1), NOW)
    rig.link.send(
        GoTo(sysid=1, lat_rad=0.9, lon_rad=0.2, alt_amsl_m=9.0, velocity_enu=(0, 0, 0)), NOW
    )
    (outcome,) = (event for event in rig.link.events() if isinstance(event, CommandOutcome))
    assert (outcome.result, rig.link.setpoints_dropped) == ("refused", 1)


def test_a_fence_is_refused_and_nothing_is_asked_for(rig: Rig) -> None:
    rig.meet()
    rig.link.send(UploadFence(sysid=1, lat_rad=0.9, lon_rad=0.2, radius_m=100.0), NOW)
    (outcome,) = rig.link.events()
    assert isinstance(outcome, CommandOutcome)
    assert (outcome.command, outcome.result) == ("UploadFence", "refused")
    assert rig.link.next_timer() > NOW


def test_nobody_known_is_commanded(rig: Rig) -> None:
    rig.link.send(Arm(sysid=1), NOW)
    rig.link.send(ReadParameter(sysid=1, parameter="X"), NOW)
    outcome, value = rig.link.events()
    assert isinstance(outcome, CommandOutcome)
    assert outcome.result == "no_answer"
    assert isinstance(value, ParameterValue)
    assert value.value is None


def test_a_port_in_use_is_named(rig: Rig) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        url = f"udpin://127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(LinkError, match=url):
            rig.link.connect([url], rig.woken.set)
