"""Results as JSON."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import NamedTuple

from swarmctl.study.jsonable import dumps


class Pair(NamedTuple):
    """A named tuple."""

    low: float
    high: float


@dataclass(frozen=True)
class Row:
    """A dataclass in which there is a tuple."""

    name: str
    at: tuple[Pair, ...]


def test_what_is_no_number_is_null() -> None:
    text = dumps({"rows": [Row("a", (Pair(1.5, math.inf), Pair(math.nan, 2.0)))], "runs": 3})
    assert json.loads(text) == {
        "rows": [{"name": "a", "at": [[1.5, None], [None, 2.0]]}],
        "runs": 3,
    }
