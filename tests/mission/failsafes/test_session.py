"""Failsafe parameters read, refused, set with consent, and restored, in virtual time."""

from __future__ import annotations

import itertools

import pytest

from swarmctl.commands import Arm, ReadParameter, WriteParameter
from swarmctl.decisions import MissionEnded, Notice
from swarmctl.events import CommandKind, OperatorRequest, ParameterValue
from swarmctl.mission.failsafes.session import FailsafeSession
from swarmctl.mission.mission_file_loading import parse_mission
from tests.mission.fake_fleet import ARDUPILOT_SAFE, PX4_SAFE, Flight
from tests.missions import short_mission_text

UNSAFE = ARDUPILOT_SAFE | {"FS_GCS_ENABLE": 0.0, "MAV_GCS_SYSID": 255.0}


def flight(*, set_failsafes: bool, autopilot: str = "auto") -> Flight:
    text = short_mission_text(swarm__set_failsafes=set_failsafes, swarm__autopilot=autopilot)
    return Flight(parse_mission(text))


def ended(flight: Flight) -> MissionEnded:
    (end,) = [d for d in flight.decisions if isinstance(d, MissionEnded)]
    return end


def texts(flight: Flight, level: str) -> list[str]:
    return [d.text for d in flight.decisions if isinstance(d, Notice) and d.level == level]


def writes(flight: Flight) -> list[tuple[int, str, float]]:
    return [
        (c.sysid, c.parameter, c.value) for c in flight.commands if isinstance(c, WriteParameter)
    ]


def test_safe_vehicles_are_flown_without_a_word_and_without_a_write() -> None:
    flown = flight(set_failsafes=True)
    flown.run("launching")
    assert writes(flown) == []
    assert texts(flown, "warning") == []


def test_unsafe_vehicles_are_refused_with_what_would_be_right() -> None:
    refused = flight(set_failsafes=False)
    refused.fleet.vehicles[3].parameters = UNSAFE.copy()
    refused.fleet.vehicles[4].parameters = UNSAFE | {"MAV_GCS_SYSID": 245.0}
    refused.run("ended")
    assert ended(refused).result == "unsafe_failsafes"
    assert ended(refused).detail == (
        "vehicles 3, 4: FS_GCS_ENABLE is 0, and should be 1 (it returns home when its ground"
        " station falls silent); vehicle 3: MAV_GCS_SYSID is 255, and should be 245 (this"
        " controller is the ground station it listens for). Set these on the vehicles, or let"
        " swarmctl set them for the flight with --set-failsafes or, in the mission,"
        " swarm.set_failsafes: true"
    )
    assert writes(refused) == []
    assert not any(isinstance(c, Arm) for c in refused.commands)


def test_a_refusal_speaks_the_vehicles_own_language() -> None:
    refused = flight(set_failsafes=False)
    for vehicle in refused.fleet.vehicles.values():
        vehicle.parameters["RTL_ALT_M"] = 60.0
    refused.run("checking")
    for sysid in refused.fleet.vehicles:
        refused.receive(
            ParameterValue(
                received_s=refused.now,
                sysid=sysid,
                parameter="RTL_ALT_M",
                value=60.0,
                own_name="RTL_ALT",
                own_unit=0.01,
            )
        )
    refused.run("ended")
    low = refused.controller.mission.swarm.vehicles[0]
    # 28 m above home, less a hair's breadth for the earth's curvature, rounded down.
    assert low.altitude_amsl_m - refused.controller.mission.origin.alt_amsl_m == 28.0
    assert "vehicle 1: RTL_ALT is 6000, and should be 2700" in ended(refused).detail


def test_with_consent_they_are_set_before_the_flight_and_restored_after_it() -> None:
    flown = flight(set_failsafes=True)
    vehicle = flown.fleet.vehicles[3]
    vehicle.parameters = UNSAFE.copy()
    flown.run("launching")
    assert vehicle.parameters == ARDUPILOT_SAFE
    flown.run("landing")
    assert vehicle.parameters == ARDUPILOT_SAFE
    # What the operator is told if he leaves the swarm now.
    assert flown.controller.unrestored_parameters == [
        "FS_GCS_ENABLE of vehicle 3, which was 0",
        "MAV_GCS_SYSID of vehicle 3, which was 255",
    ]
    flown.run("ended")
    assert ended(flown).result == "located"
    assert vehicle.parameters == UNSAFE
    assert flown.controller.unrestored_parameters == []
    assert not vehicle.armed
    assert writes(flown) == [
        (3, "FS_GCS_ENABLE", 1.0),
        (3, "MAV_GCS_SYSID", 245.0),
        (3, "FS_GCS_ENABLE", 0.0),
        (3, "MAV_GCS_SYSID", 255.0),
    ]


@pytest.mark.parametrize("refuses", [CommandKind.ARM, None])
def test_they_are_restored_after_a_failure_too(refuses: CommandKind | None) -> None:
    failed = flight(set_failsafes=True)
    for vehicle in failed.fleet.vehicles.values():
        vehicle.parameters = UNSAFE.copy()
    if refuses is None:
        # On the ground: the write is on its way when the operator changes his mind.
        while not writes(failed):
            failed.step()
        failed.receive(OperatorRequest(received_s=failed.now, request="return_home"))
    else:
        failed.fleet.vehicles[4].refuses = frozenset({refuses})
    failed.run("ended")
    assert ended(failed).result == ("cancelled" if refuses is None else "arming_refused")
    assert all(v.parameters == UNSAFE for v in failed.fleet.vehicles.values())
    assert texts(failed, "error")[1:] == []


def test_what_could_not_be_restored_is_named() -> None:
    flown = flight(set_failsafes=True)
    vehicle = flown.fleet.vehicles[3]
    vehicle.parameters = UNSAFE.copy()
    flown.run("landing")
    vehicle.ignores = frozenset({"FS_GCS_ENABLE"})
    flown.run("ended")
    assert texts(flown, "error") == [
        "could not restore FS_GCS_ENABLE of vehicle 3, which was 0: set it back yourself"
    ]
    assert vehicle.parameters["MAV_GCS_SYSID"] == 255.0


def test_the_restoring_is_tried_again() -> None:
    flown = flight(set_failsafes=True)
    vehicle = flown.fleet.vehicles[3]
    vehicle.parameters = UNSAFE.copy()
    flown.run("landing")
    vehicle.ignores = frozenset({"FS_GCS_ENABLE"})
    while len(writes(flown)) < 4:
        flown.step()
    vehicle.ignores = frozenset()
    flown.run("ended")
    assert texts(flown, "error") == []
    assert vehicle.parameters == UNSAFE


def test_a_vehicle_that_does_not_take_a_value_is_not_flown() -> None:
    refused = flight(set_failsafes=True)
    refused.fleet.vehicles[2].parameters = UNSAFE.copy()
    refused.fleet.vehicles[2].ignores = frozenset({"FS_GCS_ENABLE"})
    refused.run("ended")
    assert ended(refused).result == "not_ready"
    assert ended(refused).detail == "vehicle 2: it does not take FS_GCS_ENABLE = 1"
    assert refused.fleet.vehicles[2].parameters == UNSAFE


@pytest.mark.parametrize("consent", [True, False])
def test_nothing_is_set_or_judged_on_vehicles_that_cannot_fly_anyway(consent: bool) -> None:
    refused = flight(set_failsafes=consent)
    refused.fleet.vehicles[2].parameters = UNSAFE.copy()
    refused.fleet.vehicles[3].prearm_ok = False
    refused.run("ended")
    assert ended(refused).result == "not_ready"
    assert ended(refused).detail == ("vehicle 3: its own pre-arm checks do not pass (SYS_STATUS)")
    assert writes(refused) == []


def test_a_parameter_that_is_not_told_is_asked_for_again_and_then_named() -> None:
    refused = flight(set_failsafes=True)
    del refused.fleet.vehicles[2].parameters["MAV_GCS_SYSID"]
    refused.run("ended")
    assert ended(refused).detail == "vehicle 2: it has not told its MAV_GCS_SYSID"
    heard = flight(set_failsafes=True)
    del heard.fleet.vehicles[2].parameters["MAV_GCS_SYSID"]
    heard.run("checking")
    heard.fleet.vehicles[2].parameters["MAV_GCS_SYSID"] = 245.0
    heard.run("launching")


def test_a_parameter_that_older_firmware_does_not_have_is_not_missed() -> None:
    flown = flight(set_failsafes=False)
    assert flown.fleet.vehicles[2].parameters.pop("FS_GCS_TIMEOUT")
    flown.run("launching")
    assert texts(flown, "warning") == []


HANDS_OFF = {"FS_THR_ENABLE": 1.0, "BATT_FS_LOW_ACT": 0.0}


def test_what_had_better_be_set_is_said_once_for_all_and_does_not_keep_the_swarm_down() -> None:
    flown = flight(set_failsafes=False)
    for sysid in (1, 3):
        flown.fleet.vehicles[sysid].parameters |= HANDS_OFF
    flown.run("launching")
    assert texts(flown, "warning") == [
        "vehicles 1, 3: FS_OPTIONS is 16, and had better be 20 (in GUIDED it flies on when it"
        " loses a remote control)",
        "vehicles 1, 3: BATT_FS_LOW_ACT is 0, and had better be 2 (it returns home by itself when"
        " its battery is low)",
    ]
    assert writes(flown) == []


def test_with_consent_it_is_set_unless_it_depends_on_the_vehicle() -> None:
    flown = flight(set_failsafes=True)
    before = flown.fleet.vehicles[3].parameters | HANDS_OFF | {"BATT_LOW_VOLT": 0.0}
    flown.fleet.vehicles[3].parameters = before.copy()
    flown.run("launching")
    assert writes(flown) == [(3, "FS_OPTIONS", 20.0)]
    assert texts(flown, "warning") == [
        "vehicle 3: BATT_FS_LOW_ACT is 0, and had better be 2 (it returns home by itself when its"
        " battery is low)",
        "vehicle 3: BATT_LOW_VOLT is 0, and BATT_LOW_MAH, too, so its own battery failsafe never"
        " acts",
    ]
    flown.run("ended")
    assert flown.fleet.vehicles[3].parameters == before


@pytest.mark.parametrize("consent", [False, True])
def test_a_fence_of_its_own_is_the_operators_to_widen(consent: bool) -> None:
    flown = flight(set_failsafes=consent)
    flown.fleet.vehicles[2].parameters |= {"FENCE_ENABLE": 1.0, "FENCE_ALT_MAX": 20.0}
    flown.fleet.vehicles[3].parameters |= {"FS_GCS_ENABLE": 0.0}
    flown.run("ended")
    code, said = flown.controller.result
    assert code == "unsafe_failsafes"
    assert said.startswith(
        "vehicle 2: FENCE_ALT_MAX is 20, and the mission flies higher above its home: its own"
        " fence would end the flight. Change that on the vehicles, or fly lower"
    )
    assert ("vehicle 3: FS_GCS_ENABLE is 0" in said) is not consent
    assert writes(flown) == []


def test_what_a_flight_may_do_without_is_asked_for_twice_and_then_said() -> None:
    flown = flight(set_failsafes=True)
    del flown.fleet.vehicles[2].parameters["BATT_FS_LOW_ACT"]
    flown.run("ended")
    assert ended(flown).detail == "vehicle 2: it has not told its BATT_FS_LOW_ACT"
    flown = flight(set_failsafes=True)
    del flown.fleet.vehicles[2].parameters["BATT_LOW_VOLT"]
    flown.run("launching")
    asked = [c for c in flown.commands if isinstance(c, ReadParameter)]
    assert sum(c.sysid == 2 and c.parameter == "BATT_LOW_VOLT" for c in asked) == 2
    assert texts(flown, "warning") == [
        "vehicle 2 has not told its BATT_LOW_VOLT: nobody looked at what it is"
    ]


def test_a_vehicle_that_tells_no_parameter_is_not_flown() -> None:
    """Nobody knows what it does when the ground station is lost."""
    flown = flight(set_failsafes=True)
    flown.fleet.vehicles[4].parameters = {}
    flown.run("ended")
    assert flown.controller.result[0] == "not_ready"
    assert "vehicle 4: it has not told its FS_GCS_ENABLE" in flown.controller.result[1]
    assert "launching" not in flown.phases()


def told(sysid: int, parameter: str, value: float, received_s: float) -> ParameterValue:
    return ParameterValue(
        received_s=received_s, sysid=sysid, parameter=parameter, value=value, own_name=parameter
    )


def test_a_value_the_vehicle_made_of_ours_is_not_taken_for_its_own() -> None:
    flown = flight(set_failsafes=True)
    flown.run("launching")  # everything is known and safe
    fleet = flown.controller.fleet
    session = FailsafeSession(flown.controller.mission, fleet)
    fleet.observe(told(3, "FS_GCS_ENABLE", 0.0, 100.0))
    assert len(session.step(100.0, may_set=True)) == 1
    fleet.observe(told(3, "FS_GCS_ENABLE", 3.0, 101.0))
    assert len(session.step(110.0, may_set=True)) == 1
    (write,) = session.restore(120.0)
    assert write == WriteParameter(sysid=3, parameter="FS_GCS_ENABLE", value=0.0)


def test_what_was_told_before_the_old_value_was_sent_does_not_end_the_restoring() -> None:
    flown = flight(set_failsafes=True)
    flown.run("launching")
    fleet = flown.controller.fleet
    session = FailsafeSession(flown.controller.mission, fleet)
    fleet.observe(told(3, "FS_GCS_ENABLE", 0.0, 100.0))
    session.step(100.0, may_set=True)  # on its way, and not yet answered
    session.restore(100.5)
    assert not session.is_restored(100.5)
    fleet.observe(told(3, "FS_GCS_ENABLE", 0.0, 101.0))
    assert session.is_restored(101.0)


def test_px4_is_asked_for_its_own_parameters() -> None:
    flown = flight(set_failsafes=True, autopilot="px4")
    for vehicle in flown.fleet.vehicles.values():
        vehicle.by_stream = True
        vehicle.parameters = PX4_SAFE | {"NAV_DLL_ACT": 0.0, "RTL_RETURN_ALT": 60.0}
    flown.run("launching")
    origin = flown.controller.mission.origin.alt_amsl_m
    for given in flown.controller.mission.swarm.vehicles:
        vehicle = flown.fleet.vehicles[given.sysid]
        assert vehicle.parameters["NAV_DLL_ACT"] == 2.0
        least = vehicle.parameters["RTL_RETURN_ALT"]
        assert max(60.0, given.altitude_amsl_m - origin) >= least
    returns = sorted(
        max(v.altitude_amsl_m, origin + flown.fleet.vehicles[v.sysid].parameters["RTL_RETURN_ALT"])
        for v in flown.controller.mission.swarm.vehicles
    )
    assert min(b - a for a, b in itertools.pairwise(returns)) >= 8.0
