"""Launch sequences in virtual time."""

import pytest

from swarmctl.commands import Arm, SetMode, TakeOff
from swarmctl.events import CommandKind, CommandOutcome, Mode, VehiclePosition
from swarmctl.mission.fleet import VehicleState
from swarmctl.mission.launch import TAKE_OFF_TIMEOUT_S, Launch

SET_MODE, ARM, TAKE_OFF = CommandKind.SET_MODE, CommandKind.ARM, CommandKind.TAKE_OFF


def outcome(sysid: int, command: CommandKind, result: str = "accepted") -> CommandOutcome:
    return CommandOutcome(
        received_s=0.0,
        sysid=sysid,
        command=command,
        result=result,  # type: ignore[arg-type]  # a str here, a Literal there
        detail="because",
    )


def at(sysid: int, alt: float) -> VehiclePosition:
    return VehiclePosition(
        received_s=0.0,
        sysid=sysid,
        boot_s=0.0,
        epoch_utc_s=None,
        lat_rad=0.0,
        lon_rad=0.0,
        alt_amsl_m=alt,
        velocity_enu=(0.0, 0.0, 0.0),
    )


def pair() -> list[VehicleState]:
    return [VehicleState(1, 40.0), VehicleState(2, 52.0)]


def test_each_vehicle_goes_through_mode_arm_take_off_and_climb_in_its_turn() -> None:
    vehicles = pair()
    launch = Launch(vehicles, 100.0)
    assert launch.step(100.0) == [SetMode(sysid=1, mode=Mode.GUIDED)]
    assert launch.step(101.9) == []
    assert launch.outcome(outcome(1, SET_MODE), 101.9) == [Arm(sysid=1)]
    assert launch.step(102.0) == [SetMode(sysid=2, mode=Mode.GUIDED)]
    assert launch.outcome(outcome(1, ARM), 102.1) == [TakeOff(sysid=1, alt_amsl_m=40.0)]
    assert launch.outcome(outcome(1, TAKE_OFF), 102.2) == []
    for command in (SET_MODE, ARM, TAKE_OFF):
        launch.outcome(outcome(2, command), 103.0)
    vehicles[0].position = at(1, 38.5)
    launch.step(120.0)
    assert (launch.at_altitude, launch.complete) == (1, False)
    vehicles[1].position = at(2, 50.5)
    launch.step(121.0)
    assert launch.complete


@pytest.mark.parametrize(
    ("done", "refused", "result", "says"),
    [
        (
            (),
            SET_MODE,
            "mode_refused",
            "vehicle 1 refused to switch to guided mode (because)",
        ),
        (
            (SET_MODE,),
            ARM,
            "arming_refused",
            "vehicle 1 refused to arm (because)",
        ),
        (
            (SET_MODE, ARM),
            TAKE_OFF,
            "take_off_refused",
            "vehicle 1 refused to take off",
        ),
    ],
)
def test_a_refusal_is_the_failure(
    done: tuple[CommandKind, ...], refused: CommandKind, result: str, says: str
) -> None:
    launch = Launch(pair(), 0.0)
    launch.step(0.0)
    for command in done:
        launch.outcome(outcome(1, command), 0.0)
    assert launch.outcome(outcome(1, refused, "refused"), 0.0) == []
    assert launch.failure is not None
    assert launch.failure.result == result
    assert says in launch.failure.detail
    assert launch.step(10.0) == []


def test_no_answer_is_not_called_a_refusal() -> None:
    launch = Launch(pair(), 0.0)
    launch.step(0.0)
    launch.outcome(outcome(1, SET_MODE, "no_answer"), 0.0)
    assert launch.failure is not None
    assert "vehicle 1 did not answer when told to switch" in launch.failure.detail


def test_the_outcome_of_another_command_changes_nothing() -> None:
    launch = Launch(pair(), 0.0)
    launch.step(0.0)
    assert launch.outcome(outcome(1, CommandKind.REQUEST_HOME, "refused"), 0.0) == []
    assert launch.failure is None


def test_a_vehicle_that_does_not_climb_is_named() -> None:
    vehicles = pair()
    launch = Launch(vehicles, 0.0)
    launch.step(0.0)
    for command in (SET_MODE, ARM, TAKE_OFF):
        launch.outcome(outcome(1, command), 1.0)
    vehicles[0].position = at(1, 12.0)
    launch.step(1.0 + TAKE_OFF_TIMEOUT_S)
    assert launch.failure is None
    launch.step(1.1 + TAKE_OFF_TIMEOUT_S)
    assert launch.failure is not None
    assert "vehicle 1 has not reached 40 m AMSL 90 s after take-off" in launch.failure.detail
