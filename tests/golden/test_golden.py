"""The same seed gives the same flight as when it was recorded, to the last bit."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path
from typing import Any

import pytest

from tests.golden.flights import FLIGHTS, LONG_FLIGHTS, GoldenFlight, fly, load

RELATIVE = 1e-6
"""How far numbers may be apart on a machine whose arithmetic differs in the last bit: the
feedback of a minute's flight enlarges 1e-16 to about 1e-9 here."""


def assert_same(flown: list[str], golden: list[str]) -> None:
    """Exactly equal on the machine's kind that recorded; else equal decisions, close numbers."""
    if flown[0] == golden[0]:
        for n, (now, then) in enumerate(itertools.zip_longest(flown, golden)):
            assert now == then, f"line {n} differs"
        return
    assert_close(_comparable(flown), _comparable(golden))


def _comparable(lines: list[str]) -> list[Any]:
    return [line for line in map(json.loads, lines[1:]) if "topic" in line]


def assert_close(now: Any, then: Any, where: str = "") -> None:  # noqa: ANN401 - JSON
    if isinstance(then, dict):
        assert now.keys() == then.keys(), where
        for key in then:
            assert_close(now[key], then[key], f"{where}.{key}")
    elif isinstance(then, list):
        assert len(now) == len(then), where
        for i, (a, b) in enumerate(zip(now, then, strict=True)):
            assert_close(a, b, f"{where}[{i}]")
    elif isinstance(then, float):
        assert math.isclose(now, then, rel_tol=RELATIVE, abs_tol=RELATIVE), where
    else:
        assert now == then, where


@pytest.mark.parametrize("flight", FLIGHTS, ids=str)
def test_a_flight_comes_out_as_recorded(flight: GoldenFlight, tmp_path: Path) -> None:
    assert_same(fly(flight, tmp_path / "flight"), load(flight))


@pytest.mark.slow
@pytest.mark.parametrize("flight", LONG_FLIGHTS, ids=str)
def test_a_long_flight_comes_out_as_recorded(flight: GoldenFlight, tmp_path: Path) -> None:
    assert_same(fly(flight, tmp_path / "flight"), load(flight))


def test_a_changed_number_is_noticed() -> None:
    golden = load(FLIGHTS[0])
    flown = [line.replace('"los_rad": ', '"los_rad": 1') for line in golden]
    with pytest.raises(AssertionError, match="differs"):
        assert_same(flown, golden)


def test_a_last_bit_is_forgiven_only_to_another_kind_of_machine() -> None:
    golden = load(FLIGHTS[0])
    (n,) = [n for n, line in enumerate(golden) if '"Plan"' in line][:1]
    plan = json.loads(golden[n])
    plan["los_rad"] = math.nextafter(plan["los_rad"], math.inf)
    flown = [*golden[:n], json.dumps(plan), *golden[n + 1 :]]
    with pytest.raises(AssertionError, match="differs"):
        assert_same(flown, golden)
    flown[0] = '{"arithmetic": "another"}'
    assert_same(flown, golden)
    plan["los_rad"] += 1e-3
    with pytest.raises(AssertionError, match="los_rad"):
        assert_same([*flown[:n], json.dumps(plan), *flown[n + 1 :]], golden)
