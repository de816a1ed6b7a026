"""Results as JSON, which has no word for a number that does not exist."""

from __future__ import annotations

import dataclasses
import json
import math


def dumps(value: object) -> str:
    """``value`` as JSON: dataclasses are objects, and NaN and infinity are null."""
    return json.dumps(_plain(value), indent=1, allow_nan=False)


def _plain(value: object) -> object:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
