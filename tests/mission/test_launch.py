"""Launch and landing sequences in virtual time."""

import pytest

from swarmctl.commands import Arm, Command, SetMode, TakeOff
from swarmctl.events import CommandOutcome, Heartbeat, Mode, VehiclePosition
from swarmctl.mission.fleet import VehicleState
from swarmctl.mission.launch import LANDING_TIMEOUT_S, RETRY_S, TAKE_OFF_TIMEOUT_S, Landing, Launch
from swarmctl.mission.loss_detection import HEARTBEAT_LOST_AFTER_S, Watch
from swarmctl.mission.mission_file_loading import parse_mission
from tests.missions import short_mission_text


def outcome(sysid: int, command: str, result: str = "accepted") -> CommandOutcome:
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


def beat(vehicle: VehicleState, now: float, mode: Mode, *, armed: bool = True) -> None:
    vehicle.heartbeat = Heartbeat(
        received_s=now,
        sysid=vehicle.sysid,
        autopilot="ardupilot",
        is_multirotor=True,
        mode=mode,
        mode_name=mode.upper(),
        armed=armed,
    )


def pair() -> list[VehicleState]:
    return [VehicleState(1, 40.0), VehicleState(2, 52.0)]


def watch() -> Watch:
    return Watch(parse_mission(short_mission_text()), 0.0)


def test_each_vehicle_goes_through_mode_arm_take_off_and_climb_in_its_turn() -> None:
    vehicles = pair()
    launch = Launch(vehicles, 100.0)
    assert launch.step(100.0) == [SetMode(sysid=1, mode=Mode.GUIDED)]
    assert launch.step(101.9) == []
    assert launch.outcome(outcome(1, "SetMode"), 101.9) == [Arm(sysid=1)]
    assert launch.step(102.0) == [SetMode(sysid=2, mode=Mode.GUIDED)]
    assert launch.outcome(outcome(1, "Arm"), 102.1) == [TakeOff(sysid=1, alt_amsl_m=40.0)]
    assert launch.outcome(outcome(1, "TakeOff"), 102.2) == []
    for command in ("SetMode", "Arm", "TakeOff"):
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
        ((), "SetMode", "mode_refused", "vehicle 1 refused to switch to guided mode (because)"),
        (("SetMode",), "Arm", "arming_refused", "vehicle 1 refused to arm (because)"),
        (("SetMode", "Arm"), "TakeOff", "take_off_refused", "vehicle 1 refused to take off"),
    ],
)
def test_a_refusal_is_the_failure(
    done: tuple[str, ...], refused: str, result: str, says: str
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
    launch.outcome(outcome(1, "SetMode", "no_answer"), 0.0)
    assert launch.failure is not None
    assert "vehicle 1 did not answer when told to switch" in launch.failure.detail


def test_the_outcome_of_another_command_changes_nothing() -> None:
    launch = Launch(pair(), 0.0)
    launch.step(0.0)
    assert launch.outcome(outcome(1, "RequestHome", "refused"), 0.0) == []
    assert launch.failure is None


def test_a_vehicle_that_does_not_climb_is_named() -> None:
    vehicles = pair()
    launch = Launch(vehicles, 0.0)
    launch.step(0.0)
    for command in ("SetMode", "Arm", "TakeOff"):
        launch.outcome(outcome(1, command), 1.0)
    vehicles[0].position = at(1, 12.0)
    launch.step(1.0 + TAKE_OFF_TIMEOUT_S)
    assert launch.failure is None
    launch.step(1.1 + TAKE_OFF_TIMEOUT_S)
    assert launch.failure is not None
    assert "vehicle 1 has not reached 40 m AMSL 90 s after take-off" in launch.failure.detail


def landings(commands: list[Command]) -> list[int]:
    assert all(isinstance(c, SetMode) and c.mode is Mode.LAND for c in commands)
    return [c.sysid for c in commands]


def test_the_lowest_lands_first_and_all_end_disarmed() -> None:
    vehicles = [VehicleState(1, 52.0), VehicleState(2, 40.0)]
    for vehicle in vehicles:
        beat(vehicle, 0.0, Mode.GUIDED)
    landing = Landing(vehicles, watch(), 0.0)
    assert landings(landing.step(0.0)) == [2]
    assert landings(landing.step(2.0)) == [1]
    for vehicle in vehicles:
        beat(vehicle, 3.0, Mode.LAND)
    assert landings(landing.step(6.0)) == []
    assert not landing.complete
    for vehicle in vehicles:
        beat(vehicle, 30.0, Mode.LAND, armed=False)
    assert landing.complete
    assert landing.given_up == ()


def test_landing_is_asked_for_again_until_the_mode_shows() -> None:
    (vehicle, _) = pair()
    beat(vehicle, 0.0, Mode.GUIDED)
    landing = Landing([vehicle], watch(), 0.0)
    assert landings(landing.step(0.0)) == [1]
    assert landings(landing.step(RETRY_S - 0.1)) == []
    assert landings(landing.step(RETRY_S)) == [1]


def test_a_vehicle_that_falls_silent_or_never_lands_is_given_up() -> None:
    silent, stuck = pair()
    beat(silent, 0.0, Mode.LAND)
    beat(stuck, LANDING_TIMEOUT_S, Mode.LAND)
    landing = Landing([silent, stuck], watch(), 0.0)
    landing.step(HEARTBEAT_LOST_AFTER_S + 0.1)
    assert set(landing.given_up) == {1}
    landing.step(LANDING_TIMEOUT_S + 0.1)
    assert set(landing.given_up) == {1, 2}
    assert landing.complete
