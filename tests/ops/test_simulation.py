"""A mission becomes the simulator's configuration."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from sim.config import ReceiverConfig
from swarmctl.errors import UsageError
from swarmctl.mission.mission_file_loading import load_mission, parse_mission
from swarmctl.ops.sim_config import sim_config, simulation_section
from swarmctl.ops.simulation import controller_addresses
from tests.link.signers import KEY
from tests.missions import DEMO, short_mission_text


def test_everything_the_mission_says_of_the_truth_is_handed_on() -> None:
    mission = load_mission(DEMO)
    config = sim_config(mission, None, 1000.0)
    assert config.swarm == "alpha"
    assert config.seed == 1
    assert config.utc_start_s == 1000.0
    assert [v.sysid for v in config.vehicles] == [1, 2, 3, 4]
    assert config.receivers.reference == 1
    assert (config.receivers.rate_hz, config.receivers.sigma_m, config.receivers.rho) == (
        10,
        3,
        0.5,
    )
    assert config.navigation.white_sigma_m == 0.5
    assert config.wind.gust_sigma_mps == 0.7
    assert config.emitter.wander_mps_per_sqrt_s == 0.02


@pytest.mark.parametrize("publish", ["range_differences", "arrival_times"])
def test_what_the_receivers_publish_is_handed_on(publish: str) -> None:
    receivers = {"publish": publish}
    mission = parse_mission(short_mission_text(sim__receivers=receivers))
    assert sim_config(mission, None, 0.0).receivers.publish == publish


def test_the_errors_of_the_receivers_are_handed_on_in_seconds() -> None:
    receivers = {
        "rate_hz": 0.02,
        "clock_bias_sigma_ns": 10,
        "clock_drift_sigma_ns_per_s": 0.2,
        "nlos_share": 0.05,
        "nlos_min_m": 20,
        "nlos_max_m": 80,
        "colour_sigma_m": 0.4,
        "colour_tau_s": 0.7,
    }
    mission = parse_mission(short_mission_text(sim__receivers=receivers))
    config = sim_config(mission, None, 0.0).receivers
    assert config.clock_bias_sigma_s == pytest.approx(10e-9)
    assert config.clock_drift_sigma == pytest.approx(0.2e-9)
    assert replace(config, clock_bias_sigma_s=0.0, clock_drift_sigma=0.0) == ReceiverConfig(
        reference=1,
        rate_hz=0.02,
        nlos_share=0.05,
        nlos_min_m=20.0,
        nlos_max_m=80.0,
        colour_sigma_m=0.4,
        colour_tau_s=0.7,
    )


def test_the_receivers_of_a_mission_that_says_nothing_of_it_are_good() -> None:
    config = sim_config(load_mission(DEMO), None, 0.0).receivers
    assert config == ReceiverConfig(reference=1)


def test_the_vehicles_have_the_manners_the_mission_says() -> None:
    def autopilots(**changes: object) -> set[str]:
        config = sim_config(parse_mission(short_mission_text(**changes)), None, 0.0)
        return {vehicle.autopilot for vehicle in config.vehicles}

    assert autopilots() == {"ardupilot"}
    assert autopilots(sim__autopilot="px4") == {"px4"}


def test_the_seed_can_be_overridden() -> None:
    assert sim_config(load_mission(DEMO), 7, 0.0).seed == 7


def test_a_course_is_where_the_emitter_drifts_to_and_a_wind_is_where_it_comes_from() -> None:
    config = sim_config(load_mission(DEMO), None, 0.0)
    # Course 70 degrees: mostly east, a little north.
    assert config.emitter.velocity_enu == pytest.approx((1.4095, 0.5130, 0.0), abs=1e-4)
    # Wind from 290 degrees (west-north-west) blows east and south.
    assert config.wind.mean_enu == pytest.approx((4.6985, -1.7101, 0.0), abs=1e-4)


def test_launch_points_lie_eastwards_at_the_spacing() -> None:
    mission = load_mission(DEMO)
    config = sim_config(mission, None, 0.0)
    places = [
        mission.frame.to_enu(v.launch_lat_rad, v.launch_lon_rad, v.launch_alt_amsl_m)
        for v in config.vehicles
    ]
    for i, place in enumerate(places):
        assert place == pytest.approx((20.0 * i, 0.0, 0.0), abs=1e-6)


def test_vehicles_send_to_a_port_each_where_the_mission_has_as_many() -> None:
    def addresses(*links: str) -> list[tuple[str, int]]:
        return controller_addresses(parse_mission(short_mission_text(swarm__link=list(links))))

    four = [f"udpin://0.0.0.0:{14550 + 10 * i}" for i in range(4)]
    assert addresses(*four) == [("127.0.0.1", 14550 + 10 * i) for i in range(4)]
    assert addresses("tcp://10.0.0.1:5760", *four[:2]) == [("127.0.0.1", 14550)]


def test_faults_reach_their_vehicle() -> None:
    faults = [
        {"sysid": 1, "kind": "silent"},
        {"sysid": 2, "kind": "refuses_arming"},
        {"sysid": 3, "kind": "dies", "at_s": 12.5},
    ]
    config = sim_config(parse_mission(short_mission_text(sim__faults=faults)), None, 0.0)
    got = [(v.faults.silent, v.faults.refuses_arming, v.faults.dies_at_s) for v in config.vehicles]
    assert got == [
        (True, False, None),
        (False, True, None),
        (False, False, 12.5),
        (False, False, None),
    ]


def test_every_vehicle_has_the_missions_key_but_the_one_at_fault(tmp_path: Path) -> None:
    """The key's file is found from the mission's."""
    (tmp_path / "swarm.key").write_bytes(KEY)
    path = tmp_path / "signed.yaml"
    faults = [{"sysid": 3, "kind": "other_key"}]
    path.write_text(short_mission_text(swarm__signing_key_file="swarm.key", sim__faults=faults))
    keys = [v.signing_key for v in sim_config(load_mission(path), None, 0.0).vehicles]
    other = keys.pop(2)
    assert keys == 3 * [KEY]
    assert other is not None
    assert len(other) == len(KEY)
    assert other != KEY
    unsigned = sim_config(parse_mission(short_mission_text()), None, 0.0)
    assert {v.signing_key for v in unsigned.vehicles} == {None}


def test_a_mission_for_real_vehicles_cannot_be_simulated() -> None:
    mission = load_mission(DEMO).model_copy(update={"sim": None})
    with pytest.raises(UsageError, match="the mission beacon_drift has no sim section"):
        simulation_section(mission)


def test_angles_of_the_emitter_are_radians() -> None:
    emitter = sim_config(load_mission(DEMO), None, 0.0).emitter
    assert emitter.lat_rad == pytest.approx(math.radians(54.44))
