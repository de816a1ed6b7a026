"""The summary file."""

from __future__ import annotations

import json
import math
from pathlib import Path

import msgspec
import pytest

from swarmctl.recorder.summary import FlightSummary, read_summary, write_summary
from tests.summaries import SUMMARY

KEYS = [
    "commit",
    "converged_s",
    "d_max_m",
    "detail",
    "duration_s",
    "estimates",
    "feed_rejected",
    "final_error_m",
    "final_range_m",
    "final_sigma_m",
    "health",
    "mavlink_messages_in",
    "mavlink_rejected",
    "max_reference_range_m",
    "max_slot_error_m",
    "min_separation_m",
    "min_standoff_m",
    "mission",
    "nees_final",
    "nees_mean",
    "pcrb_final_m",
    "rd_aside",
    "rd_dropped",
    "rd_measurements",
    "rd_repeated",
    "result",
    "seed",
    "setpoints_dropped",
    "setpoints_out",
    "slot_error_rms_m",
    "stand_off_m",
    "versions",
    "wall_s",
]
"""The public names, in their order in the file."""


def test_it_is_sorted_indented_json_with_the_public_names(tmp_path: Path) -> None:
    path = write_summary(tmp_path, SUMMARY)
    assert path == tmp_path / "summary.json"
    text = path.read_text()
    assert list(json.loads(text)) == KEYS
    assert text.splitlines()[:3] == ["{", '  "commit": "abc",', '  "converged_s": 61.5,']
    assert '  "result": "located",' in text.splitlines()
    assert text.endswith("}\n")


def test_a_number_that_is_not_finite_is_written_as_null(tmp_path: Path) -> None:
    odd = msgspec.structs.replace(SUMMARY, final_sigma_m=math.nan, health={"tracking": math.inf})
    written = json.loads(write_summary(tmp_path, odd).read_text())
    assert (written["final_sigma_m"], written["health"]) == (None, {"tracking": None})


def test_it_is_read_as_it_was_written(tmp_path: Path) -> None:
    write_summary(tmp_path, SUMMARY)
    assert read_summary(tmp_path) == SUMMARY


def test_it_cannot_be_changed() -> None:
    with pytest.raises(AttributeError):
        SUMMARY.seed = 2  # type: ignore[misc]


def test_every_field_is_explained() -> None:
    explained = "".join(str(kind.__doc__) for kind in FlightSummary.__mro__)
    assert [name for name in KEYS if f"\n        {name}: " not in explained] == []
