"""The controller core in virtual time, against vehicles made of observations."""

import math

import numpy as np
import pytest

from swarmctl.commands import Arm, GoTo, SetMode, UploadFence
from swarmctl.decisions import MissionEnded, Notice, PhaseChanged, Plan
from swarmctl.events import CommandKind, CommandOutcome, FeedConnection, Mode, OperatorRequest
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.mission_file_loading import parse_mission
from tests.mission.fake_fleet import UTC0, Flight
from tests.missions import short_mission_text


@pytest.fixture
def mission() -> Mission:
    return parse_mission(short_mission_text())


def ended(flight: Flight) -> MissionEnded:
    ends = [d for d in flight.decisions if isinstance(d, MissionEnded)]
    assert len(ends) == 1
    return ends[0]


def notices(flight: Flight) -> str:
    return "\n".join(d.text for d in flight.decisions if isinstance(d, Notice))


def test_a_whole_mission(mission: Mission) -> None:
    flight = Flight(mission)
    flight.run("ended")
    assert ended(flight).result == "located"
    assert flight.phases() == [
        "waiting",
        "checking",
        "launching",
        "forming",
        "approaching",
        "orbiting",
        "returning",
        "landing",
        "ended",
    ]
    limits = mission.limits
    assert flight.least_separation_m >= limits.min_separation_m
    assert flight.least_stand_off_m >= limits.stand_off_m
    for vehicle in flight.fleet.vehicles.values():
        assert not vehicle.armed
        assert math.dist(vehicle.position, vehicle.home) < 3.0
    plans = [d for d in flight.decisions if isinstance(d, Plan) and d.formed]
    reach = [s.range_to_reference_m or 0.0 for plan in plans for s in plan.slots]
    assert 130.0 < max(reach) <= limits.d_max_m


def test_every_setpoint_respects_every_limit(mission: Mission) -> None:
    flight = Flight(mission)
    flight.run("ended")
    altitudes = {v.sysid: v.altitude_amsl_m for v in mission.swarm.vehicles}
    setpoints = [c for c in flight.commands if isinstance(c, GoTo)]
    assert len(setpoints) > 5_000
    for setpoint in setpoints:
        east, north, _ = mission.frame.to_enu(
            setpoint.lat_rad, setpoint.lon_rad, setpoint.alt_amsl_m
        )
        assert setpoint.alt_amsl_m == altitudes[setpoint.sysid]
        assert math.hypot(east, north) <= mission.limits.geofence_radius_m
        assert math.hypot(*setpoint.velocity_enu[:2]) <= mission.limits.max_speed_mps + 1e-6


def test_the_same_observations_give_the_same_commands(mission: Mission) -> None:
    one, two = Flight(mission), Flight(mission)
    for flight in (one, two):
        flight.run("approaching")
    assert one.commands == two.commands
    assert one.decisions == two.decisions


def test_a_vehicle_that_never_answers_is_named(mission: Mission) -> None:
    flight = Flight(mission)
    flight.fleet.vehicles[3].silent = True
    flight.run("ended")
    assert ended(flight).result == "vehicle_silent"
    assert "vehicle 3 never answered on udpin://127.0.0.1:14550 within 30 s" in ended(flight).detail
    assert not any(isinstance(c, Arm) for c in flight.commands)


def test_a_vehicle_that_refuses_to_arm_brings_the_airborne_home_first(mission: Mission) -> None:
    flight = Flight(mission)
    flight.fleet.vehicles[4].refuses = frozenset({CommandKind.ARM})
    flight.run("ended")
    assert ended(flight).result == "arming_refused"
    assert "vehicle 4 refused to arm (FAILED (Arm: Compass not healthy))" in ended(flight).detail
    assert flight.phases()[-3:] == ["returning", "landing", "ended"]
    assert max(v.position[2] for v in flight.fleet.vehicles.values()) < 0.1
    landed = {c.sysid for c in flight.commands if isinstance(c, SetMode) and c.mode is Mode.LAND}
    assert landed == {1, 2, 3}


@pytest.mark.parametrize(
    ("attribute", "value", "says"),
    [
        ("prearm_ok", False, "vehicle 2: its own pre-arm checks do not pass (SYS_STATUS)"),
        ("battery", 0.2, "vehicle 2: its battery is at 20%, the reserve is 25%"),
        ("home", (0.0, 0.0, 60.0), "it stands at 62 m AMSL, not 5 m below its flight altitude"),
        ("home", (5000.0, 0.0, 0.0), "outside the geofence of 4000 m"),
        ("home", (300.0, 500.0, 0.0), "nearer than the stand-off of 400 m"),
        ("ignores", frozenset({"RequestVersion"}), "it has not told its hardware id"),
        ("ignores", frozenset({"RequestHome"}), "it has no home position"),
        ("ignores", frozenset({"StreamTelemetry"}), "it does not report its position"),
        ("position_every", 6, "it reports its position 1.7 times a second; 2 times a second are"),
        ("armed", True, "vehicle 2: it is armed already; land and disarm it first"),
        ("uid", 1, "vehicles 1 and 2 have one hardware id"),
        ("home", (3.0, 0.0, 0.0), "vehicles 1 and 2 stand 3.0 m apart, less than"),
    ],
)
def test_a_vehicle_that_is_not_ready_is_named(
    mission: Mission, attribute: str, value: object, says: str
) -> None:
    flight = Flight(mission)
    setattr(flight.fleet.vehicles[2], attribute, value)
    flight.run("ended")
    assert ended(flight).result == "not_ready"
    assert says in ended(flight).detail
    assert not any(isinstance(c, Arm) for c in flight.commands)


def test_a_fence_is_uploaded_to_every_vehicle_if_the_mission_says_so() -> None:
    flight = Flight(parse_mission(short_mission_text(limits__upload_geofence=True)))
    flight.run("launching")
    mission = flight.controller.mission
    fences = [c for c in flight.commands if isinstance(c, UploadFence)]
    assert [f.sysid for f in fences] == [1, 2, 3, 4]
    for fence in fences:
        assert (fence.lat_rad, fence.lon_rad) == mission.origin.geodetic[:2]
        assert fence.radius_m == mission.limits.geofence_radius_m + 30.0


def test_a_vehicle_that_does_not_take_its_fence_is_asked_again_and_then_named() -> None:
    flight = Flight(parse_mission(short_mission_text(limits__upload_geofence=True)))
    flight.fleet.vehicles[2].refuses = frozenset({CommandKind.UPLOAD_FENCE})
    flight.run("ended")
    assert ended(flight).result == "not_ready"
    assert "vehicle 2: it has not taken the geofence (FAILED" in ended(flight).detail
    fenced = [c.sysid for c in flight.commands if isinstance(c, UploadFence)]
    assert (fenced.count(1), fenced.count(2)) == (1, 4)


def test_no_fence_is_uploaded_unasked(mission: Mission) -> None:
    flight = Flight(mission)
    flight.run("launching")
    assert not any(isinstance(c, UploadFence) for c in flight.commands)


def test_clocks_that_run_at_another_speed_are_refused_before_take_off(mission: Mission) -> None:
    flight = Flight(mission)
    for vehicle in flight.fleet.vehicles.values():
        vehicle.clock_rate = 20.0
    flight.run("ended")
    assert ended(flight).result == "clock_mismatch"
    assert "runs 20 times as fast" in ended(flight).detail
    assert flight.now < 10.0


def test_the_others_close_up_and_fly_on_without_a_lost_companion(mission: Mission) -> None:
    flight = Flight(mission)
    flight.run("approaching")
    flight.fleet.vehicles[2].silent = True
    flight.run("returning")
    plans = [d for d in flight.decisions if isinstance(d, Plan) and d.formed]
    assert notices(flight).count("vehicle 2 has been silent for 5 s; flying on with 2") == 1
    assert flight.phases()[-2:] == ["orbiting", "returning"]
    # The two that are left stand where two should: one on each side.
    reference = np.array(plans[-1].slots[0].position_enu[:2])
    offsets = [np.array(plans[-1].slots[i].position_enu[:2]) - reference for i in (2, 3)]
    across = [-math.sin(plans[-1].los_rad), math.cos(plans[-1].los_rad)]
    assert sorted(float(np.sign(offset @ across)) for offset in offsets) == [-1.0, 1.0]
    flight.run("ended")
    assert ended(flight).result == "vehicle_lost"
    assert "is located to" in ended(flight).detail
    assert "but vehicle 2 has been silent for 5 s" in ended(flight).detail
    assert [v.sysid for v in flight.fleet.vehicles.values() if v.armed] == [2]
    assert flight.least_separation_m >= mission.limits.min_separation_m


def test_a_companion_that_is_heard_again_joins_the_formation(mission: Mission) -> None:
    flight = Flight(mission)
    flight.run("approaching")
    flight.fleet.vehicles[3].silent = True
    while "flying on with 2 companions" not in notices(flight):
        flight.step()
    flight.fleet.vehicles[3].silent = False
    flight.run("ended")
    assert "vehicle 3 is back in the formation" in notices(flight)
    assert ended(flight).result == "located"


@pytest.mark.parametrize(("sysid", "least"), [(2, 3), (1, 1)])
def test_a_vehicle_the_mission_cannot_do_without_brings_the_others_home(
    sysid: int, least: int
) -> None:
    """Too few companions are left, or the reference UAV is lost."""
    flight = Flight(parse_mission(short_mission_text(formation__min_companions=least)))
    flight.run("approaching")
    flight.fleet.vehicles[sysid].silent = True
    flight.run("ended")
    assert ended(flight).result == "vehicle_lost"
    assert "orbiting" not in flight.phases()
    assert f"vehicle {sysid} was not seen to land" in notices(flight)
    assert [v.sysid for v in flight.fleet.vehicles.values() if v.armed] == [sysid]


def test_a_vehicle_that_disarms_in_flight_is_a_loss() -> None:
    flight = Flight(parse_mission(short_mission_text(formation__min_companions=3)))
    flight.run("approaching")
    flight.fleet.vehicles[2].armed = False
    flight.run("ended")
    assert ended(flight).result == "vehicle_lost"
    assert "vehicle 2 disarmed in flight" in ended(flight).detail


def test_a_pilot_who_takes_over_is_not_fought(mission: Mission) -> None:
    flight = Flight(mission)
    flight.run("approaching")
    pilot = flight.fleet.vehicles[3]
    pilot.mode = Mode.OTHER
    pilot.goal = list(pilot.position)
    before = len(pilot.commands)
    flight.run("ended")
    assert ended(flight).result == "taken_over"
    # The heartbeat that tells us comes within a second.
    assert all(isinstance(c, GoTo) for c in pilot.commands[before:])
    assert len(pilot.commands) - before <= 11
    assert [v.sysid for v in flight.fleet.vehicles.values() if v.armed] == [3]


def test_a_silent_feed_brings_the_swarm_home(mission: Mission) -> None:
    flight = Flight(mission)
    flight.run("approaching")
    flight.fleet.feed_on = False
    silent_at = flight.now
    flight.run("returning")
    assert flight.now - silent_at == pytest.approx(mission.feed.timeout_s, abs=0.5)
    flight.run("ended")
    assert ended(flight).result == "feed_silent"
    assert "mqtt://127.0.0.1:18830" in ended(flight).detail


def test_a_low_battery_brings_the_swarm_home(mission: Mission) -> None:
    flight = Flight(mission)
    flight.run("approaching")
    flight.fleet.vehicles[1].battery = 0.24
    flight.run("ended")
    assert ended(flight).result == "low_battery"


def test_the_time_limit_brings_the_swarm_home(mission: Mission) -> None:
    goal = mission.goal.model_copy(update={"time_limit_s": 60.0})
    flight = Flight(mission.model_copy(update={"goal": goal}))
    flight.run("ended")
    assert ended(flight).result == "not_located"


@pytest.mark.parametrize("phase", ["launching", "forming", "approaching", "orbiting"])
def test_the_operator_can_ask_for_the_return_at_any_time(mission: Mission, phase: str) -> None:
    flight = Flight(mission)
    flight.run(phase)
    for _ in range(30):
        flight.step()
    flight.receive(OperatorRequest(received_s=flight.now, request="return_home"))
    assert flight.controller.phase == "returning"
    called = [d for d in flight.decisions if isinstance(d, PhaseChanged)][-1]
    assert called.trigger == "operator asked for the return"
    flight.run("ended")
    assert ended(flight).result == "cancelled"
    assert all(math.dist(v.position, v.home) < 3.0 for v in flight.fleet.vehicles.values())
    assert flight.least_separation_m >= mission.limits.min_separation_m
    assert flight.least_stand_off_m >= mission.limits.stand_off_m


def test_a_return_asked_for_before_take_off_ends_at_once(mission: Mission) -> None:
    flight = Flight(mission)
    flight.run("checking")
    flight.receive(OperatorRequest(received_s=flight.now, request="return_home"))
    assert flight.controller.ended
    assert not any(isinstance(c, Arm) for c in flight.commands)


def test_a_landing_that_is_refused_is_asked_for_again(mission: Mission) -> None:
    flight = Flight(mission)
    flight.run("landing")
    flight.fleet.vehicles[1].ignores = frozenset({CommandKind.SET_MODE})
    for _ in range(60):
        flight.step()
    assert flight.fleet.vehicles[1].armed
    flight.fleet.vehicles[1].ignores = frozenset()
    flight.run("ended")
    assert not flight.fleet.vehicles[1].armed


def test_the_broker_coming_and_going_is_said(mission: Mission) -> None:
    flight = Flight(mission)
    for connected in (False, True):
        flight.receive(FeedConnection(received_s=0.0, connected=connected))
    assert notices(flight) == "the broker is lost; reconnecting\nthe broker is back"


def test_outcomes_of_unknown_vehicles_are_harmless(mission: Mission) -> None:
    flight = Flight(mission)
    flight.run("launching")
    flight.receive(
        CommandOutcome(
            received_s=UTC0, sysid=99, command=CommandKind.ARM, result="refused", detail=""
        )
    )
    flight.run("forming")
