"""A link that nobody or two vehicles have spoken to yet."""

from __future__ import annotations

import pytest

from tests.link.bench import AT_1, AT_2, Bench, Vehicle


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def two(bench: Bench) -> tuple[Bench, Vehicle, Vehicle]:
    """A link that knows two vehicles; what their first heartbeats caused is cleared away."""
    one, two = Vehicle(1), Vehicle(2)
    bench.receive(one.state(), AT_1)
    bench.receive(two.state(), AT_2)
    bench.heard.clear()
    bench.sent.clear()
    bench.link.traffic()
    return bench, one, two
