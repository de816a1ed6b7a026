"""The mission the tests fly: like the demo's, but near and brief."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

DEMO = Path(__file__).parents[1] / "missions" / "beacon_drift.yaml"


def short_mission_text(**changes: object) -> str:
    """YAML of the short mission; keyword arguments set fields, ``__`` for a dot."""
    raw: dict[str, Any] = yaml.safe_load(DEMO.read_text())
    raw["name"] = "short"
    raw["emitter"] |= {"lat_deg": 54.4360, "lon_deg": 11.1960, "sigma_m": 100}
    raw["sim"]["emitter"] |= {"lat_deg": 54.4365, "lon_deg": 11.1955}
    raw["limits"] |= {"stand_off_m": 400, "d_max_m": 150}
    raw["goal"] |= {"orbit_s": 10, "sigma_m": 8}
    for path, value in changes.items():
        *parents, last = path.split("__")
        section = raw
        for part in parents:
            section = section[part]
        section[last] = value
    return yaml.safe_dump(raw)
