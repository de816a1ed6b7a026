"""Commands and setpoints over the whole link, with vehicles that answer as they do."""

from __future__ import annotations

import math
from typing import Any

import pytest

from swarmctl.commands import Arm, RequestHome, SetMode, StreamTelemetry, TakeOff
from swarmctl.events import CommandKind, CommandOutcome, Heartbeat, Mode
from swarmctl.link.address import Address
from swarmctl.link.codec.messages import MavCmd
from tests.link.bench import AT_1, AT_2, GCS, Bench, Vehicle, goto

# --- Setpoints -------------------------------------------------------------------------


def test_a_setpoint_leaves_at_once(two: tuple[Bench, Vehicle, Vehicle]) -> None:
    bench, _, _ = two
    bench.link.send(goto(2, alt_amsl_m=88.0), 51.5)
    bench.drain()
    (message,) = bench.sent_to(AT_2, "SET_POSITION_TARGET_GLOBAL_INT")
    assert (message.target_system, message.alt, message.time_boot_ms) == (2, 88.0, 51_500)
    assert len(bench.sent) == 1
    assert (bench.link.setpoints_out, bench.link.setpoints_dropped) == (1, 0)


def test_setpoints_for_nobody_or_of_no_number_are_dropped_and_counted(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, _, _ = two
    bench.link.send(goto(99), 51.0)
    bench.link.send(goto(1, alt_amsl_m=math.nan), 51.0)
    bench.drain()
    assert (bench.sent, bench.heard) == ([], [])
    assert (bench.link.setpoints_out, bench.link.setpoints_dropped) == (0, 2)


# --- Commands --------------------------------------------------------------------------


def test_a_command_for_nobody_has_no_answer(bench: Bench) -> None:
    bench.link.send(Arm(sysid=1), 50.0)
    bench.drain()
    assert bench.heard == [
        CommandOutcome(
            received_s=50.0,
            sysid=1,
            command=CommandKind.ARM,
            result="no_answer",
            detail="no HEARTBEAT was heard from it",
        )
    ]
    assert bench.sent == []


def exchange(bench: Bench, vehicles: dict[Address, Vehicle], seconds: float) -> None:
    """Let time pass while the vehicles answer everything they are sent."""
    for _ in range(round(seconds / 0.1)):
        bench.wait(0.1)
        while bench.sent:
            frame, address = bench.sent.pop(0)
            for answer in vehicles[address].answer(frame):
                bench.receive(answer, address)


def test_two_vehicles_are_readied_side_by_side(two: tuple[Bench, Vehicle, Vehicle]) -> None:
    bench, one, other = two
    for sysid in (1, 2):
        bench.receive(
            (one if sysid == 1 else other).pack("HOME_POSITION", latitude=1, altitude=50_000),
            AT_1 if sysid == 1 else AT_2,
        )
        for command in (
            StreamTelemetry(sysid=sysid, position_hz=10.0),
            RequestHome(sysid=sysid),
            SetMode(sysid=sysid, mode=Mode.GUIDED),
            Arm(sysid=sysid),
            TakeOff(sysid=sysid, alt_amsl_m=70.0),
        ):
            bench.link.send(command, bench.now)
    bench.drain()
    exchange(bench, {AT_1: one, AT_2: other}, 2.0)
    for sysid, vehicle in ((1, one), (2, other)):
        outcomes = [outcome for outcome in bench.of(CommandOutcome) if outcome.sysid == sysid]
        assert [(outcome.command, outcome.result) for outcome in outcomes] == [
            ("StreamTelemetry", "accepted"),
            ("RequestHome", "accepted"),
            ("SetMode", "accepted"),
            ("Arm", "accepted"),
            ("TakeOff", "accepted"),
        ]
        assert vehicle.commands == [511] * 7 + [512, 176, 400, 22]
        assert (vehicle.mode, vehicle.armed) == (4, True)
        (take_off,) = (m for m in vehicle.received if getattr(m, "command", 0) == 22)
        assert take_off.param7 == 20.0


def test_take_off_without_a_known_home_is_refused_before_it_leaves(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, _, _ = two
    bench.link.send(TakeOff(sysid=1, alt_amsl_m=70.0), bench.now)
    bench.drain()
    (outcome,) = bench.of(CommandOutcome)
    assert (outcome.command, outcome.result) == ("TakeOff", "refused")
    assert "HOME_POSITION" in outcome.detail
    assert bench.sent == []


def test_a_command_is_tried_again_by_the_links_own_timer(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, _, _ = two
    bench.link.send(RequestHome(sysid=1), bench.now)
    bench.drain()
    bench.wait(10.0)
    tries = bench.sent_to(AT_1, "COMMAND_LONG")
    assert [message.confirmation for message in tries[:8]] == list(range(8))
    # And then in the way that older firmware knows.
    assert [message.command for message in tries[7:]] == [
        MavCmd.REQUEST_MESSAGE,
        MavCmd.GET_HOME_POSITION,
    ]
    (outcome,) = bench.of(CommandOutcome)
    assert (outcome.result, outcome.received_s) == ("no_answer", 58.0)


def test_an_answer_to_another_ground_station_is_not_ours(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, _ = two
    bench.link.send(RequestHome(sysid=1), bench.now)
    bench.receive(one.pack("COMMAND_ACK", command=512, result=4, target_system=255), AT_1)
    bench.wait(0.9)
    assert bench.of(CommandOutcome) == []


@pytest.mark.parametrize("target_system", [0, GCS])
def test_an_answer_to_us_or_to_nobody_in_particular_is_ours(
    two: tuple[Bench, Vehicle, Vehicle], target_system: int
) -> None:
    bench, one, _ = two
    bench.link.send(RequestHome(sysid=1), bench.now)
    bench.receive(one.pack("COMMAND_ACK", command=512, target_system=target_system), AT_1)
    assert [outcome.result for outcome in bench.of(CommandOutcome)] == ["accepted"]


def test_a_refusal_carries_what_the_vehicle_said(two: tuple[Bench, Vehicle, Vehicle]) -> None:
    bench, one, other = two
    bench.link.send(Arm(sysid=1), bench.now)
    bench.receive(other.pack("STATUSTEXT", text=b"of another vehicle"), AT_2)
    bench.receive(one.pack("COMMAND_ACK", command=400, result=4, target_system=GCS), AT_1)
    bench.receive(one.pack("STATUSTEXT", text=b"Arm: Need Position Estimate", severity=2), AT_1)
    (outcome,) = bench.of(CommandOutcome)
    assert (outcome.result, outcome.detail) == ("refused", "FAILED: Arm: Need Position Estimate")


def test_a_mode_is_accepted_when_the_heartbeat_shows_it(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, _ = two
    bench.link.send(SetMode(sysid=1, mode=Mode.RETURN), bench.now)
    bench.receive(one.pack("COMMAND_ACK", command=176, target_system=GCS), AT_1)
    bench.receive(one.heartbeat(mode=4), AT_1)
    assert bench.of(CommandOutcome) == []
    bench.receive(one.heartbeat(mode=6), AT_1)
    last_two = bench.heard[-2:]
    assert isinstance(last_two[0], Heartbeat)
    assert isinstance(last_two[1], CommandOutcome)
    assert last_two[1].result == "accepted"


def test_a_take_off_whose_ack_was_lost_is_accepted_when_it_flies(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, _ = two
    bench.receive(one.pack("HOME_POSITION", latitude=1, altitude=50_000), AT_1)
    bench.link.send(TakeOff(sysid=1, alt_amsl_m=70.0), bench.now)
    bench.wait(0.5)
    bench.receive(one.pack("EXTENDED_SYS_STATE", landed_state=3), AT_1)
    assert [outcome.result for outcome in bench.of(CommandOutcome)] == ["accepted"]


# --- PX4 -------------------------------------------------------------------------------


OFFBOARD, POSCTL, AUTO_LOITER = 0x00060000, 0x00030000, 0x03040000


def px4_beat(vehicle: Vehicle, mode: int, **fields: Any) -> bytes:  # noqa: ANN401 - MAVLink fields
    return vehicle.heartbeat(mode=mode, autopilot=12, **fields)


def test_px4_is_known_by_its_heartbeat_and_so_are_its_modes_and_failsafes(bench: Bench) -> None:
    vehicle = Vehicle(1)
    bench.receive(px4_beat(vehicle, OFFBOARD, system_status=4))
    bench.receive(px4_beat(vehicle, POSCTL, system_status=5))
    one, two = bench.of(Heartbeat)
    assert (one.mode, one.mode_name, one.failsafe) == (Mode.GUIDED, "OFFBOARD", False)
    assert (two.mode, two.mode_name, two.failsafe) == (Mode.OTHER, "POSCTL", True)
    assert one.guided_by_stream
    bench.receive(vehicle.heartbeat(mode=4))
    assert not bench.of(Heartbeat)[-1].guided_by_stream


def test_px4_takes_our_setpoints_in_a_frame_it_knows(bench: Bench) -> None:
    bench.receive(px4_beat(Vehicle(1), OFFBOARD))
    bench.link.send(goto(1), 50.0)
    bench.drain()
    (message,) = bench.sent_to(AT_1, "SET_POSITION_TARGET_GLOBAL_INT")
    assert message.coordinate_frame == 5  # not 0 or 3, which it rejects
    position_and_velocity, everything = 0b0000_0011_1111, 0b1101_1111_1111
    assert message.type_mask & position_and_velocity == 0
    assert message.type_mask & everything != everything


def test_an_ack_of_px4_for_offboard_is_believed_only_with_the_heartbeat(bench: Bench) -> None:
    vehicle = Vehicle(1)
    bench.receive(px4_beat(vehicle, AUTO_LOITER))
    bench.link.send(SetMode(sysid=1, mode=Mode.GUIDED), bench.now)
    bench.drain()
    (command,) = bench.sent_to(AT_1, "COMMAND_LONG")
    assert (command.command, command.param1, command.param2, command.param3) == (176, 1, 6, 0)
    bench.receive(vehicle.pack("COMMAND_ACK", command=176, target_system=GCS))
    for _ in range(6):
        bench.receive(px4_beat(vehicle, AUTO_LOITER))
        assert bench.of(CommandOutcome) == []
        bench.wait(1.0)
    (outcome,) = bench.of(CommandOutcome)
    assert outcome.result == "refused"
    assert "HEARTBEAT shows AUTO.LOITER and disarmed" in outcome.detail


def test_px4_that_is_not_ready_to_arm_is_asked_again(bench: Bench) -> None:
    vehicle = Vehicle(1)
    bench.receive(px4_beat(vehicle, OFFBOARD))
    bench.link.send(Arm(sysid=1), bench.now)
    for _ in range(2):
        bench.receive(vehicle.pack("COMMAND_ACK", command=400, result=1, target_system=GCS))
        bench.wait(1.0)
    bench.receive(vehicle.pack("COMMAND_ACK", command=400, target_system=GCS))
    bench.receive(px4_beat(vehicle, OFFBOARD, base_mode=0x81))
    assert len(bench.sent_to(AT_1, "COMMAND_LONG")) == 3
    assert [outcome.result for outcome in bench.of(CommandOutcome)] == ["accepted"]


def test_px4s_take_off_altitude_crosses_the_wire_as_amsl(bench: Bench) -> None:
    vehicle = Vehicle(1)
    bench.receive(px4_beat(vehicle, AUTO_LOITER))
    bench.receive(vehicle.pack("HOME_POSITION", latitude=1, altitude=50_000))
    bench.link.send(TakeOff(sysid=1, alt_amsl_m=70.0), bench.now)
    bench.drain()
    (command,) = bench.sent_to(AT_1, "COMMAND_LONG")
    assert (command.command, command.param7) == (22, 70.0)
    assert math.isnan(command.param5)
    assert math.isnan(command.param6)
