"""The shipped mission script, run as a user would."""

from collections.abc import Callable
from pathlib import Path

from missions.find_beacon import find_beacon


async def test_the_mission_script_finds_the_beacon(short_mission: Callable[..., Path]) -> None:
    summary = await find_beacon(short_mission(), speedup=12.0)
    assert summary["result"] == "located"
