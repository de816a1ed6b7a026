"""A broker to test against, of each kind."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tests.brokers import Embedded, Mosquitto, needs_mosquitto


@pytest.fixture(params=["embedded", pytest.param("mosquitto", marks=needs_mosquitto)])
async def broker(
    request: pytest.FixtureRequest, tmp_path: Path
) -> AsyncIterator[Embedded | Mosquitto]:
    started = Embedded() if request.param == "embedded" else Mosquitto(tmp_path)
    await started.start()
    yield started
    await started.stop()
