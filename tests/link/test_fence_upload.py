"""The upload of a geofence in bytes and in virtual time, with vehicles made of pymavlink."""

from __future__ import annotations

import math
from typing import Any

import pytest

from swarmctl.commands import UploadFence
from swarmctl.events import CommandOutcome
from tests.link.bench import GCS, AnsweredBench
from tests.link.wire import Sender, unpack

FENCE, CIRCLE_IN = 1, 5003
LAT_DEG, LON_DEG = 54.4321, -11.1987
UPLOAD = UploadFence(
    sysid=1, lat_rad=math.radians(LAT_DEG), lon_rad=math.radians(LON_DEG), radius_m=4030.0
)


class Vehicle(Sender):
    """Takes a fence and gives it back; ``asks`` as its autopilot does."""

    def __init__(self, asks: str = "MISSION_REQUEST") -> None:
        super().__init__(1)
        self.asks = asks
        self.item: Any = None
        self.heard: list[Any] = []
        self.deaf: set[str] = set()
        self.mute: set[str] = set()
        self.ack = 0
        self.changes: dict[str, float] = {}
        self.count = 1

    def answer(self, frame: bytes) -> list[bytes]:
        message = unpack(frame)
        kind = message.get_type()
        if not kind.startswith("MISSION"):
            return []
        self.heard.append(message)
        assert (message.target_system, message.target_component) == (1, 1)
        assert message.mission_type == FENCE
        if kind in self.deaf:
            return []
        to: dict[str, Any] = {
            "target_system": GCS,
            "target_component": 190,
            "mission_type": FENCE,
        }
        match kind:
            case "MISSION_COUNT":
                assert message.count == 1
                return [self.pack(self.asks, seq=0, **to)]
            case "MISSION_ITEM_INT":
                self.item = message
                ack = self.pack("MISSION_ACK", type=self.ack, **to)
                return [] if kind in self.mute else [ack]
            case "MISSION_REQUEST_LIST":
                count = self.count if self.item is not None else 0
                return [self.pack("MISSION_COUNT", count=count, **to)]
            case "MISSION_REQUEST_INT":
                fields = {"command": self.item.command, "param1": self.item.param1}
                fields |= {"x": self.item.x, "y": self.item.y} | self.changes
                return [self.pack("MISSION_ITEM_INT", seq=0, **fields, **to)]
        return []

    @property
    def kinds(self) -> list[str]:
        return [message.get_type() for message in self.heard]


class Bench(AnsweredBench):
    """A link to one vehicle that takes a fence."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self.vehicle = vehicle
        self.receive(vehicle.heartbeat())

    def upload(self) -> None:
        self.send(UPLOAD)

    @property
    def outcomes(self) -> list[CommandOutcome]:
        return self.of(CommandOutcome)

    @property
    def results(self) -> list[tuple[str, str, str]]:
        return [(o.command, o.result, o.detail) for o in self.outcomes]


# ArduPilot asks with the one and PX4 with the other; both take ITEM_INT.
@pytest.mark.parametrize("asks", ["MISSION_REQUEST", "MISSION_REQUEST_INT"])
def test_a_fence_is_uploaded_and_read_back(asks: str) -> None:
    bench = Bench(Vehicle(asks))
    bench.upload()
    item = bench.vehicle.item
    assert (item.command, item.param1, item.seq, item.frame) == (CIRCLE_IN, 4030.0, 0, 0)
    assert (item.x, item.y) == (544_321_000, -111_987_000)
    assert bench.vehicle.kinds == [
        "MISSION_COUNT",
        "MISSION_ITEM_INT",
        "MISSION_REQUEST_LIST",
        "MISSION_REQUEST_INT",
        "MISSION_ACK",
    ]
    assert bench.results == [("UploadFence", "accepted", "read back as it was sent")]
    bench.wait(30.0)
    assert len(bench.outcomes) == 1


@pytest.mark.parametrize(
    ("ack", "name"), [(1, "ERROR"), (15, "OPERATION_CANCELLED"), (99, "MAV_MISSION_RESULT 99")]
)
def test_a_fence_that_is_not_taken_is_refused_with_the_vehicles_word(ack: int, name: str) -> None:
    bench = Bench(Vehicle())
    bench.vehicle.ack = ack
    bench.upload()
    assert bench.results == [("UploadFence", "refused", f"MISSION_ACK says {name}")]


@pytest.mark.parametrize(
    ("changes", "detail"),
    [
        ({"param1": 4030.4}, None),
        ({"param1": 403.0}, "read back, its radius is 403 m, not 4030 m"),
        ({"x": 544_321_001}, None),
        ({"x": 544_322_000}, "read back, its centre is elsewhere"),
        ({"y": 111_987_000}, "read back, its centre is elsewhere"),
        ({"command": 5004}, "read back, it is MAV_CMD 5004, not an inclusion circle"),
        ({"param1": math.nan}, "read back, its radius is nan m, not 4030 m"),
    ],
)
def test_what_is_read_back_decides(changes: dict[str, float], detail: str | None) -> None:
    bench = Bench(Vehicle())
    bench.vehicle.changes = changes
    bench.upload()
    expected = ("refused", detail) if detail else ("accepted", "read back as it was sent")
    assert bench.results == [("UploadFence", *expected)]


def test_a_fence_of_another_size_is_not_ours() -> None:
    bench = Bench(Vehicle())
    bench.vehicle.count = 0
    bench.upload()
    assert bench.results == [("UploadFence", "refused", "read back, it has 0 items, not 1")]


@pytest.mark.parametrize("deaf", ["MISSION_COUNT", "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT"])
def test_every_step_is_tried_four_times(deaf: str) -> None:
    bench = Bench(Vehicle())
    bench.vehicle.deaf = {deaf}
    bench.upload()
    bench.wait(12.0)
    assert bench.results == [("UploadFence", "no_answer", f"no answer to {deaf}")]
    assert bench.vehicle.kinds.count(deaf) == 4


def test_where_the_last_ack_is_lost_reading_back_decides() -> None:
    bench = Bench(Vehicle())
    bench.vehicle.mute = {"MISSION_ITEM_INT"}
    bench.upload()
    bench.wait(2.9)
    assert bench.results == []
    bench.wait(0.2)
    assert [result for _, result, _ in bench.results] == ["accepted"]
    assert bench.vehicle.kinds.count("MISSION_COUNT") == 1


def test_where_the_item_never_arrives_reading_back_decides_too() -> None:
    bench = Bench(Vehicle())
    bench.vehicle.deaf = {"MISSION_ITEM_INT"}
    bench.upload()
    bench.wait(5.0)
    assert bench.results == [("UploadFence", "refused", "read back, it has 0 items, not 1")]


def test_a_vehicle_that_asks_for_ever_is_left() -> None:
    bench = Bench(Vehicle())
    bench.vehicle.deaf = {"MISSION_ITEM_INT"}
    bench.upload()
    for _ in range(20):
        bench.receive(
            bench.vehicle.pack("MISSION_REQUEST", seq=0, target_system=GCS, mission_type=FENCE)
        )
        bench.wait(1.0)
    assert bench.results == [("UploadFence", "no_answer", "it asks for the fence again and again")]


def test_a_lost_item_is_sent_again_when_the_vehicle_asks_again() -> None:
    bench = Bench(Vehicle())
    bench.vehicle.deaf = {"MISSION_ITEM_INT"}
    bench.upload()
    bench.wait(2.0)
    bench.vehicle.deaf = set()
    bench.receive(
        bench.vehicle.pack("MISSION_REQUEST", seq=0, target_system=GCS, mission_type=FENCE)
    )
    assert [result for _, result, _ in bench.results] == ["accepted"]


def test_words_about_missions_or_for_others_or_too_late_change_nothing() -> None:
    bench = Bench(Vehicle())
    bench.vehicle.deaf = {"MISSION_COUNT"}
    bench.upload()
    pack = bench.vehicle.pack
    bench.receive(pack("MISSION_ACK", type=1, target_system=GCS, mission_type=0))
    bench.receive(pack("MISSION_ACK", type=1, target_system=255, mission_type=FENCE))
    assert bench.results == []
    bench.vehicle.deaf = set()
    bench.wait(1.5)
    assert [result for _, result, _ in bench.results] == ["accepted"]
    bench.receive(pack("MISSION_ACK", type=1, target_system=GCS, mission_type=FENCE))
    bench.receive(pack("MISSION_REQUEST", seq=0, target_system=GCS, mission_type=FENCE))
    assert len(bench.results) == 1
