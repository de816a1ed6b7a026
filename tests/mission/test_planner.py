"""The planned motion in virtual time, without vehicles: they are where the plan is."""

import math
from dataclasses import replace

import numpy as np
import pytest

from swarmctl.errors import FormationError
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.mission_file_loading import load_mission, parse_mission
from swarmctl.mission.phases import Phase
from swarmctl.mission.planner import PlannedMotion, Planner
from swarmctl.mission.target import Target
from tests.missions import DEMO, short_mission_text

DT = 0.1
LAUNCH = np.array([[20.0 * i, 0.0] for i in range(4)])


@pytest.fixture
def mission() -> Mission:
    return load_mission(DEMO)


def target(
    east: float = 2240.0,
    north: float = 1110.0,
    *,
    drift: tuple[float, float] = (0.0, 0.0),
    sigma_m: float = 2.0,
    speed_sigma_mps: float = 0.1,
) -> Target:
    covariance = (sigma_m**2, 0.0, sigma_m**2)
    return Target((east, north, -2.5), (*drift, 0.0), sigma_m, speed_sigma_mps, covariance)


def formed(mission: Mission, aim: Target) -> Planner:
    """A planner whose formation stands."""
    planner = Planner(mission)
    planner.begin(LAUNCH, aim)
    for _ in range(1000):
        planner.step(Phase.FORMING, aim, 0.0, LAUNCH, DT)
    return planner


def ranges(planned: PlannedMotion) -> np.ndarray:
    distance: np.ndarray = np.hypot.reduce(planned.positions[1:] - planned.positions[0], axis=1)
    return distance


def test_forming_up_holds_the_reference_and_ends_in_the_slots(mission: Mission) -> None:
    planner = formed(mission, target())
    planned = planner.step(Phase.FORMING, target(), 0.0, LAUNCH, DT)
    assert planned.positions[0, :2] == pytest.approx(LAUNCH[0], abs=1e-6)
    assert np.linalg.norm(planned.positions - planned.slots, axis=1).max() < 0.1
    assert ranges(planned) == pytest.approx([285.0] * 3, abs=0.2)


def along_and_across(planned: PlannedMotion) -> tuple[np.ndarray, np.ndarray]:
    """Companions' offsets along and across the LOS to the target, sorted, m."""
    los = math.atan2(1110.0, 2240.0)
    ahead = np.array([math.cos(los), math.sin(los)])
    left = np.array([-ahead[1], ahead[0]])
    offsets = planned.positions[1:, :2] - planned.positions[0, :2]
    return np.sort(offsets @ ahead), np.sort(offsets @ left)


@pytest.mark.parametrize(("design", "lean"), [("paper", 0.0), ("optimal", 285.0 / 2500.0)])
def test_the_slots_are_across_the_line_of_sight_and_behind(design: str, lean: float) -> None:
    """The best formation's ends stand where the emitter's rays touch the circle: cos = d / R."""
    mission = parse_mission(
        short_mission_text(
            formation__design=design,
            limits__d_max_m=300,
            emitter__lat_deg=54.4420,
            emitter__lon_deg=11.2240,
        )
    )
    planned = formed(mission, target()).step(Phase.FORMING, target(), 0.0, LAUNCH, DT)
    along, across = along_and_across(planned)
    forward = 284.0 * lean
    assert along == pytest.approx([-284.0, forward, forward], abs=1.5)
    aside = 284.0 * math.sqrt(1.0 - lean**2)
    assert across == pytest.approx([-aside, 0.0, aside], abs=1.5)


@pytest.mark.parametrize(
    "drift",
    [
        (1.4, 0.5),
        pytest.param((0.0, 0.0), marks=pytest.mark.slow),
        pytest.param((-1.0, -1.0), marks=pytest.mark.slow),
    ],
)
def test_a_plan_keeps_every_limit_all_the_way(mission: Mission, drift: tuple[float, float]) -> None:
    aim = target(drift=drift)
    planner = formed(mission, aim)
    limits = mission.limits
    last = None
    for step in range(6000):
        aim = target(2240.0 + drift[0] * step * DT, 1110.0 + drift[1] * step * DT, drift=drift)
        phase = Phase.ORBITING if planner.at_radius(aim) else Phase.APPROACHING
        planned = planner.step(phase, aim, 0.0, LAUNCH, DT)
        assert not planned.broken
        speeds = np.linalg.norm(planned.velocities[:, :2], axis=1)
        assert speeds.max() <= limits.max_speed_mps + 1e-9
        if last is not None:
            change = np.linalg.norm(planned.velocities - last.velocities, axis=1).max() / DT
            assert change <= limits.max_acceleration_mps2 + 1e-9
            moved = (planned.positions - last.positions)[:, :2] / DT
            mean = 0.5 * (planned.velocities + last.velocities)[:, :2]
            assert moved == pytest.approx(mean, abs=1e-6)
        away = np.linalg.norm(planned.positions - np.array(aim.position_enu), axis=1)
        assert away.min() >= limits.stand_off_m + 12.0
        assert ranges(planned).max() <= limits.d_max_m
        # After the first seconds of each phase followers fly in their slots.
        assert np.linalg.norm(planned.positions - planned.slots, axis=1).max() < 5.0
        last = planned
    assert planner.to_orbit_m(aim) == pytest.approx(0.0, abs=3.0)


def test_the_altitude_above_the_sea_is_kept_where_the_earth_falls_away(mission: Mission) -> None:
    planner = Planner(mission)
    far = LAUNCH + np.array([3000.0, 0.0])
    planner.begin(far, target())
    planned = planner.step(Phase.RETURNING, target(), 0.0, LAUNCH, DT)
    for vehicle, position in zip(mission.swarm.vehicles, planned.positions, strict=True):
        altitude = mission.frame.to_geodetic(*position)[2]
        assert altitude == pytest.approx(vehicle.altitude_amsl_m, abs=0.02)


def test_an_estimate_that_is_not_sharp_is_not_approached(mission: Mission) -> None:
    aim = target(sigma_m=600.0)
    planner = formed(mission, aim)
    for _ in range(3000):
        planned = planner.step(Phase.APPROACHING, aim, 0.0, LAUNCH, DT)
    away = math.dist(planned.positions[0, :2], aim.position_enu[:2])
    assert away == pytest.approx(1800.0, abs=20.0)


def test_the_swarm_flies_as_fast_as_its_slowest_vehicle_can_follow() -> None:
    """Vehicle 3 manages 6 m/s and 1 m/s²; cruise is 10 m/s."""
    slow = {"sysid": 3, "altitude_amsl_m": 54, "max_speed_mps": 6.0, "max_acceleration_mps2": 1.0}
    vehicles = [{"sysid": i, "altitude_amsl_m": 18 + 12 * i} for i in (1, 2, 4)]
    mission = parse_mission(short_mission_text(swarm__vehicles=[*vehicles, slow]))
    row = mission.swarm.sysids.index(3)
    aim = target(900.0, 450.0)
    planner = formed(mission, aim)
    last, fastest = None, 0.0
    for _ in range(3000):
        phase = Phase.ORBITING if planner.at_radius(aim) else Phase.APPROACHING
        planned = planner.step(phase, aim, 0.0, LAUNCH, DT)
        assert not planned.broken
        speed = float(np.linalg.norm(planned.velocities[row]))
        assert speed <= 6.0 + 1e-9
        fastest = max(fastest, speed)
        if last is not None:
            change = float(np.linalg.norm(planned.velocities[row] - last.velocities[row]))
            assert change <= 1.0 * DT + 1e-9
        assert np.linalg.norm(planned.positions - planned.slots, axis=1).max() < 8.0
        last = planned
    assert fastest > 5.0
    assert planner.at_radius(aim)


def test_when_the_reference_is_lost_the_best_placed_companion_leads(mission: Mission) -> None:
    """The one behind: either end would leave the other end twice as far away."""
    aim = target()
    planner = formed(mission, aim)
    planned = planner.step(Phase.APPROACHING, aim, 0.0, LAUNCH, DT)
    los = np.array(aim.position_enu[:2]) - planned.positions[0, :2]
    along = (planned.positions[1:, :2] - planned.positions[0, :2]) @ los
    behind = 1 + int(np.argmin(along))

    planner.succeed(aim)
    assert planner.reference == behind
    assert sorted([0, behind, *planner.companions]) == [0, 1, 2, 3]
    assert planner.returning == set(planner.companions)
    lost_at, least = planned.positions[0], math.inf
    for _ in range(1200):
        planned = planner.step(Phase.APPROACHING, aim, 0.0, LAUNCH, DT)
        assert not planned.broken
        flying = planned.positions[[behind, *planner.companions]]
        gaps = np.linalg.norm(flying[:, None] - flying[None], axis=-1)
        least = min(least, float(gaps[np.triu_indices(3, 1)].min()))
    assert planned.positions[0] == pytest.approx(lost_at, abs=0.1), "nobody plans for it"
    assert least >= mission.limits.min_separation_m
    assert not planner.returning
    reach = np.linalg.norm(planned.positions[list(planner.companions)] - planned.positions[behind])
    assert 0.0 < reach <= math.sqrt(2.0) * mission.limits.d_max_m

    planner.add(0, planned.positions[0, :2])
    assert planner.reference == behind, "it comes back as a companion"
    assert 0 in planner.companions


def test_the_reference_waits_for_followers_that_fall_behind(mission: Mission) -> None:
    planner = formed(mission, target())
    for _ in range(300):
        planned = planner.step(Phase.APPROACHING, target(), 0.0, LAUNCH, DT)
    assert np.linalg.norm(planned.velocities[0]) == pytest.approx(10.0, abs=0.01)
    for _ in range(300):
        planned = planner.step(Phase.APPROACHING, target(), 13.0, LAUNCH, DT)
    assert np.linalg.norm(planned.velocities[0]) == pytest.approx(0.0, abs=0.01)


def test_a_doubtful_velocity_of_the_emitter_is_not_fed_forward() -> None:
    assert target(drift=(1.0, 2.0), speed_sigma_mps=0.4).trusted_velocity == (1.0, 2.0)
    assert target(drift=(1.0, 2.0), speed_sigma_mps=0.6).trusted_velocity == (0.0, 0.0)


def test_an_estimate_that_jumps_turns_the_formation_no_faster_than_it_can_fly(
    mission: Mission,
) -> None:
    planner = formed(mission, target())
    aim = target(1110.0, 2240.0)
    for _ in range(600):
        planned = planner.step(Phase.APPROACHING, aim, 0.0, LAUNCH, DT)
        assert np.linalg.norm(planned.velocities, axis=1).max() <= 13.0 + 1e-9
        assert not planned.broken
    assert planned.los.angle_rad == pytest.approx(math.atan2(2240.0, 1110.0), abs=0.3)


def test_the_way_home_leads_round_the_emitter(mission: Mission) -> None:
    # The emitter lies between the swarm and home.
    planner = Planner(mission)
    beyond = LAUNCH * 5.0 + np.array([2800.0, 1388.0])
    planner.begin(beyond, target())
    for _ in range(4500):
        planned = planner.step(Phase.RETURNING, target(), 0.0, LAUNCH, DT)
        away = np.linalg.norm(planned.positions - np.array(target().position_enu), axis=1)
        assert away.min() >= mission.limits.stand_off_m
        assert not planned.broken
    assert np.linalg.norm(planned.positions[:, :2] - LAUNCH, axis=1).max() < 0.1


def test_a_plan_that_would_break_a_limit_is_held(mission: Mission) -> None:
    planner = formed(mission, target())
    good = planner.step(Phase.APPROACHING, target(), 0.0, LAUNCH, DT)
    near = target(good.positions[0, 0] + 100.0, good.positions[0, 1])
    held = planner.step(Phase.APPROACHING, near, 0.0, LAUNCH, DT)
    assert "a stand-off of" in held.broken[0]
    assert held.positions == pytest.approx(good.positions)
    assert not held.velocities.any()


def test_a_formation_that_would_orbit_outside_the_fence_is_refused() -> None:
    """The circle has a slot ahead of the reference, which must stay that much farther off."""
    fence = {"limits__geofence_radius_m": 1400}
    Planner(parse_mission(short_mission_text(**fence)))
    with pytest.raises(
        FormationError, match=r"orbits 5\d\d m from the emitter and reaches 1\d\d\d"
    ):
        Planner(parse_mission(short_mission_text(formation__design="uniform", **fence)))


def test_a_formation_that_does_not_fit_is_refused_before_anything_flies() -> None:
    vehicles = [{"sysid": i, "altitude_amsl_m": 20 + 8 * i} for i in range(1, 12)]
    text = short_mission_text(swarm__vehicles=vehicles)
    mission = parse_mission(text)
    tight = mission.limits.model_copy(update={"d_max_m": 105.0, "min_separation_m": 60.0})
    with pytest.raises(FormationError, match=r"10 companions .* do not fit within 90 m"):
        Planner(mission.model_copy(update={"limits": tight}))


def test_a_range_that_one_companion_cannot_see_is_approached_by_a_dog_leg() -> None:
    vehicles = [{"sysid": i, "altitude_amsl_m": 20 + 12 * i} for i in (1, 2)]
    mission = parse_mission(
        short_mission_text(swarm__vehicles=vehicles, formation__min_companions=1)
    )
    los = math.atan2(1110.0, 2240.0)
    along = np.array([math.cos(los), math.sin(los), 0.0, 0.0])
    blind = np.diag([4.0, 4.0, 0.01, 0.01]) + 380.0**2 * np.outer(along, along)

    def courses(track_covariance: np.ndarray | None) -> float:
        aim = replace(target(sigma_m=380.0), track_covariance=track_covariance)
        planner = Planner(mission)
        planner.begin(LAUNCH[:2], aim)
        for _ in range(100):
            planned = planner.step(Phase.APPROACHING, aim, 0.0, LAUNCH[:2], DT)
        return float(planned.velocities[0, :2] @ [-math.sin(los), math.cos(los)])

    assert courses(None) == pytest.approx(0.0, abs=0.1)
    assert abs(courses(blind)) > 5.0


def test_a_formation_that_faces_another_way_turns_before_it_goes_on(mission: Mission) -> None:
    """The estimate moves aside by 85°, too little to face about: the reference UAV waits."""
    planner = formed(mission, target())
    for _ in range(100):
        planner.step(Phase.APPROACHING, target(), 0.0, LAUNCH, DT)
    aside = target(-1000.0, 2000.0)
    speeds, turned = [], []
    for _ in range(900):
        planned = planner.step(Phase.APPROACHING, aside, 0.0, LAUNCH, DT)
        assert not planned.broken
        east, north = (np.array(aside.position_enu[:2]) - planned.positions[0, :2]).tolist()
        speeds.append(float(np.linalg.norm(planned.velocities[0])))
        turned.append(abs(math.atan2(north, east) - planned.los.angle_rad))
        assert np.linalg.norm(planned.positions - planned.slots, axis=1).max() < 12.0
    assert turned[0] > math.radians(80.0)
    assert min(speeds) < 0.1
    assert turned[-1] < math.radians(20.0)
    assert speeds[-1] > 8.0
