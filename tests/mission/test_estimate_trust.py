"""What the track's health does to the swarm."""

import math
from dataclasses import replace

import numpy as np
import pytest

from swarmctl.decisions import HealthChanged, MissionEnded, Notice, Plan
from swarmctl.mission.estimate_trust import EstimateTrust, Trust
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.mission.target import Target
from tests.mission.fake_fleet import Flight
from tests.missions import short_mission_text

HERE = Target((1000.0, 500.0, 0.0), (1.0, 0.5, 0.0), 20.0, 0.1, (400.0, 0.0, 400.0))
THERE = replace(HERE, position_enu=(-3000.0, 0.0, 0.0))


def test_a_track_leads_until_it_is_lost_and_then_the_last_belief_bounds() -> None:
    trusted = EstimateTrust(HERE)
    for status, level in (
        ("initialising", Trust.FULL),
        ("tracking", Trust.FULL),
        ("degraded", Trust.LITTLE),
    ):
        trusted.review(HERE, status, restarted=False)  # type: ignore[arg-type]
        assert (trusted.level, trusted.target) == (level, HERE)
    for status in ("diverged", "initialising"):
        trusted.review(THERE, status, restarted=True)  # type: ignore[arg-type]
        assert trusted.level is Trust.NONE
        assert trusted.target.position_enu == HERE.position_enu
        assert trusted.target.trusted_velocity == (0.0, 0.0)
    trusted.review(THERE, "tracking", restarted=True)
    assert (trusted.level, trusted.target) == (Trust.FULL, THERE)


@pytest.fixture(params=[pytest.param("tracker", marks=pytest.mark.slow), "ncrkf"])
def flight(request: pytest.FixtureRequest) -> Flight:
    return Flight(parse_mission(short_mission_text(filter__kind=request.param)))


def statuses(flight: Flight) -> list[str]:
    return [d.status for d in flight.decisions if isinstance(d, HealthChanged)]


def fly(flight: Flight, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        flight.step()


def test_a_good_feed_is_trusted_throughout(flight: Flight) -> None:
    flight.run("ended")
    assert statuses(flight) == ["tracking"]


def test_an_emitter_that_is_suddenly_elsewhere_is_sought_again_while_the_swarm_holds(
    flight: Flight,
) -> None:
    flight.run("approaching")
    fly(flight, 10.0)
    flight.fleet.emitter = flight.fleet.emitter + np.array([0.0, 250.0, 0.0])
    fly(flight, 8.0)
    assert "diverged" in statuses(flight)
    lost = next(
        d.at_s for d in flight.decisions if isinstance(d, HealthChanged) and d.status == "diverged"
    )
    flight.run("ended")
    found = next(
        d.at_s
        for d in flight.decisions
        if isinstance(d, HealthChanged) and d.status == "tracking" and d.at_s > lost
    )
    assert found - lost < 10.0
    (end,) = [d for d in flight.decisions if isinstance(d, MissionEnded)]
    assert end.result == "located"
    estimate = flight.controller.tracking.target.position_enu
    assert math.dist(estimate[:2], flight.fleet.emitter[:2]) < 40.0
    # It brakes within a second or two, and then nobody's plan moves until there is a track.
    held = [d for d in flight.decisions if isinstance(d, Plan) and lost + 4.0 < d.at_s < found]
    assert all(math.hypot(*s.velocity_enu) < 0.5 for plan in held for s in plan.slots)
    texts = [d.text for d in flight.decisions if isinstance(d, Notice)]
    assert sum("The track is lost" in text for text in texts) == statuses(flight).count("diverged")


def test_noise_that_is_larger_than_claimed_freezes_the_design_and_is_told(flight: Flight) -> None:
    flight.fleet.claimed_sigma_m = 1.8
    flight.run("ended")
    assert statuses(flight)[:2] == ["tracking", "degraded"]
    (end,) = [d for d in flight.decisions if isinstance(d, MissionEnded)]
    assert end.result == "located"
    assert "if that may be believed" in end.detail
