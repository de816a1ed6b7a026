"""The mission the tests fly: like the demo's, but near and brief."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

DEMO = Path(__file__).parents[1] / "missions" / "beacon_drift.yaml"

BRIEF: dict[str, object] = {
    "swarm__vehicles": [{"sysid": i, "altitude_amsl_m": 5 + 9 * i} for i in (1, 2, 3, 4)],
    "limits__stand_off_m": 330,
    "limits__d_max_m": 100,
    "emitter__lat_deg": 54.4335,
    "emitter__lon_deg": 11.1930,
    "emitter__sigma_m": 60,
    "sim__emitter": {"lat_deg": 54.4338, "lon_deg": 11.1925, "alt_amsl_m": 0, "drift_mps": 0.5},
    "goal__orbit_s": 5,
    "feed__timeout_s": 60,
}
"""Changes of the short mission: low, near and briefer still."""


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
