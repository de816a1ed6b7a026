"""In-flight checks, one by one."""

import pytest

from swarmctl.events import Heartbeat, Mode, VehiclePosition, VehicleStatus
from swarmctl.frames import LocalFrame
from swarmctl.mission.fleet import Fleet, VehicleState
from swarmctl.mission.in_flight_checks import BROKEN_PLAN_S, InFlightChecks
from swarmctl.mission.loss_detection import HEARTBEAT_LOST_AFTER_S, LOST_AFTER_S, LossDetection
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.mission.phases import Phase
from tests.missions import short_mission_text

MISSION = parse_mission(short_mission_text())


def checks(hiccup_s: float = 0.0) -> InFlightChecks:
    return InFlightChecks(MISSION, LossDetection(hiccup_s), hiccup_s)


def fleet(
    *, armed: bool = True, battery: float | None = 0.9, position_s: float = 0.0, beat_s: float = 0.0
) -> Fleet:
    vehicle = VehicleState(1, 30.0)
    vehicle.heartbeat = Heartbeat(
        received_s=beat_s,
        sysid=1,
        autopilot="ardupilot",
        is_multirotor=True,
        mode=Mode.GUIDED,
        mode_name="GUIDED",
        armed=armed,
    )
    vehicle.position = VehiclePosition(
        received_s=position_s,
        sysid=1,
        boot_s=0.0,
        epoch_utc_s=None,
        lat_rad=0.9,
        lon_rad=0.2,
        alt_amsl_m=30.0,
        velocity_enu=(0.0, 0.0, 0.0),
    )
    vehicle.status = VehicleStatus(
        received_s=0.0, sysid=1, battery_v=None, battery_fraction=battery, prearm_ok=True
    )
    return Fleet(LocalFrame(0.9, 0.2, 0.0), {1: vehicle})


def result(flying: Fleet, now: float, *, all_up: bool = True, hiccup_s: float = 0.0) -> str | None:
    failure = checks(hiccup_s).vehicle_failure(flying, (), all_up, now)
    return failure.result if failure is not None else None


def test_silence_is_a_loss_after_its_time_and_the_computers_own() -> None:
    assert result(fleet(), LOST_AFTER_S) is None
    assert result(fleet(), LOST_AFTER_S + 0.1) == "vehicle_lost"
    assert result(fleet(), LOST_AFTER_S + 3.0, hiccup_s=3.0) is None
    assert result(fleet(), LOST_AFTER_S + 3.1, hiccup_s=3.0) == "vehicle_lost"


def test_heartbeats_may_be_missing_for_longer_than_positions() -> None:
    at = HEARTBEAT_LOST_AFTER_S
    assert result(fleet(position_s=at), at) is None
    assert result(fleet(position_s=at), at + 0.1) == "vehicle_lost"
    assert result(fleet(position_s=0.0, beat_s=at), at) == "vehicle_lost"


def test_a_disarmed_vehicle_is_a_loss_only_once_all_should_fly() -> None:
    assert result(fleet(armed=False), 1.0) == "vehicle_lost"
    assert result(fleet(armed=False), 1.0, all_up=False) is None


@pytest.mark.parametrize(("battery", "found"), [(0.25, None), (0.249, "low_battery"), (None, None)])
def test_the_battery_reserve(battery: float | None, found: str | None) -> None:
    assert result(fleet(battery=battery), 1.0) == found


def test_vehicles_that_a_pilot_flies_are_not_watched() -> None:
    assert checks().vehicle_failure(fleet(armed=False), (1,), True, 100.0) is None


def test_the_feed_is_missed_from_the_first_formation_flight_on() -> None:
    observing = checks()
    assert observing.observation_failure(Phase.LAUNCHING, False, None, 0.0, 100.0) is None
    assert observing.observation_failure(Phase.FORMING, False, None, 0.0, 200.0) is None
    assert observing.observation_failure(Phase.FORMING, False, None, 0.0, 220.0) is None
    failure = observing.observation_failure(Phase.FORMING, False, None, 0.0, 220.1)
    assert failure is not None
    assert failure.result == "feed_silent"
    assert observing.observation_failure(Phase.FORMING, False, 210.0, 0.0, 220.1) is None


def test_a_plan_may_be_broken_for_a_moment_only() -> None:
    observing = checks()
    phase = Phase.APPROACHING
    assert observing.observation_failure(phase, False, 0.0, 0.0, 1.0) is None
    assert observing.observation_failure(phase, True, 1.0, 0.0, 1.0 + BROKEN_PLAN_S) is None
    failure = observing.observation_failure(phase, True, 5.0, 0.0, 1.1 + BROKEN_PLAN_S)
    assert failure is not None
    assert failure.result == "plan_rejected"


def test_the_time_limit() -> None:
    limit = MISSION.goal.time_limit_s
    assert checks().observation_failure(Phase.ORBITING, False, limit, 0.0, limit) is None
    failure = checks().observation_failure(Phase.ORBITING, False, limit, 0.0, limit + 0.1)
    assert failure is not None
    assert failure.result == "not_located"
