"""The summary file."""

from __future__ import annotations

import json
import math
from pathlib import Path

from swarmctl.recorder.summary import write_summary


def test_it_is_sorted_indented_json_without_nan(tmp_path: Path) -> None:
    path = write_summary(tmp_path, {"b": math.nan, "a": {"d": 1, "c": math.inf}, "e": None})
    assert path == tmp_path / "summary.json"
    text = path.read_text()
    assert json.loads(text) == {"a": {"c": None, "d": 1}, "b": None, "e": None}
    assert text.splitlines()[:3] == ["{", '  "a": {', '    "c": null,']
    assert text.endswith("}\n")
