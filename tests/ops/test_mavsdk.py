"""A mission flown on MAVSDK, over real sockets; and what a mission cannot have with it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from swarmctl.errors import UsageError
from swarmctl.ops.live import fly
from swarmctl.ops.simulation import simulated

Short = Callable[..., Path]

SPEEDUP = 10.0


async def test_a_mission_flies_on_mavsdk(short_mission: Short) -> None:
    pytest.importorskip("mavsdk", reason="MAVSDK is not installed", exc_type=ImportError)
    mission = short_mission(
        swarm__backend="mavsdk", swarm__autopilot="px4", sim__autopilot="px4", goal__sigma_m=30
    )
    async with simulated(mission, speedup=SPEEDUP):
        summary = await fly(mission, speedup=SPEEDUP)
    # Located ends only once every vehicle has landed at home and disarmed.
    assert summary["result"] == "located"
    assert summary["setpoints_dropped"] == 0
    assert summary["mavlink_rejected"] == 0


@pytest.mark.parametrize(
    ("changes", "forward", "field"),
    [
        ({"swarm__signing_key_file": "swarm.key"}, (), "swarm.signing_key_file"),
        ({"limits__upload_geofence": True}, (), "limits.upload_geofence"),
        ({}, ("udpout://127.0.0.1:14551",), "--forward"),
    ],
)
async def test_what_mavsdk_does_not_do_is_refused(
    short_mission: Short, changes: dict[str, object], forward: tuple[str, ...], field: str
) -> None:
    mission = short_mission(swarm__backend="mavsdk", **changes)
    with pytest.raises(UsageError, match=field) as refused:
        await fly(mission, forward=forward)
    assert refused.value.exit_code == 2


async def test_without_mavsdk_the_extra_is_named(
    short_mission: Short, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "swarmctl.link.mavsdk_backend", raising=False)
    for name in [name for name in sys.modules if name.partition(".")[0] == "mavsdk"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "mavsdk", None)
    with pytest.raises(UsageError, match=r"install swarmctl\[mavsdk\]"):
        await fly(short_mission(swarm__backend="mavsdk"))
