"""Finding mission files."""

from pathlib import Path

import pytest

from swarmctl.cli.missions import find_mission, shipped_missions
from swarmctl.errors import UsageError


def test_shipped_missions_are_found_by_name() -> None:
    assert set(shipped_missions()) >= {
        "beacon_drift",
        "beacon_static",
        "sitl_ardupilot",
        "sitl_px4",
        "table1",
    }
    assert find_mission("table1").name == "table1.yaml"


def test_a_file_goes_before_a_shipped_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("table1").write_text("mine")
    assert find_mission("table1") == Path("table1")


def test_neither_is_a_sentence_with_the_choices() -> None:
    with pytest.raises(UsageError, match=r"x\.yaml is neither .* \(beacon_drift, "):
        find_mission("x.yaml")
