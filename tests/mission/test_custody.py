"""Who flies a vehicle, by its heartbeats; then whole flights guided by a stream, as PX4's are."""

from __future__ import annotations

import math
from typing import Literal

import pytest

from swarmctl.commands import Arm, GoTo, SetMode, TakeOff
from swarmctl.decisions import MissionEnded, Notice
from swarmctl.events import CommandKind, Heartbeat, Mode, OperatorRequest
from swarmctl.frames import LocalFrame
from swarmctl.mission.custody import RESUME_S, Custody
from swarmctl.mission.fleet import Fleet, VehicleState
from swarmctl.mission.mission_file_loading import parse_mission
from tests.mission.fake_fleet import PX4_SAFE, STREAM_LOST_S, Flight
from tests.missions import short_mission_text


@pytest.fixture
def flight() -> Flight:
    flight = Flight(parse_mission(short_mission_text(swarm__autopilot="auto")))
    for vehicle in flight.fleet.vehicles.values():
        vehicle.by_stream = True
        vehicle.parameters = PX4_SAFE.copy()
    return flight


def ended(flight: Flight) -> MissionEnded:
    (end,) = [d for d in flight.decisions if isinstance(d, MissionEnded)]
    return end


def warnings(flight: Flight) -> str:
    return "\n".join(d.text for d in flight.decisions if isinstance(d, Notice))


def fly(flight: Flight, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        flight.step()


# --- By its heartbeats -----------------------------------------------------------------


def beat(
    mode: Mode, *, armed: bool = True, failsafe: bool = False, by_stream: bool = True
) -> Heartbeat:
    return Heartbeat(
        received_s=0.0,
        sysid=1,
        autopilot="px4",
        is_multirotor=True,
        mode=mode,
        mode_name=mode.upper(),
        armed=armed,
        failsafe=failsafe,
        guided_by_stream=by_stream,
    )


GUIDED = beat(Mode.GUIDED)
MISSED = beat(Mode.OTHER, failsafe=True)
"""On its failsafe because our setpoints stopped."""


@pytest.fixture
def two() -> Fleet:
    """Vehicles 1 and 2, guided, 30 m above their launch points."""
    states = {
        sysid: VehicleState(
            sysid,
            40.0,
            heartbeat=GUIDED,
            position_enu=(0.0, 0.0, 30.0),
            launch_enu=(0.0, 0.0, 0.0),
        )
        for sysid in (1, 2)
    }
    return Fleet(LocalFrame(0.9, 0.2, 0.0), states)


def released(custody: Custody, now: float) -> list[str]:
    """What befell those that a review released."""
    return [failure.result for failure in custody.review(now)[1]]


def test_a_vehicle_is_ours_while_it_is_armed_guided_and_off_the_ground(two: Fleet) -> None:
    custody, vehicle = Custody(two), two.vehicles[1]
    assert custody.is_ours(vehicle, raised=False)
    vehicle.position_enu = vehicle.launch_enu
    assert not custody.is_ours(vehicle, raised=False)
    assert custody.is_ours(vehicle, raised=True)
    vehicle.heartbeat = beat(Mode.OTHER)
    assert not custody.is_ours(vehicle, raised=True)
    vehicle.heartbeat = beat(Mode.GUIDED, armed=False)
    assert not custody.is_ours(vehicle, raised=True)
    vehicle.heartbeat = None
    assert not custody.is_ours(vehicle, raised=True)


@pytest.mark.parametrize("harmless", [None, GUIDED, beat(Mode.OTHER, armed=False)])
def test_who_is_guided_unarmed_or_not_heard_is_not_released(
    two: Fleet, harmless: Heartbeat | None
) -> None:
    custody = Custody(two)
    two.vehicles[1].heartbeat = harmless
    assert custody.review(10.0) == ([], [])
    assert custody.released == set()


def test_who_missed_our_setpoints_is_ours_for_the_time_it_takes_to_resume(two: Fleet) -> None:
    assert RESUME_S == 5.0
    custody, vehicle = Custody(two), two.vehicles[1]
    vehicle.heartbeat = MISSED
    assert not custody.is_ours(vehicle, raised=True)
    for now in (10.0, 15.0):
        said, failures = custody.review(now)
        assert len(said) == 1
        assert failures == []
        assert custody.is_ours(vehicle, raised=True)
    assert released(custody, 15.1) == ["vehicle_failsafe"]
    assert custody.released == {1}
    assert not custody.is_ours(vehicle, raised=True)


@pytest.mark.parametrize("harmless", [None, GUIDED, beat(Mode.OTHER, armed=False)])
def test_each_time_it_misses_our_setpoints_it_has_the_whole_time_to_resume(
    two: Fleet, harmless: Heartbeat | None
) -> None:
    custody, vehicle = Custody(two), two.vehicles[1]
    for since in (10.0, 14.0):
        vehicle.heartbeat = MISSED
        assert released(custody, since) == []
        assert released(custody, since + 3.0) == []
        vehicle.heartbeat = harmless
        assert custody.review(since + 3.5) == ([], [])


@pytest.mark.parametrize(
    ("heartbeat", "result"),
    [
        (beat(Mode.OTHER), "taken_over"),
        (beat(Mode.OTHER, by_stream=False), "taken_over"),
        (beat(Mode.RETURN, failsafe=True, by_stream=False), "vehicle_failsafe"),
    ],
)
def test_who_cannot_be_expected_back_is_released_at_once_and_told_once(
    two: Fleet, heartbeat: Heartbeat, result: str
) -> None:
    custody, vehicle = Custody(two), two.vehicles[1]
    # Vehicle 1 comes first: what is known of it keeps nobody from looking at vehicle 2.
    vehicle.heartbeat = heartbeat
    assert released(custody, 10.0) == [result]
    two.vehicles[2].heartbeat = heartbeat
    assert released(custody, 10.1) == [result]
    assert custody.review(20.0) == ([], [])
    assert custody.released == {1, 2}
    vehicle.heartbeat = GUIDED
    assert not custody.is_ours(vehicle, raised=True)


def test_a_pilot_who_takes_over_on_a_failsafe_is_not_waited_for(two: Fleet) -> None:
    custody, vehicle = Custody(two), two.vehicles[1]
    vehicle.heartbeat = MISSED
    two.vehicles[2].heartbeat = MISSED
    said, _ = custody.review(10.0)
    assert [text.split(" is ")[0] for text in said] == ["vehicle 1", "vehicle 2"]
    vehicle.heartbeat = beat(Mode.OTHER)
    assert released(custody, 11.0) == ["taken_over"]
    assert custody.released == {1}


# --- Whole flights ---------------------------------------------------------------------


def test_a_whole_mission_on_setpoints_from_the_ground_to_the_landing(flight: Flight) -> None:
    flight.run("ended")
    assert ended(flight).result == "located"
    assert warnings(flight) == ""
    assert not any(isinstance(c, TakeOff) for c in flight.commands)
    for vehicle in flight.fleet.vehicles.values():
        assert not vehicle.armed
        assert not vehicle.failsafe
        assert math.dist(vehicle.position, vehicle.home) < 3.0
    assert flight.least_separation_m >= flight.controller.mission.limits.min_separation_m


def test_setpoints_come_first_stay_on_the_ground_until_armed_and_then_raise(
    flight: Flight,
) -> None:
    flight.run("forming")
    commands = flight.fleet.vehicles[2].commands
    first = commands.index(next(c for c in commands if isinstance(c, GoTo)))
    mode = commands.index(SetMode(sysid=2, mode=Mode.GUIDED))
    arm = commands.index(Arm(sysid=2))
    assert first + 10 < mode < arm
    origin = flight.controller.mission.origin.alt_amsl_m
    altitude = flight.fleet.mission.swarm.vehicles[1].altitude_amsl_m
    before = [c.alt_amsl_m for c in commands[:arm] if isinstance(c, GoTo)]
    after = [c.alt_amsl_m for c in commands[arm:] if isinstance(c, GoTo)]
    assert before == pytest.approx([origin] * len(before), abs=0.01)
    assert set(after) == {altitude}


def test_who_waits_for_its_turn_to_land_does_not_miss_its_setpoints(flight: Flight) -> None:
    flight.run("landing")
    worst = 0.0
    while not flight.controller.ended:
        flight.step()
        for vehicle in flight.fleet.vehicles.values():
            if vehicle.armed and vehicle.mode is Mode.GUIDED:
                worst = max(worst, flight.now - vehicle.setpoint_s)
        assert not any(v.failsafe for v in flight.fleet.vehicles.values())
    assert worst < 0.5 * STREAM_LOST_S


def test_a_vehicle_that_missed_setpoints_comes_back_and_the_mission_goes_on(
    flight: Flight,
) -> None:
    flight.run("approaching")
    vehicle = flight.fleet.vehicles[3]
    vehicle.mode, vehicle.failsafe, vehicle.stuck = Mode.OTHER, True, True
    fly(flight, RESUME_S - 1.0)
    vehicle.stuck = False
    fly(flight, 1.0)
    assert vehicle.mode is Mode.GUIDED
    assert "vehicle 3 is on its failsafe (OTHER)" in warnings(flight)
    flight.run("ended")
    assert ended(flight).result == "located"
    assert not vehicle.armed


def test_a_vehicle_that_does_not_come_back_is_released_and_the_others_return(
    flight: Flight,
) -> None:
    flight.run("approaching")
    vehicle = flight.fleet.vehicles[3]
    vehicle.mode, vehicle.failsafe, vehicle.stuck = Mode.OTHER, True, True
    fly(flight, RESUME_S + 2.0)
    assert flight.controller.phase == "returning"
    told = len(vehicle.commands)
    flight.run("ended")
    assert ended(flight).result == "vehicle_failsafe"
    assert "left guided mode for OTHER on a failsafe of its own" in ended(flight).detail
    assert len(vehicle.commands) == told
    assert [v.sysid for v in flight.fleet.vehicles.values() if v.armed] == [3]


def test_a_pilot_who_takes_over_is_not_mistaken_for_a_failsafe(flight: Flight) -> None:
    flight.run("approaching")
    vehicle = flight.fleet.vehicles[3]
    vehicle.mode = Mode.OTHER
    fly(flight, 1.2)
    assert flight.controller.phase == "returning"
    told = len(vehicle.commands)
    flight.run("ended")
    assert ended(flight).result == "taken_over"
    assert len(vehicle.commands) == told


def test_a_failsafe_of_a_vehicle_that_does_not_resume_is_no_pilot_and_is_not_waited_for() -> None:
    flight = Flight(parse_mission(short_mission_text()))
    flight.run("approaching")
    vehicle = flight.fleet.vehicles[3]
    vehicle.mode, vehicle.failsafe, vehicle.stuck = Mode.RETURN, True, True
    fly(flight, 1.2)
    assert flight.controller.phase == "returning"
    flight.run("ended")
    assert ended(flight).result == "vehicle_failsafe"


def test_a_refused_mode_keeps_everyone_on_the_ground(flight: Flight) -> None:
    flight.fleet.vehicles[1].refuses = frozenset({CommandKind.SET_MODE})
    flight.run("ended")
    assert ended(flight).result == "mode_refused"
    assert not any(isinstance(c, Arm) for c in flight.commands)
    assert all(v.position == list(v.home) for v in flight.fleet.vehicles.values())


def test_a_failure_in_the_climb_brings_those_that_climb_home_and_launches_nobody(
    flight: Flight,
) -> None:
    flight.fleet.vehicles[2].refuses = frozenset({CommandKind.ARM})
    flight.run("ended")
    assert ended(flight).result == "arming_refused"
    first = flight.fleet.vehicles[1]
    assert not first.armed
    assert not first.failsafe
    assert math.dist(first.position, first.home) < 3.0
    assert all(flight.fleet.vehicles[s].position[2] == 0.0 for s in (2, 3, 4))


def test_a_vehicle_that_has_just_left_the_ground_is_brought_home_too(
    flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    # It does not count as airborne for three seconds, and it is the second to land.
    monkeypatch.setattr("tests.mission.fake_fleet.CLIMB_MPS", 1.0)
    vehicle = flight.fleet.vehicles[2]
    while vehicle.position[2] < 0.5:
        flight.step()
    flight.receive(OperatorRequest(received_s=flight.now, request="return_home"))
    flight.run("ended")
    assert not vehicle.failsafe
    assert not vehicle.armed
    assert ended(flight).result == "cancelled"


@pytest.mark.parametrize(
    ("says", "file", "sentence"),
    [
        ("px4", "ardupilot", "its autopilot is px4, not ardupilot (swarm.autopilot)"),
        ("ardupilot", "px4", "its autopilot is ardupilot, not px4 (swarm.autopilot)"),
        ("other", "auto", "its autopilot is neither ArduPilot nor PX4"),
    ],
)
def test_a_vehicle_that_is_not_what_the_file_says_is_named(
    says: Literal["ardupilot", "px4", "other"], file: str, sentence: str
) -> None:
    flight = Flight(parse_mission(short_mission_text(swarm__autopilot=file)))
    for vehicle in flight.fleet.vehicles.values():
        if file == "px4":
            vehicle.autopilot, vehicle.parameters = "px4", PX4_SAFE.copy()
    flight.fleet.vehicles[2].autopilot = says
    flight.run("ended")
    assert ended(flight).result == "not_ready"
    assert f"vehicle 2: {sentence}" in ended(flight).detail
    assert "vehicle 3" not in ended(flight).detail
