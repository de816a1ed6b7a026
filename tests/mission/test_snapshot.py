"""The picture of a mission that the console and the page show."""

import math

from swarmctl.events import LinkQuality
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.mission.snapshot import take_snapshot
from tests.mission.fake_fleet import Flight
from tests.missions import short_mission_text

MISSION = parse_mission(short_mission_text())


def test_before_anything_is_heard_nothing_is_claimed() -> None:
    shown = take_snapshot(Flight(MISSION).controller, 0.0)
    assert (shown.mission, shown.phase, shown.elapsed_s) == ("short", "waiting", 0.0)
    assert [v.sysid for v in shown.vehicles] == [1, 2, 3, 4]
    for vehicle in shown.vehicles:
        assert vehicle.is_reference == (vehicle.sysid == 1)
        assert (vehicle.mode, vehicle.armed, vehicle.silence_s) == ("", False, math.inf)
        assert vehicle.alt_amsl_m is vehicle.slot_error_m is vehicle.battery_fraction is None
        assert (vehicle.loss, vehicle.rate_hz, vehicle.rtt_s) == (0.0, 0.0, None)
    assert shown.estimate.age_s == math.inf
    assert (shown.rd_used, shown.rd_aside, shown.rd_dropped) == (0, 0, 0)


def test_in_flight_it_shows_slots_links_and_what_was_measured() -> None:
    flight = Flight(MISSION)
    flight.run("forming")
    for _ in range(50):
        flight.step()
    flight.receive(
        LinkQuality(
            received_s=flight.now,
            sysid=2,
            messages_in=30,
            lost=10,
            rate_hz=12.0,
            rtt_s=0.2,
            boot_offset_s=None,
            boot_offset_error_s=None,
            utc_error_s=None,
        )
    )
    shown = take_snapshot(flight.controller, flight.now)
    assert shown.phase == "forming"
    assert shown.elapsed_s == flight.now
    assert all(v.armed and v.mode == "GUIDED" for v in shown.vehicles)
    assert all(v.silence_s <= 1.0 and v.battery_fraction == 0.9 for v in shown.vehicles)
    lead, second = shown.vehicles[:2]
    assert lead.range_to_reference_m is None
    apart = math.dist(*(flight.fleet.vehicles[s].position for s in (1, 2)))
    assert second.range_to_reference_m is not None
    assert abs(second.range_to_reference_m - apart) < 5.0
    assert second.slot_error_m is not None
    assert (second.loss, second.rate_hz, second.rtt_s) == (0.25, 12.0, 0.2)
    assert shown.rd_used == flight.controller.tracking.counts.used > 0
    assert 0.0 <= shown.estimate.age_s < 1.0
