"""What ArduCopter is asked, and what it does by itself."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.commands import (
    Arm,
    Command,
    Disarm,
    GoTo,
    ReadParameter,
    RequestHome,
    RequestVersion,
    SetMode,
    StreamTelemetry,
    TakeOff,
    UploadFence,
    WriteParameter,
)
from swarmctl.events import Heartbeat, LandedState, Mode
from swarmctl.link.autopilots import ardupilot
from swarmctl.link.command_request import Request, State
from tests.recorder.samples import record_types

ELSEWHERE = {GoTo, ReadParameter, WriteParameter, UploadFence}
"""Commands that are asked for in the same way of every autopilot."""


def request(command: Command, home_alt_amsl_m: float | None = None) -> Request:
    answer = ardupilot.request_for(command, home_alt_amsl_m)
    assert isinstance(answer, Request)
    assert answer.kind is command.kind
    return answer


def packets(command: Command, home_alt_amsl_m: float | None = None) -> list[tuple[int, ...]]:
    steps = request(command, home_alt_amsl_m).steps
    return [(step.command, *(int(param) for param in step.params)) for step in steps]


def heartbeat(mode_name: str, *, armed: bool = False) -> Heartbeat:
    return Heartbeat(
        received_s=0.0,
        sysid=1,
        autopilot="ardupilot",
        is_multirotor=True,
        mode=Mode.OTHER,
        mode_name=mode_name,
        armed=armed,
    )


def test_mode_names_are_mavlinks() -> None:
    named = {
        number: entry.name.removeprefix("COPTER_MODE_")
        for number, entry in mavlink.enums["COPTER_MODE"].items()
        if not entry.name.endswith("ENUM_END")
    }
    assert named == ardupilot.MODE_NAMES


@pytest.mark.parametrize(
    ("number", "mode", "name"),
    [
        (4, Mode.GUIDED, "GUIDED"),
        (9, Mode.LAND, "LAND"),
        (6, Mode.RETURN, "RTL"),
        (21, Mode.RETURN, "SMART_RTL"),
        (27, Mode.RETURN, "AUTO_RTL"),
        (17, Mode.HOLD, "BRAKE"),
        (0, Mode.OTHER, "STABILIZE"),
        (5, Mode.OTHER, "LOITER"),
        (20, Mode.OTHER, "GUIDED_NOGPS"),
        (250, Mode.OTHER, "250"),
    ],
)
def test_mode_of(number: int, mode: Mode, name: str) -> None:
    assert ardupilot.mode_of(number) == (mode, name)


@pytest.mark.parametrize(
    ("mode", "number", "name"),
    [
        (Mode.GUIDED, 4, "GUIDED"),
        (Mode.LAND, 9, "LAND"),
        (Mode.RETURN, 6, "RTL"),
        (Mode.HOLD, 17, "BRAKE"),
    ],
)
def test_set_mode(mode: Mode, number: int, name: str) -> None:
    command = SetMode(sysid=1, mode=mode)
    assert packets(command) == [(176, 1, number)]
    asked = request(command)
    assert asked.needs_state
    assert asked.shown_by is not None
    assert asked.shown_by(heartbeat(name))
    assert not asked.shown_by(heartbeat("STABILIZE"))


def test_other_is_no_mode_to_ask_for() -> None:
    answer = ardupilot.request_for(SetMode(sysid=1, mode=Mode.OTHER), None)
    assert answer == "ArduCopter has no mode that is called other here"


@pytest.mark.parametrize(("command", "armed"), [(Arm(sysid=1), True), (Disarm(sysid=1), False)])
def test_arm_and_disarm(command: Command, armed: bool) -> None:
    assert packets(command) == [(400, int(armed))]
    asked = request(command)
    assert asked.needs_state
    assert asked.shown_by is not None
    assert asked.shown_by(heartbeat("GUIDED", armed=armed))
    assert not asked.shown_by(heartbeat("GUIDED", armed=not armed))


def test_take_off_altitude_counts_from_home() -> None:
    command = TakeOff(sysid=1, alt_amsl_m=80.0)
    (step,) = request(command, 51.5).steps
    assert (step.command, step.params) == (22, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 28.5))


@pytest.mark.parametrize(
    ("state", "airborne"),
    [
        ("on_ground", False),
        ("unknown", False),
        ("landing", False),
        ("taking_off", True),
        ("in_air", True),
    ],
)
def test_take_off_needs_no_state_but_believes_one(state: str, airborne: bool) -> None:
    asked = request(TakeOff(sysid=1, alt_amsl_m=80.0), 50.0)
    assert not asked.needs_state
    assert asked.shown_by is not None
    shown: State = LandedState(received_s=0.0, sysid=1, state=state)  # type: ignore[arg-type]  # parametrised
    assert asked.shown_by(shown) is airborne


@pytest.mark.parametrize(
    ("home_alt_amsl_m", "sentence"),
    [
        (None, "its HOME_POSITION, which a take-off altitude counts from, is not known yet"),
        (80.0, "80.0 m AMSL is not above its home at 80.0 m AMSL"),
        (95.25, "80.0 m AMSL is not above its home at 95.2 m AMSL"),
    ],
)
def test_take_off_that_cannot_be_asked_for(home_alt_amsl_m: float | None, sentence: str) -> None:
    command = TakeOff(sysid=1, alt_amsl_m=80.0)
    assert ardupilot.request_for(command, home_alt_amsl_m) == sentence


def test_take_off_to_nowhere_is_not_asked_for() -> None:
    answer = ardupilot.request_for(TakeOff(sysid=1, alt_amsl_m=float("nan")), 50.0)
    assert isinstance(answer, str)


def test_streams_and_their_intervals_in_microseconds() -> None:
    asked = packets(StreamTelemetry(sysid=1, position_hz=8.0))
    assert {packet[0] for packet in asked} == {511}
    assert {packet[1]: packet[2] for packet in asked} == {
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 125_000,
        mavlink.MAVLINK_MSG_ID_ATTITUDE: 500_000,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1_000_000,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 1_000_000,
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1_000_000,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 500_000,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION: 5_000_000,
    }


def test_requested_messages() -> None:
    assert packets(RequestHome(sysid=1)) == [(512, 242)]
    assert packets(RequestVersion(sysid=1)) == [(512, 148)]


def test_every_command_of_the_vocabulary_but_the_setpoint_can_be_asked_for() -> None:
    examples = {
        SetMode: SetMode(sysid=1, mode=Mode.LAND),
        StreamTelemetry: StreamTelemetry(sysid=1, position_hz=5.0),
        TakeOff: TakeOff(sysid=1, alt_amsl_m=60.0),
    }
    for kind in set(record_types(Command)) - ELSEWHERE:
        request(examples.get(kind) or kind(sysid=1), 50.0)


@pytest.mark.parametrize(
    ("mode", "words"),
    [
        (Mode.GUIDED, ["brakes", "3 s", "hovers", "battery failsafe", "FS_GCS_ENABLE"]),
        (Mode.HOLD, ["hovers", "battery failsafe"]),
        (Mode.LAND, ["lands where it is", "disarms"]),
        (Mode.RETURN, ["returns", "home", "lands", "disarms"]),
        (Mode.OTHER, ["carries on"]),
    ],
)
def test_after_the_controller_stops(mode: Mode, words: list[str]) -> None:
    armed = ardupilot.after_controller_stops(mode, True, {})
    assert all(word in armed for word in words)
    assert "motors off" in ardupilot.after_controller_stops(mode, False, {})


def test_with_its_failsafe_set_it_returns_after_the_controller_stops() -> None:
    does = ardupilot.after_controller_stops(Mode.GUIDED, True, {"FS_GCS_ENABLE": 1.0})
    assert "returns to its own home about 5 s after the last heartbeat" in does
    assert "hovers" not in does
    told = {"FS_GCS_ENABLE": 1.0, "FS_GCS_TIMEOUT": 12.0}
    assert "about 12 s after" in ardupilot.after_controller_stops(Mode.GUIDED, True, told)


@pytest.mark.parametrize(
    ("parameter", "names"),
    [
        ("MAV_GCS_SYSID", [("MAV_GCS_SYSID", 1.0), ("SYSID_MYGCS", 1.0)]),
        ("MAV_SYSID", [("MAV_SYSID", 1.0), ("SYSID_THISMAV", 1.0)]),
        ("RTL_ALT_M", [("RTL_ALT_M", 1.0), ("RTL_ALT", 0.01)]),
        ("FS_GCS_ENABLE", [("FS_GCS_ENABLE", 1.0)]),
    ],
)
def test_names_of_parameters_old_and_new(parameter: str, names: list[tuple[str, float]]) -> None:
    assert [(s.name, s.unit) for s in ardupilot.spellings(parameter)] == names
