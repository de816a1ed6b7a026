"""The station, without sockets: what goes where."""

import json
from dataclasses import replace

import msgspec
import pytest

from sim.config import VehicleConfig
from sim.world import World
from swarmctl.events import EmitterTruth, LinkConnection, ReceiverTruth, Record
from swarmctl.feed.schema import RangeDifferenceMessage, ReceiverTruthMessage, TruthMessage
from swarmctl.link.address import Address
from swarmctl.mission.controller import Controller
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.mission.phases import Phase
from swarmctl.ops.sim_config import sim_config
from swarmctl.ops.station import Station
from swarmctl.ops.vehicle_links import native_link
from tests.missions import short_mission_text


class Tape:
    """Keeps what is recorded."""

    def __init__(self) -> None:
        self.records: list[tuple[Record, float]] = []

    def record(self, record: Record, utc_s: float) -> None:
        self.records.append((record, utc_s))


TRUTH = msgspec.json.encode(
    TruthMessage(
        epoch_utc_s=1000.0,
        lat_deg=54.4365,
        lon_deg=11.1955,
        alt_amsl_m=0.0,
        velocity_enu=(0.0, 0.0, 0.0),
    )
)


RECEIVERS_TRUTH = msgspec.json.encode(
    [
        ReceiverTruthMessage(
            epoch_utc_s=1000.0,
            receiver=receiver,
            clock_m=3.0,
            drift_mps=0.0,
            navigation_enu=(0.0, 0.0, 0.0),
        )
        for receiver in (1, 2)
    ]
)
UTC_S = 1_790_000_000.0


def station(tape: Tape | None = None) -> Station:
    mission = parse_mission(short_mission_text())
    return Station(mission, native_link(mission), 0.0, 1000.0, tape)


def test_the_truth_reaches_the_recorder_and_nobody_else(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[object] = []
    monkeypatch.setattr(Controller, "receive", lambda _self, event, _now: seen.append(event))
    tape = Tape()
    ground = station(tape)
    ground.message("swarm/alpha/truth", TRUTH, 5.0)
    ground.message("swarm/alpha/truth/receivers", RECEIVERS_TRUTH, 5.0)
    kinds = [type(record) for record, _ in tape.records]
    assert kinds == [EmitterTruth, ReceiverTruth, ReceiverTruth]
    assert {at for _, at in tape.records} == {1005.0}
    assert seen == []


def test_without_a_recorder_nobody_subscribes_to_the_truth() -> None:
    measurements = ("swarm/alpha/tdoa", "swarm/alpha/toa/+")
    assert station().topics == measurements
    assert station(Tape()).topics == (
        *measurements,
        "swarm/alpha/truth",
        "swarm/alpha/truth/receivers",
    )


def test_what_is_heard_is_recorded_before_it_is_acted_on() -> None:
    tape = Tape()
    ground = station(tape)
    payload = msgspec.json.encode(
        RangeDifferenceMessage(
            epoch_utc_s=1000.0,
            reference=1,
            receiver=2,
            rd_m=10.0,
            sigma_m=3.0,
            rho=0.5,
            clock_sigma_s=0.0,
            seq=0,
        )
    )
    ground.message("swarm/alpha/tdoa", payload, 0.0)
    ground.settle(0.0)
    kinds = [type(record).__name__ for record, _ in tape.records]
    assert kinds == ["RangeDifferences", "PhaseChanged"]


def test_a_malformed_message_is_said_once_and_counted() -> None:
    ground = station()
    for _ in range(3):
        ground.message("swarm/alpha/tdoa", b"nonsense", 0.0)
        ground.settle(0.0)
    assert len(ground.notices()) == 1
    assert ground.counts()["feed_rejected"] == 3


def test_a_lost_broker_is_said() -> None:
    ground = station()
    ground.broker_state(connected=False, now=0.0)
    ground.settle(0.0)
    assert [notice.text for notice in ground.notices()] == ["the broker is lost; reconnecting"]


def test_a_snapshot_can_be_taken_at_any_time() -> None:
    ground = station()
    snapshot = ground.snapshot(0.0)
    assert snapshot.phase == "waiting"
    assert snapshot.estimate.sigma_major_m == pytest.approx(100.0)
    assert [vehicle.sysid for vehicle in snapshot.vehicles] == [1, 2, 3, 4]
    assert json.loads(msgspec.json.encode(ground.counts()))["rd_dropped"] == 0


def test_a_lost_link_is_told_and_recorded() -> None:
    tape = Tape()
    ground = station(tape)
    url = "tcp://10.0.0.1:5760"
    for now, connected in ((1.0, False), (3.0, True)):
        ground.connection(url, connected, now)
        ground.wake(now)
    told = [notice.text for notice in ground.notices()]
    assert told[-2:] == [f"the link {url} is lost; reconnecting", f"the link {url} is back"]
    events = [record for record, _ in tape.records if isinstance(record, LinkConnection)]
    assert [event.connected for event in events] == [False, True]


def checked(world: World, mission: Mission) -> Station:
    """A station after its checks of the vehicles have ended, one way or the other."""
    link = native_link(mission)
    station = Station(mission, link, 0.0, UTC_S, None)
    steps = 0
    while station.controller.phase in {Phase.WAITING, Phase.CHECKING}:
        steps += 1
        now = 0.02 * steps
        assert now < 120.0
        world.advance(now)
        for sysid, data in world.datagrams():
            link.receive_datagram(data, Address("memory", sysid), now)
        station.wake(now)
        for data, address in link.datagrams():
            world.receive_datagram(address.port, data)
    return station


@pytest.mark.parametrize(
    "autopilot",
    [
        {"parameter_names": "4.7", "parameters": ()},
        {"parameter_names": "4.6", "parameters": (), "knows_intervals": False},
    ],
    ids=["4.7", "4.6 and older"],
)
def test_new_firmware_passes_the_checks_and_so_does_old_that_knows_data_streams_alone(
    autopilot: dict[str, object],
) -> None:
    config = sim_config(parse_mission(short_mission_text()), 1, UTC_S)
    old: tuple[VehicleConfig, ...] = tuple(
        replace(vehicle, **autopilot)  # type: ignore[arg-type]
        for vehicle in config.vehicles
    )
    text = short_mission_text(swarm__set_failsafes=True)
    ground = checked(World(replace(config, vehicles=old)), parse_mission(text))
    assert ground.controller.phase is Phase.LAUNCHING, ground.controller.result
    for vehicle in ground.controller.fleet.vehicles.values():
        # One of nine intervals may be twice as long: they begin anew when they are set.
        assert vehicle.position_hz is not None
        assert 8.9 < vehicle.position_hz < 10.2
        # 10 m/s by default, by whatever name; the mission wants 13.
        assert vehicle.known_parameters["WP_SPD"] == 13.0


@pytest.mark.parametrize(
    ("autopilot", "fence"),
    [
        ("ardupilot", {"FENCE_ENABLE": 1.0, "FENCE_ALT_MAX": 20.0}),
        ("px4", {"GF_ACTION": 3.0, "GF_MAX_VER_DIST": 20.0}),
    ],
)
def test_a_vehicle_fenced_in_below_the_flight_is_not_started(
    autopilot: str, fence: dict[str, float]
) -> None:
    mission = parse_mission(
        short_mission_text(sim__autopilot=autopilot, swarm__autopilot=autopilot)
    )
    config = sim_config(mission, 1, UTC_S)
    first, *others = config.vehicles
    fenced = replace(first, parameters=(*first.parameters, *fence.items()))
    world = World(replace(config, vehicles=(fenced, *others)))
    ground = checked(world, mission)
    code, said = ground.controller.result
    assert code == "unsafe_failsafes", said
    assert f"vehicle {first.sysid}: {list(fence)[1]} is 20, and the mission flies higher" in said
