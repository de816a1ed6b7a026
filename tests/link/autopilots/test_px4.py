"""What PX4 is asked, and what it does by itself."""

from __future__ import annotations

import math

import pytest

from swarmctl.commands import (
    Arm,
    Command,
    GoTo,
    ReadParameter,
    SetMode,
    StreamTelemetry,
    TakeOff,
    UploadFence,
    WriteParameter,
)
from swarmctl.events import Heartbeat, Mode
from swarmctl.link.autopilots import px4
from swarmctl.link.command_request import Request
from tests.recorder.samples import record_types

ELSEWHERE = {GoTo, ReadParameter, WriteParameter, UploadFence}
"""Commands that are asked for in the same way of every autopilot."""


def request(command: Command, home_alt_amsl_m: float | None = None) -> Request:
    answer = px4.request_for(command, home_alt_amsl_m)
    assert isinstance(answer, Request)
    assert answer.kind is command.kind
    return answer


def heartbeat(mode_name: str) -> Heartbeat:
    return Heartbeat(
        received_s=0.0,
        sysid=1,
        autopilot="px4",
        is_multirotor=True,
        mode=Mode.OTHER,
        mode_name=mode_name,
        armed=False,
    )


@pytest.mark.parametrize(
    ("custom_mode", "mode", "name"),
    [
        # As PX4 SITL sends them in HEARTBEAT: sub mode in the highest byte.
        (0x00060000, Mode.GUIDED, "OFFBOARD"),
        (0x03040000, Mode.HOLD, "AUTO.LOITER"),
        (0x05040000, Mode.RETURN, "AUTO.RTL"),
        (0x06040000, Mode.LAND, "AUTO.LAND"),
        (0x02040000, Mode.OTHER, "AUTO.TAKEOFF"),
        (0x04040000, Mode.OTHER, "AUTO.MISSION"),
        (0x00030000, Mode.OTHER, "POSCTL"),
        (0x00010000, Mode.OTHER, "MANUAL"),
        (0x0B040000, Mode.OTHER, "4.11"),
    ],
)
def test_mode_of(custom_mode: int, mode: Mode, name: str) -> None:
    assert px4.mode_of(custom_mode) == (mode, name)


@pytest.mark.parametrize(
    ("mode", "main", "sub", "name"),
    [
        (Mode.GUIDED, 6, 0, "OFFBOARD"),
        (Mode.HOLD, 4, 3, "AUTO.LOITER"),
        (Mode.RETURN, 4, 5, "AUTO.RTL"),
        (Mode.LAND, 4, 6, "AUTO.LAND"),
    ],
)
def test_a_mode_is_main_and_sub_and_only_the_heartbeat_shows_it(
    mode: Mode, main: int, sub: int, name: str
) -> None:
    asked = request(SetMode(sysid=1, mode=mode))
    (step,) = asked.steps
    assert (step.command, step.params) == (176, (1.0, main, sub))
    assert asked.needs_state
    assert asked.shown_by is not None
    assert asked.shown_by(heartbeat(name))
    assert not asked.shown_by(heartbeat("POSCTL"))


def test_other_is_no_mode_to_ask_for() -> None:
    answer = px4.request_for(SetMode(sysid=1, mode=Mode.OTHER), None)
    assert answer == "PX4 has no mode that is called other here"


@pytest.mark.parametrize("home_alt_amsl_m", [51.5, None])
def test_take_off_altitude_is_amsl_and_right_above(home_alt_amsl_m: float | None) -> None:
    (step,) = request(TakeOff(sysid=1, alt_amsl_m=80.0), home_alt_amsl_m).steps
    assert (step.command, step.params[6]) == (22, 80.0)
    assert all(math.isnan(step.params[i]) for i in (3, 4, 5))


@pytest.mark.parametrize("alt_amsl_m", [51.5, 20.0, math.nan])
def test_take_off_into_the_ground_is_not_asked_for(alt_amsl_m: float) -> None:
    assert isinstance(px4.request_for(TakeOff(sysid=1, alt_amsl_m=alt_amsl_m), 51.5), str)


def test_streams_that_come_too_fast_are_slowed_down_if_the_vehicle_likes() -> None:
    asked = request(StreamTelemetry(sysid=1, position_hz=8.0))
    first = asked.steps[0]
    assert (first.command, first.params) == (511, (33.0, 125_000.0))
    # ATTITUDE_QUATERNION, LOCAL_POSITION_NED, HIGHRES_IMU, ODOMETRY
    slowed = [(step.command, *step.params) for step in asked.optional]
    assert slowed == [(511, message, 1e6) for message in (31, 32, 105, 331)]


def test_every_command_of_the_vocabulary_but_the_setpoint_can_be_asked_for() -> None:
    examples = {
        SetMode: SetMode(sysid=1, mode=Mode.LAND),
        StreamTelemetry: StreamTelemetry(sysid=1, position_hz=5.0),
        TakeOff: TakeOff(sysid=1, alt_amsl_m=60.0),
    }
    for kind in set(record_types(Command)) - ELSEWHERE:
        request(examples.get(kind) or kind(sysid=1), 50.0)


def test_arming_is_shown_by_the_heartbeat() -> None:
    assert request(Arm(sysid=1)).needs_state


@pytest.mark.parametrize(
    ("mode", "parameters", "words"),
    [
        (Mode.GUIDED, {}, ["leaves OFFBOARD about 1 s after", "what its COM_OBL_RC_ACT says"]),
        (Mode.GUIDED, {"COM_OF_LOSS_T": 3.0}, ["about 3 s after"]),
        (Mode.GUIDED, {"COM_OBL_RC_ACT": 0.0}, ["without one sinking at 0.7 m/s"]),
        (Mode.GUIDED, {"COM_OBL_RC_ACT": 2.0}, ["does what COM_OBL_RC_ACT = 2 says"]),
        (Mode.GUIDED, {"COM_OBL_RC_ACT": 3.0}, ["returns to its own home, lands there"]),
        (Mode.GUIDED, {"COM_OBL_RC_ACT": 5.0}, ["hovers until its battery failsafe acts"]),
        (
            Mode.GUIDED,
            {"COM_OBL_RC_ACT": 5.0, "NAV_DLL_ACT": 2.0},
            ["hovers, and returns to its own home once it misses its ground station"],
        ),
        (Mode.HOLD, {}, ["hovers", "NAV_DLL_ACT"]),
        (Mode.LAND, {}, ["lands where it is", "disarms"]),
        (Mode.RETURN, {}, ["returns", "home", "lands", "disarms"]),
        (Mode.OTHER, {}, ["carries on"]),
    ],
)
def test_after_the_controller_stops(
    mode: Mode, parameters: dict[str, float], words: list[str]
) -> None:
    armed = px4.after_controller_stops(mode, True, parameters)
    assert all(word in armed for word in words), armed
    assert "motors off" in px4.after_controller_stops(mode, False, parameters)
