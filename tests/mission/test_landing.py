"""Landing sequences in virtual time."""

from swarmctl.commands import Command, SetMode
from swarmctl.events import Heartbeat, Mode
from swarmctl.mission.fleet import VehicleState
from swarmctl.mission.landing import LANDING_TIMEOUT_S, RETRY_S, Landing
from swarmctl.mission.loss_detection import HEARTBEAT_LOST_AFTER_S, LossDetection


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


def landings(commands: list[Command]) -> list[int]:
    assert all(isinstance(c, SetMode) and c.mode is Mode.LAND for c in commands)
    return [c.sysid for c in commands]


def test_the_lowest_lands_first_and_all_end_disarmed() -> None:
    vehicles = [VehicleState(1, 52.0), VehicleState(2, 40.0)]
    for vehicle in vehicles:
        beat(vehicle, 0.0, Mode.GUIDED)
    landing = Landing(vehicles, LossDetection(0.0), 0.0)
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
    vehicle = VehicleState(1, 40.0)
    beat(vehicle, 0.0, Mode.GUIDED)
    landing = Landing([vehicle], LossDetection(0.0), 0.0)
    assert landings(landing.step(0.0)) == [1]
    assert landings(landing.step(RETRY_S - 0.1)) == []
    assert landings(landing.step(RETRY_S)) == [1]


def test_a_vehicle_that_falls_silent_or_never_lands_is_given_up() -> None:
    silent, stuck = VehicleState(1, 40.0), VehicleState(2, 52.0)
    beat(silent, 0.0, Mode.LAND)
    beat(stuck, LANDING_TIMEOUT_S, Mode.LAND)
    landing = Landing([silent, stuck], LossDetection(0.0), 0.0)
    landing.step(HEARTBEAT_LOST_AFTER_S + 0.1)
    assert set(landing.given_up) == {1}
    landing.step(LANDING_TIMEOUT_S + 0.1)
    assert set(landing.given_up) == {1, 2}
    assert landing.complete
