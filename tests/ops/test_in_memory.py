"""Whole missions on the virtual clock: real bytes, no sockets."""

from collections.abc import Callable
from dataclasses import replace
from operator import attrgetter
from pathlib import Path

import msgspec
import numpy as np
import pytest
from mcap.reader import make_reader

from sim.radio_channel import RadioChannel
from sim.receivers import Receivers
from sim.world import World
from swarmctl.decisions import EstimateMade, Notice
from swarmctl.errors import UsageError
from swarmctl.events import ReceiverTruth, Record
from swarmctl.link.address import Address
from swarmctl.link.mavlink_link import MavlinkLink
from swarmctl.mission.mission_file_loading import load_mission
from swarmctl.mission.phases import Phase
from swarmctl.mission.snapshot import Snapshot
from swarmctl.ops import in_memory
from swarmctl.ops.in_memory import STEP_S, UTC_START_S, fly_in_memory
from swarmctl.ops.sim_config import sim_config
from swarmctl.ops.station import Station
from swarmctl.ops.vehicle_links import native_link
from swarmctl.recorder.summary import FlightSummary, read_summary
from tests.link.wire import Sender, unpack
from tests.summaries import SEPARATION_M, assert_within_limits, known

Short = Callable[..., Path]


def without_wall(summary: FlightSummary) -> FlightSummary:
    return msgspec.structs.replace(summary, wall_s=0.0)


def test_a_short_mission_is_located_recorded_and_within_its_limits(
    short_mission: Short, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    summary = fly_in_memory(short_mission(), out, seed=3)
    assert summary == read_summary(out)
    assert summary.result == "located"
    assert_within_limits(summary)
    assert summary.rd_dropped == 0
    assert summary.mavlink_rejected == 0
    files = {path.name for path in out.iterdir()}
    assert files >= {
        "vehicles.tlog",
        "mission.mcap",
        "mission.yaml",
        "summary.json",
        "map.png",
        "error.png",
        "slots.png",
        "ranges.png",
    }


@pytest.mark.slow
def test_the_truth_about_poor_receivers_is_in_the_recording(
    short_mission: Short, tmp_path: Path
) -> None:
    mission = short_mission(
        sim__receivers={"clock_bias_sigma_ns": 10, "clock_drift_sigma_ns_per_s": 0.2},
        sim__navigation={"white_sigma_m": 0.5, "correlated_sigma_m": 0.5},
    )
    fly_in_memory(mission, tmp_path, seed=3, until=lambda snapshot: snapshot.elapsed_s > 50.0)
    with (tmp_path / "mission.mcap").open("rb") as stream:
        messages = make_reader(stream).iter_messages(topics=["/truth/ReceiverTruth"])
        truths = [msgspec.json.decode(m.data, type=ReceiverTruth) for _, _, m in messages]
    config = sim_config(load_mission(mission), 3, UTC_START_S)
    receivers = Receivers(config.receivers, (1, 2, 3, 4), 3, UTC_START_S)
    for k, truth in enumerate(truths):
        second, place = divmod(k, 4)
        assert truth.epoch_utc_s == UTC_START_S + second + 1.0
        assert truth.receiver == place + 1
    assert len(truths) > 4 * 50
    for truth in truths:
        assert truth.clock_m == receivers.clock_m(truth.receiver, truth.epoch_utc_s)
        assert truth.drift_mps == receivers.drift_mps(truth.receiver)
        assert 0.0 < max(map(abs, truth.navigation_enu)) < 5.0


@pytest.mark.slow
def test_a_swarm_at_one_altitude_keeps_its_distances(short_mission: Short) -> None:
    """Out, round the beacon and home past one another, in wind and by their own navigation."""
    level = [{"sysid": sysid, "altitude_amsl_m": 42} for sysid in (1, 2, 3, 4)]
    summary = fly_in_memory(short_mission(swarm__vehicles=level), seed=3)
    assert summary.result == "located"
    assert_within_limits(summary)


def formed_up(snapshot: Snapshot) -> bool:
    """Ends a flight some seconds after the formation was taken up."""
    return snapshot.elapsed_s > 80.0


@pytest.mark.slow
def test_the_same_seed_gives_the_same_flight_and_another_seed_another(
    short_mission: Short, tmp_path: Path
) -> None:
    mission = short_mission()
    one, two, other = (
        fly_in_memory(mission, tmp_path / name, seed=seed, until=formed_up)
        for name, seed in (("one", 5), ("two", 5), ("other", 6))
    )
    assert without_wall(one) == without_wall(two)
    for name in ("vehicles.tlog", "mission.mcap"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    assert one.final_error_m != other.final_error_m


class Estimates:
    """Keeps the estimates of a station that records here."""

    def __init__(self) -> None:
        self.made: list[EstimateMade] = []

    def record(self, record: Record, utc_s: float) -> None:
        if isinstance(record, EstimateMade):
            self.made.append(record)


@pytest.mark.slow
def test_arrival_times_give_the_estimates_of_range_differences(short_mission: Short) -> None:
    # One flight, told both ways: the second station hears the same vehicles and its own world's
    # receivers, but what it says reaches nobody.
    mission = load_mission(short_mission())
    config = sim_config(mission, 5, UTC_START_S)
    differenced = World(config)
    stamped = World(replace(config, receivers=replace(config.receivers, publish="arrival_times")))
    kept = (Estimates(), Estimates())
    links = (native_link(mission), native_link(mission))
    flying, listening = (
        Station(mission, link, 0.0, UTC_START_S, estimates)
        for link, estimates in zip(links, kept, strict=True)
    )
    for step in range(1, round(100.0 / STEP_S)):
        now = step * STEP_S
        for world, link, station in zip(
            (differenced, stamped), links, (flying, listening), strict=True
        ):
            world.advance(now)
            for sysid, data in world.datagrams():
                link.receive_datagram(data, Address("memory", sysid), now)
            for topic, payload in world.publications():
                station.message(topic, payload, now)
            if now >= station.next_wake():
                station.wake(now)
            else:
                station.settle(now)
        for data, (_, sysid, _) in links[0].datagrams():
            differenced.receive_datagram(sysid, data)
            stamped.receive_datagram(sysid, data)
        links[1].datagrams()
    expected, found = (estimates.made for estimates in kept)
    assert flying.controller.phase is Phase.APPROACHING
    assert len(expected) > 800
    # The last few may be in the one list and not in the other: they wait for a control period.
    assert abs(len(found) - len(expected)) <= 2
    for one, other in zip(expected, found, strict=False):
        assert (one.epoch_utc_s, one.rd_count) == (other.epoch_utc_s, other.rd_count)
        sigma = np.sqrt(np.array(one.covariance)[::7])
        # Range differences agree to 1e-7 m of a sigma of 3 m; thousands of updates add up.
        error = np.subtract(one.position_enu, other.position_enu)
        assert np.abs(error / sigma[:3]).max() < 1e-5
        assert one.nis == pytest.approx(other.nis, rel=1e-4, abs=1e-6)


@pytest.mark.slow
def test_a_lost_reference_is_succeeded_where_receivers_publish_arrival_times(
    short_mission: Short,
) -> None:
    """UAV 1 falls silent on the approach: a companion leads, and the emitter is still located."""
    mission = short_mission(
        sim__faults=[{"sysid": 1, "kind": "dies", "at_s": 70.0}],
        sim__receivers={"publish": "arrival_times"},
        swarm__reference=1,
    )
    ages: list[float] = []
    leaders: list[int] = []

    def look(snapshot: Snapshot) -> None:
        if 72.0 < snapshot.elapsed_s < 90.0:
            ages.append(snapshot.estimate.age_s)
        leaders.extend(vehicle.sysid for vehicle in snapshot.vehicles if vehicle.is_reference)

    said: list[Notice] = []
    summary = fly_in_memory(mission, snapshot_every_s=1.0, on_snapshot=look, on_notice=said.append)
    assert summary.rd_dropped == 0
    # Once, for a second, the bursts waited for UAV 1.
    assert len(ages) == 17
    assert max(ages) < 0.3
    successor = leaders[-1]
    assert list(dict.fromkeys(leaders)) == [1, successor]
    assert successor != 1
    told = [notice.text for notice in said if "is the reference UAV now" in notice.text]
    assert len(told) == 1
    assert told[0].startswith("vehicle 1 has been silent for ")
    assert f"; vehicle {successor} is" in told[0]
    assert summary.result == "vehicle_lost"
    assert "is located to" in str(summary.detail)
    # 3.5 sigma in two dimensions: 0.2 % of honest estimates are farther off.
    assert known(summary.final_error_m) < 3.5 * known(summary.final_sigma_m)
    assert_within_limits(summary, stand_off=False)


def test_garbage_on_both_inputs_harms_nothing(
    short_mission: Short, monkeypatch: pytest.MonkeyPatch
) -> None:
    mission = short_mission()
    calm = fly_in_memory(mission, seed=5, until=formed_up)
    wake = Station.wake

    def wake_amid_garbage(station: Station, now: float) -> None:
        if not station.ended:
            assert isinstance(station.link, MavlinkLink)
            for data in (b"", b"\xfd", b"\xfd\x09\x00\x00\x00\x01\x01\x00\x00\x00", b"hello" * 60):
                station.link.receive_datagram(data, Address("memory", 1), now)
            for payload in (b"", b"{", b"[]", b'{"v": 2}', b"\xff\x00", b'[{"v": 1, "rd_m": NaN}]'):
                station.message("swarm/alpha/tdoa", payload, now)
        wake(station, now)

    monkeypatch.setattr(Station, "wake", wake_amid_garbage)
    stormy = fly_in_memory(mission, seed=5, until=formed_up)
    assert stormy.mavlink_rejected > 1000
    assert stormy.feed_rejected > 1000
    same = attrgetter("result", "duration_s", "final_error_m", "final_sigma_m", "setpoints_out")
    assert same(stormy) == same(calm)


@pytest.mark.parametrize(
    ("kind", "result"), [("silent", "vehicle_silent"), ("refuses_arming", "arming_refused")]
)
def test_a_vehicle_at_fault_is_the_result(short_mission: Short, kind: str, result: str) -> None:
    mission = short_mission(sim__faults=[{"sysid": 3, "kind": kind}])
    said: list[Notice] = []
    summary = fly_in_memory(mission, on_notice=said.append)
    assert summary.result == result
    assert "vehicle 3" in str(summary.detail)
    assert any(str(summary.detail) in notice.text for notice in said)


def test_a_vehicle_that_dies_in_flight_brings_the_others_home(short_mission: Short) -> None:
    mission = short_mission(sim__faults=[{"sysid": 2, "kind": "dies", "at_s": 70.0}])
    summary = fly_in_memory(mission)
    assert summary.result == "vehicle_lost"
    assert "vehicle 2 has been silent" in str(summary.detail)


class Exchanged(RadioChannel[tuple[int, bytes]]):
    """From 70 s on vehicle 3 is off the air, and from 73 s on another one has its system id."""

    def send(self, item: tuple[int, bytes], now_s: float) -> None:
        """As a channel does."""
        sysid, data = item
        if sysid == 3 and now_s >= 70.0:
            if now_s < 73.0:
                return
            if unpack(data).get_type() == "AUTOPILOT_VERSION":
                item = (sysid, Sender(3).pack("AUTOPILOT_VERSION", uid=0xBAD))
        super().send(item, now_s)


@pytest.mark.slow
def test_an_id_that_changes_its_hardware_id_in_flight_is_named_and_done_without(
    short_mission: Short, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(in_memory, "RadioChannel", Exchanged)
    said: list[Notice] = []
    summary = fly_in_memory(short_mission(), on_notice=said.append)
    texts = [notice.text for notice in said]
    assert sum("now has 0xbad: another vehicle" in text for text in texts) == 1
    assert any("vehicle 3 has been silent for" in text for text in texts)
    assert summary.result == "vehicle_lost"
    assert known(summary.min_separation_m) >= SEPARATION_M


def test_a_mission_without_a_simulation_cannot_be_simulated(
    short_mission: Short, tmp_path: Path
) -> None:
    text = short_mission().read_text()
    path = tmp_path / "field.yaml"
    path.write_text(text[: text.index("sim:")] + text[text.index("swarm:") :])
    with pytest.raises(UsageError, match="has no sim section"):
        fly_in_memory(path)
