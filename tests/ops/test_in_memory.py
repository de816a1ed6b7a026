"""Whole missions on the virtual clock: real bytes, no sockets."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from swarmctl.errors import UsageError
from swarmctl.events import Notice
from swarmctl.ops.in_memory import fly_in_memory
from swarmctl.ops.station import Station

Short = Callable[..., Path]


def without_wall(summary: dict[str, object]) -> dict[str, object]:
    return {key: value for key, value in summary.items() if key != "wall_s"}


def test_a_short_mission_is_located_recorded_and_within_its_limits(
    short_mission: Short, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    summary = fly_in_memory(short_mission(), out, seed=3)
    assert summary == json.loads((out / "summary.json").read_text())
    assert summary["result"] == "located"
    assert float(str(summary["max_reference_range_m"])) <= 150.0
    assert float(str(summary["min_separation_m"])) >= 8.0
    assert float(str(summary["min_standoff_m"])) >= 400.0
    assert summary["rd_dropped"] == 0
    assert summary["mavlink_rejected"] == 0
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


def test_a_swarm_at_one_altitude_keeps_its_distances(short_mission: Short) -> None:
    """Out, round the beacon and home past one another, in wind and by their own navigation."""
    level = [{"sysid": sysid, "altitude_amsl_m": 42} for sysid in (1, 2, 3, 4)]
    summary = fly_in_memory(short_mission(swarm__vehicles=level), seed=3)
    assert summary["result"] == "located"
    assert float(str(summary["min_separation_m"])) >= 8.0
    assert float(str(summary["max_reference_range_m"])) <= 150.0
    assert float(str(summary["min_standoff_m"])) >= 400.0


def test_the_same_seed_gives_the_same_flight_and_another_seed_another(
    short_mission: Short, tmp_path: Path
) -> None:
    mission = short_mission()
    one = fly_in_memory(mission, tmp_path / "one", seed=5)
    two = fly_in_memory(mission, tmp_path / "two", seed=5)
    other = fly_in_memory(mission, tmp_path / "other", seed=6)
    assert without_wall(one) == without_wall(two)
    for name in ("vehicles.tlog", "mission.mcap"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    assert one["final_error_m"] != other["final_error_m"]


def test_garbage_on_both_inputs_harms_nothing(
    short_mission: Short, monkeypatch: pytest.MonkeyPatch
) -> None:
    mission = short_mission()
    calm = fly_in_memory(mission, seed=5)
    wake = Station.wake

    def wake_amid_garbage(station: Station, now: float) -> None:
        if not station.ended:
            for data in (b"", b"\xfd", b"\xfd\x09\x00\x00\x00\x01\x01\x00\x00\x00", b"hello" * 60):
                station.datagram(data, ("memory", 1), now)
            for payload in (b"", b"{", b"[]", b'{"v": 2}', b"\xff\x00", b'[{"v": 1, "rd_m": NaN}]'):
                station.message("swarm/alpha/tdoa", payload, now)
        wake(station, now)

    monkeypatch.setattr(Station, "wake", wake_amid_garbage)
    stormy = fly_in_memory(mission, seed=5)
    assert float(str(stormy["mavlink_rejected"])) > 1000
    assert float(str(stormy["feed_rejected"])) > 1000
    kept = ("result", "duration_s", "final_error_m", "final_sigma_m", "setpoints_out")
    assert {key: stormy[key] for key in kept} == {key: calm[key] for key in kept}


@pytest.mark.parametrize(
    ("kind", "result"), [("silent", "vehicle_silent"), ("refuses_arming", "arming_refused")]
)
def test_a_vehicle_at_fault_is_the_result(short_mission: Short, kind: str, result: str) -> None:
    mission = short_mission(sim__faults=[{"sysid": 3, "kind": kind}])
    said: list[Notice] = []
    summary = fly_in_memory(mission, on_notice=said.append)
    assert summary["result"] == result
    assert "vehicle 3" in str(summary["detail"])
    assert any(str(summary["detail"]) in notice.text for notice in said)


def test_a_vehicle_that_dies_in_flight_brings_the_others_home(short_mission: Short) -> None:
    mission = short_mission(sim__faults=[{"sysid": 2, "kind": "dies", "at_s": 70.0}])
    summary = fly_in_memory(mission)
    assert summary["result"] == "vehicle_lost"
    assert "vehicle 2 has been silent" in str(summary["detail"])


def test_a_mission_without_a_simulation_cannot_be_simulated(
    short_mission: Short, tmp_path: Path
) -> None:
    text = short_mission().read_text()
    path = tmp_path / "field.yaml"
    path.write_text(text[: text.index("sim:")] + text[text.index("swarm:") :])
    with pytest.raises(UsageError, match="has no sim section"):
        fly_in_memory(path)
