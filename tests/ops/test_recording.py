"""The recording's life: opened late, closed always, stamped with where it comes from."""

from pathlib import Path

import pytest

from swarmctl.decisions import PhaseChanged
from swarmctl.errors import UsageError
from swarmctl.mission.mission_file_loading import load_mission
from swarmctl.ops.recording import Recording
from swarmctl.ops.station import Station
from swarmctl.ops.vehicle_links import native_link
from swarmctl.recorder.summary import read_summary
from tests.missions import DEMO


def recording(out: Path | None, seed: int | None = 4) -> Recording:
    return Recording(load_mission(DEMO), DEMO, out, seed)


def test_nothing_is_created_before_it_is_opened(tmp_path: Path) -> None:
    with recording(tmp_path / "out") as kept:
        kept.record(PhaseChanged(at_s=0.0, phase="waiting", trigger="", reason=""), 0.0)
        kept.traffic([(0.0, b"\xfd")], 0.0)
    assert not (tmp_path / "out").exists()


def test_what_is_open_is_closed_even_when_something_raises(tmp_path: Path) -> None:
    out = tmp_path / "out"

    def fly() -> None:
        with recording(out) as kept:
            kept.open()
            kept.record(PhaseChanged(at_s=0.0, phase="waiting", trigger="", reason=""), 0.0)
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fly()
    assert (out / "mission.mcap").read_bytes().endswith(b"\x89MCAP0\r\n")
    assert (out / "mission.yaml").read_text() == DEMO.read_text()


def station(kept: Recording) -> Station:
    mission = load_mission(DEMO)
    return Station(mission, native_link(mission), 0.0, 0.0, kept)


def test_a_recording_that_is_there_is_kept(tmp_path: Path) -> None:
    with recording(tmp_path) as first:
        first.open()
    with recording(tmp_path) as second, pytest.raises(UsageError, match="holds a recording"):
        second.open()


def test_a_summary_says_where_it_comes_from(tmp_path: Path) -> None:
    with recording(tmp_path) as kept:
        kept.open()
        summary = kept.summary(station(kept), 1.5)
    assert read_summary(tmp_path) == summary
    assert (summary.seed, summary.mission, summary.wall_s) == (4, "beacon_drift", 1.5)
    assert {"swarmctl", "python", "numpy", "pymavlink"} <= summary.versions.keys()


def test_without_a_directory_there_is_still_a_summary() -> None:
    with recording(None, None) as kept:
        kept.open()
        summary = kept.summary(station(kept), 1.5)
    assert summary.seed is None
    assert summary.final_error_m is None
