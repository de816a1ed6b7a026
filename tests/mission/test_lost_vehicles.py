"""Who flies on without a lost vehicle, and when one is taken in again."""

from __future__ import annotations

import numpy as np
import pytest

from swarmctl.mission.failure import Failure
from swarmctl.mission.loss_detection import LossDetection
from swarmctl.mission.lost_vehicles import LostVehicles
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.mission.phases import Phase
from swarmctl.mission.planner import Planner
from swarmctl.mission.target import Target
from swarmctl.results import MissionResult
from tests.mission.vehicles import beat, fleet_of, report
from tests.missions import short_mission_text

AIM = Target((1500.0, 700.0, 0.0), (0.0, 0.0, 0.0), 2.0, 0.1, (4.0, 0.0, 4.0))
LAUNCH = np.array([[20.0 * i, 0.0] for i in range(4)])


class Swarm:
    """Four vehicles in formation, the first of them the reference UAV."""

    def __init__(self, *, min_companions: int = 2) -> None:
        mission = parse_mission(short_mission_text(formation__min_companions=min_companions))
        self.fleet = fleet_of(mission)
        self.planner = Planner(mission)
        self.planner.begin(LAUNCH, AIM)
        self.lost = LostVehicles(mission, self.fleet, self.planner, LossDetection(0.0))

    def lose(
        self, sysid: int, phase: Phase = Phase.APPROACHING, *, rereferences: bool = True
    ) -> str | None:
        failure = Failure(MissionResult.VEHICLE_LOST, f"vehicle {sysid} is silent", sysid)
        return self.lost.do_without(failure, phase, AIM, rereferences=rereferences)


def test_the_others_close_up_when_a_companion_is_lost() -> None:
    swarm = Swarm()
    assert swarm.lose(3) == "vehicle 3 is silent; flying on with 2 companions"
    assert swarm.planner.companions == (1, 3)
    assert set(swarm.lost.failures) == {3}
    assert swarm.lost.reference == 1


def test_a_companion_leads_when_the_reference_is_lost_and_the_feed_can_follow() -> None:
    swarm = Swarm()
    told = swarm.lose(1)
    assert swarm.lost.reference != 1
    assert told == (
        f"vehicle 1 is silent; vehicle {swarm.lost.reference} is the reference UAV now, with"
        " 2 companions"
    )
    assert 0 not in swarm.planner.companions


def test_the_mission_ends_when_the_feed_cannot_do_without_the_reference() -> None:
    swarm = Swarm()
    assert swarm.lose(1, rereferences=False) is None
    assert swarm.lost.reference == 1
    assert not swarm.lost.failures
    assert swarm.lose(2, rereferences=False) is not None, "a companion's loss is no matter"


def test_the_mission_ends_below_the_fewest_companions() -> None:
    swarm = Swarm()
    swarm.lose(3)
    assert swarm.lose(4) is None
    assert swarm.planner.companions == (1, 3)
    one = Swarm(min_companions=1)
    one.lose(3)
    assert one.lose(4) == "vehicle 4 is silent; flying on with 1 companion"


@pytest.mark.parametrize("phase", [Phase.LAUNCHING, Phase.RETURNING, Phase.LANDING])
def test_a_loss_outside_the_formation_is_not_flown_on_with(phase: Phase) -> None:
    swarm = Swarm()
    assert swarm.lose(3, phase) is None
    assert len(swarm.planner.companions) == 3


def test_only_the_loss_of_a_vehicle_can_be_done_without() -> None:
    swarm = Swarm()
    other = next(r for r in MissionResult if r is not MissionResult.VEHICLE_LOST)
    for failure in (
        Failure(other, "vehicle 3 is at fault", 3),
        Failure(MissionResult.VEHICLE_LOST, "nobody knows who is silent"),
    ):
        assert swarm.lost.do_without(failure, Phase.ORBITING, AIM, rereferences=True) is None
    assert not swarm.lost.failures


def test_a_vehicle_heard_again_rejoins_where_it_is() -> None:
    swarm = Swarm()
    swarm.lose(3)
    vehicle = swarm.fleet.vehicles[3]
    assert swarm.lost.take_in_again(100.0, 50.0, lambda _: True) == [], "it is silent yet"
    beat(vehicle, 50.0)
    report(swarm.fleet, 3, (60.0, 40.0, 32.0), 50.0, utc_s=100.0)
    assert swarm.lost.take_in_again(None, 50.0, lambda _: True) == [], "UTC is not known"
    assert swarm.lost.take_in_again(100.0, 50.0, lambda _: False) == [], "it is not ours"
    assert swarm.lost.take_in_again(100.0, 56.0, lambda _: True) == [], "it is silent again"
    assert list(swarm.planner.companions) == [1, 3]
    told = swarm.lost.take_in_again(100.0, 50.0, lambda v: v is vehicle)
    assert told == ["vehicle 3 is back in the formation"]
    assert list(swarm.planner.companions) == [1, 3, 2]
    assert swarm.planner.returning == {2}
    assert not swarm.lost.failures
    planned = swarm.planner.step(Phase.APPROACHING, AIM, 0.0, LAUNCH, 0.1)
    assert planned.positions[2, :2] == pytest.approx([60.0, 40.0], abs=0.1)
