"""MAVLink signing as a mission wants it: its key, and its timestamp kept on disk in flight."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path

from swarmctl.errors import LinkError
from swarmctl.link.signing import Signing, timestamp_at
from swarmctl.link.signing_key_file import STORE_EVERY_S, TimestampFile, read_key
from swarmctl.mission.mission_file import Mission


def signing_key(mission: Mission) -> bytes | None:
    """The key that signs MAVLink; None if the mission wants no signing.

    Raises:
        UsageError: If the key file holds no key.
    """
    path = mission.swarm.signing_key_file
    return read_key(Path(path)) if path else None


@contextlib.asynccontextmanager
async def signing(
    mission: Mission, utc_start_s: float, speedup: float
) -> AsyncIterator[Signing | None]:
    """MAVLink signing for a flight; None if the mission wants no signing.

    Args:
        mission: The mission.
        utc_start_s: UTC at the station's time 0, s.
        speedup: Seconds of the station per second. If it is not 1, the station's UTC runs away
            from the true one and no timestamp is kept: the next flight would begin with one too
            far in the future.

    Raises:
        UsageError: If the key file holds no key.
        LinkError: If the timestamp cannot be kept beside it.
    """
    key = signing_key(mission)
    if key is None:
        yield None
        return
    if speedup != 1.0:
        yield Signing(key, timestamp_at(utc_start_s), utc_start_s)
        return
    file = TimestampFile(Path(mission.swarm.signing_key_file))
    used = Signing(key, max(file.load(), timestamp_at(utc_start_s)), utc_start_s)
    file.store(used.timestamp)
    keeper = asyncio.create_task(_keep(used, file))
    try:
        yield used
    finally:
        keeper.cancel()


async def _keep(used: Signing, file: TimestampFile) -> None:
    while True:
        await asyncio.sleep(STORE_EVERY_S)
        # A full disk in mid-flight is no reason to stop: the reserve lasts, and the clock of
        # this computer is right.
        with contextlib.suppress(LinkError):
            file.store(used.timestamp)
