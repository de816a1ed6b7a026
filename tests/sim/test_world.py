"""The world as a whole: determinism, epochs, publications, faults."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scipy import stats

from sim.config import EmitterConfig, NavigationConfig, ReceiverConfig, SimConfig, WindConfig
from sim.faults import Faults
from sim.world import World
from swarmctl.errors import SimulationError
from tests.sim.flying import (
    ALT,
    LAT,
    LON,
    VELOCITY_ONLY,
    Station,
    arrival_times,
    of_type,
    range_differences,
    receivers_truths,
    simulation,
    truths,
    vehicle,
)

RISK = 1e-4
"""Probability that a correct implementation misses one of the derived bounds."""
POSITION = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
SWARM = (vehicle(1), vehicle(2, 30.0), vehicle(3, 60.0))


def noisy(seed: int = 3) -> SimConfig:
    return simulation(
        *SWARM,
        wind=WindConfig((4.0, 1.0, 0.0), 2.0),
        navigation=NavigationConfig(0.5, 1.0, 20.0),
        emitter=EmitterConfig(LAT + 1e-4, LON, ALT, (0.5, 0.0, 0.0), 0.1),
        seed=seed,
    )


def flight(config: SimConfig, slice_s: float) -> tuple[list[bytes], list[tuple[str, bytes]]]:
    """Everything a short flight says, with time cut into slices between the same commands."""
    world, encoder = World(config), mavlink.MAVLink(None, srcSystem=255)
    datagrams: list[bytes] = []
    publications: list[tuple[str, bytes]] = []

    def advance(until_s: float) -> None:
        while world.time_s < until_s:
            world.advance(min(world.time_s + slice_s, until_s))
            datagrams.extend(data for _, data in world.datagrams())
            publications.extend(world.publications())

    script = [
        (5.013, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (POSITION, 2e5, 0, 0, 0, 0, 0)),
        (5.027, mavlink.MAV_CMD_DO_SET_MODE, (1, 4, 0, 0, 0, 0, 0)),
        (5.1, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1, 0, 0, 0, 0, 0, 0)),
        (5.2, mavlink.MAV_CMD_NAV_TAKEOFF, (0, 0, 0, 0, 0, 0, 20)),
    ]
    for at_s, command, params in script:
        advance(at_s)
        for v in config.vehicles:
            message = mavlink.MAVLink_command_long_message(v.sysid, 1, command, 0, *params)
            world.receive_datagram(v.sysid, bytes(message.pack(encoder)))
    advance(25.0)
    return datagrams, publications


def test_the_same_bytes_however_time_is_sliced() -> None:
    once = flight(noisy(), 100.0)
    assert len(once[0]) > 300
    assert len(once[1]) > 100
    assert flight(noisy(), 0.0137) == once


def test_another_seed_gives_another_flight() -> None:
    assert flight(noisy(3), 100.0)[1] != flight(noisy(4), 100.0)[1]


def test_a_vehicles_errors_do_not_depend_on_the_others() -> None:
    def reports(config: SimConfig) -> list[tuple[int, int]]:
        station = Station(config)
        station.stream(POSITION, 10.0, 2)
        return [(m.lat, m.lon) for m in of_type("GLOBAL_POSITION_INT", station.advance(10.0))]

    config = noisy()
    # The first vehicle stays: it is the origin of the world's frame.
    fewer = replace(config, vehicles=config.vehicles[:2])
    assert len(set(reports(config))) > 50
    assert reports(fewer) == reports(config)


def test_time() -> None:
    world = World(simulation())
    world.advance(1.234)
    assert world.time_s == 1.234
    assert world.utc_s == simulation().utc_start_s + 1.234
    world.advance(1.0)
    assert world.time_s == 1.234


def ecef(lat_deg: float, lon_deg: float, alt_m: float) -> np.ndarray:
    """WGS-84 by the reduced latitude, not by the prime vertical radius as in swarmctl.frames."""
    a, b = 6378137.0, 6378137.0 * (1.0 - 1.0 / 298.257223563)
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    beta = math.atan2(b * math.sin(lat), a * math.cos(lat))
    radius = a * math.cos(beta) + alt_m * math.cos(lat)
    z = b * math.sin(beta) + alt_m * math.sin(lat)
    return np.array([radius * math.cos(lon), radius * math.sin(lon), z])


def test_range_differences_agree_with_reported_positions_at_their_epoch() -> None:
    # In motion, so that a wrong epoch shows: 10 m/s times one step is 0.2 m.
    emitter = EmitterConfig(LAT + 2e-4, LON + 4e-4, 370.0, (0.0, 0.0, 0.0))
    receivers = ReceiverConfig(reference=2, sigma_m=1e-9)
    station = Station(simulation(*SWARM, emitter=emitter, receivers=receivers))
    station.airborne(50.0, (1, 2, 3))
    for sysid in (1, 2, 3):
        station.stream(POSITION, 50.0, sysid)
    station.publications.clear()
    station.received.clear()
    courses = {1: (10.0, 0.0, 0.0), 2: (-6.0, -8.0, 0.0), 3: (0.0, 10.0, 1.0)}
    for _ in range(10):
        for sysid, velocity in courses.items():
            station.setpoint(velocity_enu=velocity, mask=VELOCITY_ONLY, sysid=sysid)
        station.advance(1.0)
    places = {
        (sysid, m.time_boot_ms): ecef(m.lat * 1e-7, m.lon * 1e-7, m.alt * 1e-3)
        for sysid, m in station.received
        if m.get_type() == "GLOBAL_POSITION_INT"
    }
    truth = truths(station.publications)[-1]
    source = ecef(truth.lat_deg, truth.lon_deg, truth.alt_amsl_m)
    compared = 0
    for message in itertools.chain.from_iterable(range_differences(station.publications)[5:]):
        boot_ms = round((message.epoch_utc_s - simulation().utc_start_s) * 1e3)
        companion = places[message.receiver, boot_ms]
        reference = places[message.reference, boot_ms]
        expected = np.linalg.norm(companion - source) - np.linalg.norm(reference - source)
        # Positions come in units of 1.1 cm of latitude and 1 mm of altitude.
        assert message.rd_m == pytest.approx(float(expected), abs=0.02)
        compared += 1
    assert compared > 150


def test_without_errors_there_is_nothing_to_tell_of_the_receivers() -> None:
    station = Station(simulation(*SWARM))
    station.advance(5.0)
    assert receivers_truths(station.publications) == []


@pytest.mark.parametrize(
    ("receivers", "navigation"),
    [
        (ReceiverConfig(1, clock_bias_sigma_s=1e-9), NavigationConfig(0.0)),
        (ReceiverConfig(1, clock_drift_sigma=1e-9), NavigationConfig(0.0)),
        (ReceiverConfig(1), NavigationConfig(0.0, 0.5)),
    ],
    ids=["bias", "drift", "navigation"],
)
def test_any_error_is_told_once_a_second_of_every_receiver(
    receivers: ReceiverConfig, navigation: NavigationConfig
) -> None:
    station = Station(simulation(*SWARM, receivers=receivers, navigation=navigation))
    station.advance(5.0)
    told = receivers_truths(station.publications)
    assert [[truth.receiver for truth in each] for each in told] == [[1, 2, 3]] * 5
    start = simulation().utc_start_s
    assert [each[0].epoch_utc_s - start for each in told] == [1.0, 2.0, 3.0, 4.0, 5.0]


def test_measured_less_geometry_less_the_truth_about_the_receivers_is_white() -> None:
    sigma, rho, duration_s = 1.0, 0.5, 100.0
    receivers = ReceiverConfig(
        1,
        rate_hz=10.0,
        sigma_m=sigma,
        rho=rho,
        clock_bias_sigma_s=30e-9,
        clock_drift_sigma=1e-9,
        minimum_altitude_m=-1.0,
    )
    emitter = EmitterConfig(LAT + 2e-4, LON + 4e-4, 370.0, (0.0, 0.0, 0.0))
    station = Station(simulation(*SWARM, emitter=emitter, receivers=receivers))
    station.advance(duration_s)
    told = receivers_truths(station.publications)
    source = station.world.emitter_state().position_enu
    truths_at = [each[0].epoch_utc_s for each in told]

    def arrival_m(sysid: int, epoch_utc_s: float) -> float:
        clock = [truth.clock_m for each in told for truth in each if truth.receiver == sysid]
        path_m = math.dist(source, station.position(sysid))
        return path_m + float(np.interp(epoch_utc_s, truths_at, clock))

    errors = np.array(
        [
            [m.rd_m - arrival_m(m.receiver, m.epoch_utc_s) + arrival_m(1, m.epoch_utc_s) for m in e]
            for e in range_differences(station.publications)
            if truths_at[0] <= e[0].epoch_utc_s <= truths_at[-1]
        ]
    )
    assert len(errors) == 990
    # The common part, and what is left: sigma² (1 + rho) and sigma² (1 - rho) of two companions.
    common, across = (errors @ np.array([[1.0, 1.0], [1.0, -1.0]]) / math.sqrt(2.0)).T
    low, high = stats.chi2.interval(1.0 - RISK, len(errors))
    assert low < np.sum(common**2) / (sigma**2 * (1.0 + rho)) < high
    assert low < np.sum(across**2) / (sigma**2 * (1.0 - rho)) < high
    # The clocks start with the simulation: 1.8e9 s of drift would be 5e8 m.
    assert all(abs(truth.clock_m) < 100.0 for truth in told[0])
    # A clock that is left in would show as a mean, or as a trend in time.
    bound = stats.norm.isf(RISK / 2.0)
    time = np.linspace(-1.0, 1.0, len(errors))
    for column in errors.T:
        assert abs(column.mean()) < bound * sigma / math.sqrt(len(errors))
        assert abs(column @ time) < bound * sigma * math.sqrt(time @ time)
    for first, last in zip(told[0], told[-1], strict=True):
        since_s = last.epoch_utc_s - first.epoch_utc_s
        assert last.clock_m - first.clock_m == pytest.approx(since_s * first.drift_mps)


def test_the_navigation_truth_is_what_a_vehicle_reports_less_where_it_is() -> None:
    navigation = NavigationConfig(white_sigma_m=0.0, correlated_sigma_m=5.0, correlated_tau_s=20.0)
    station = Station(simulation(*SWARM, navigation=navigation))
    station.advance(5.0)
    for _ in range(15):
        station.advance(1.0)
        truth = receivers_truths(station.publications)[-1]
        assert len({told.navigation_enu for told in truth}) == len(SWARM)
        for told in truth:
            m = station.request(POSITION, told.receiver)
            reported = ecef(m.lat * 1e-7, m.lon * 1e-7, m.alt * 1e-3)
            lat, lon, alt = station.world.frame.to_geodetic(*station.position(told.receiver))
            error = reported - ecef(math.degrees(lat), math.degrees(lon), alt)
            # Positions come in units of 1.1 cm of latitude and 1 mm of altitude.
            assert east_north_up(error) == pytest.approx(np.array(told.navigation_enu), abs=0.01)


def test_the_navigation_truth_is_without_the_white_part_of_the_reports() -> None:
    navigation = NavigationConfig(white_sigma_m=5.0, correlated_sigma_m=5.0, correlated_tau_s=1e9)
    station = Station(simulation(*SWARM, navigation=navigation))
    station.advance(10.0)
    for first, *later in zip(*receivers_truths(station.publications), strict=True):
        for told in later:
            # In 10 s of its 1e9 s it moves by 1.4e-4 of its sigma.
            assert told.navigation_enu == pytest.approx(first.navigation_enu, abs=0.01)


def east_north_up(difference: np.ndarray) -> np.ndarray:
    """An ECEF difference in the axes at (LAT, LON)."""
    up = np.array([math.cos(LAT) * math.cos(LON), math.cos(LAT) * math.sin(LON), math.sin(LAT)])
    east = np.array([-math.sin(LON), math.cos(LON), 0.0])
    axes = np.array([east, np.cross(up, east), up])
    return np.asarray(axes @ difference)


def test_a_beacon_may_burst_once_in_50_s() -> None:
    receivers = ReceiverConfig(1, rate_hz=0.02, minimum_altitude_m=-1.0)
    station = Station(simulation(*SWARM, receivers=receivers))
    station.advance(151.0)
    start = simulation().utc_start_s
    bursts = [e[0].epoch_utc_s - start for e in range_differences(station.publications)]
    assert bursts == [50.0, 100.0, 150.0]


def test_one_publication_per_epoch_with_all_companions() -> None:
    receivers = ReceiverConfig(reference=1, rate_hz=10.0)
    station = Station(simulation(*SWARM, receivers=receivers))
    station.airborne(20.0, (1, 2, 3))
    station.publications.clear()
    station.advance(10.0)
    lists = range_differences(station.publications)
    assert len(lists) == 100
    for earlier, later in itertools.pairwise(lists):
        assert [message.receiver for message in later] == [2, 3]
        assert later[0].epoch_utc_s - earlier[0].epoch_utc_s == pytest.approx(0.1, abs=1e-6)
        assert later[0].seq == earlier[0].seq + 1


def test_a_rate_off_the_grid_of_steps_keeps_its_mean() -> None:
    station = Station(simulation(*SWARM, receivers=ReceiverConfig(reference=1, rate_hz=7.0)))
    station.airborne(20.0, (1, 2, 3))
    station.publications.clear()
    station.advance(20.0)
    assert len(range_differences(station.publications)) in {139, 140, 141}


def test_range_differences_come_late_by_the_delay() -> None:
    receivers = ReceiverConfig(reference=1, delay_s=0.25)
    station = Station(simulation(*SWARM, receivers=receivers))
    station.airborne(20.0, (1, 2, 3))
    station.publications.clear()
    for _ in range(100):
        before = len(station.publications)
        station.advance(0.02)
        for message, *_ in range_differences(station.publications[before:]):
            age = station.world.utc_s - message.epoch_utc_s
            # Rounded up to the step of 20 ms.
            assert age == pytest.approx(0.26, abs=1e-3)
    assert range_differences(station.publications)


def test_only_receivers_well_above_the_ground_hear() -> None:
    station = Station(simulation(*SWARM, receivers=ReceiverConfig(1, minimum_altitude_m=5.0)))
    station.airborne(4.5, (2,))
    station.airborne(20.0, (1, 3))
    heard = {message.receiver for message in range_differences(station.publications)[-1]}
    assert heard == {3}
    station.setpoint((30.0, 0.0, 6.0), sysid=2)
    station.advance(10.0)
    heard = {message.receiver for message in range_differences(station.publications)[-1]}
    assert heard == {2, 3}


def test_nothing_is_measured_without_the_reference() -> None:
    station = Station(simulation(*SWARM, receivers=ReceiverConfig(reference=1)))
    station.airborne(20.0, (2, 3))
    assert range_differences(station.publications) == []


def test_arrival_times_outlive_the_reference() -> None:
    dying = vehicle(1, faults=Faults(dies_at_s=30.0))
    receivers = ReceiverConfig(reference=1, publish="arrival_times")
    station = Station(simulation(dying, *SWARM[1:], receivers=receivers))
    station.airborne(20.0, (1, 2, 3))
    station.advance(29.9 - station.world.time_s)
    station.publications.clear()
    station.advance(10.1)
    assert range_differences(station.publications) == []
    # Bursts of 29.9 s (late by the delay) to 39.9 s; from 30 s on without UAV 1.
    bursts: dict[int, list[int]] = {}
    for message in arrival_times(station.publications):
        bursts.setdefault(message.burst, []).append(message.receiver)
    assert list(bursts.values()) == [[1, 2, 3]] + [[2, 3]] * 100


def test_truth_is_published_twice_a_second() -> None:
    station = Station(simulation(emitter=EmitterConfig(LAT, LON, 390.0, (2.0, -1.0, 0.0))))
    station.advance(10.0)
    published = truths(station.publications)
    assert len(published) == 20
    last = published[-1]
    assert last.epoch_utc_s == simulation().utc_start_s + 10.0
    assert last.velocity_enu == (2.0, -1.0, 0.0)
    east, north, _ = station.world.frame.to_enu(
        math.radians(last.lat_deg), math.radians(last.lon_deg), last.alt_amsl_m
    )
    assert (east, north) == pytest.approx((20.0, -10.0), abs=1e-2)
    assert last.alt_amsl_m == pytest.approx(390.0, abs=1e-3)


def test_a_silent_vehicle_says_nothing_at_all() -> None:
    station = Station(simulation(vehicle(1), vehicle(2, 10.0, faults=Faults(silent=True))))
    station.advance(20.0)
    assert station.command(mavlink.MAV_CMD_REQUEST_MESSAGE, 0, sysid=2) == []
    assert {sysid for sysid, _ in station.received} == {1}


def test_a_dying_vehicle_falls_silent_flies_on_and_its_receiver_is_lost() -> None:
    dying = vehicle(3, 60.0, faults=Faults(dies_at_s=30.0))
    station = Station(simulation(SWARM[0], SWARM[1], dying, receivers=ReceiverConfig(1)))
    station.airborne(20.0, (1, 2, 3))
    station.advance(29.9 - station.world.time_s)
    assert {m.receiver for m in range_differences(station.publications)[-1]} == {2, 3}
    station.received.clear()
    station.advance(20.0)
    heartbeats = of_type("HEARTBEAT", [m for sysid, m in station.received if sysid == 3])
    assert heartbeats == []
    assert station.command(mavlink.MAV_CMD_NAV_LAND, sysid=3) == []
    station.advance(10.0)
    assert {m.receiver for m in range_differences(station.publications)[-1]} == {2}
    assert station.position(3)[2] == pytest.approx(20.0, abs=0.1)


def test_wind_barely_moves_a_hover() -> None:
    config = simulation(wind=WindConfig((8.0, 0.0, 0.0), gust_sigma_mps=2.0))
    station = Station(config)
    station.airborne(30.0)
    places = []
    for _ in range(300):
        station.advance(0.2)
        places.append(station.position()[:2])
    spread = np.std(places, axis=0)
    assert np.all(spread > 0.005)
    assert np.all(spread < 0.3)


def test_contradictory_configurations_are_refused_in_one_sentence() -> None:
    with pytest.raises(SimulationError, match=r"system ids \[1, 1\]"):
        World(simulation(vehicle(1), vehicle(1, 10.0)))
    with pytest.raises(SimulationError, match="at least one"):
        World(replace(simulation(), vehicles=()))
    with pytest.raises(SimulationError, match="UAV 9, which is not simulated"):
        World(simulation(receivers=ReceiverConfig(reference=9)))
    with pytest.raises(SimulationError, match="at most 50 Hz"):
        World(simulation(receivers=ReceiverConfig(reference=1, rate_hz=60.0)))


def test_a_parameter_the_autopilot_does_not_have_cannot_be_set() -> None:
    with pytest.raises(SimulationError, match=r"UAV 1 has no parameter RTL_ALT: .* px4"):
        World(simulation(vehicle(autopilot="px4", parameters=(("RTL_ALT", 20.0),))))
