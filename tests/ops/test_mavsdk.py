"""A mission flown on MAVSDK, over real sockets; and what a mission cannot have with it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from swarmctl.errors import UsageError
from swarmctl.frames import LocalFrame
from swarmctl.mission.mission_file_loading import load_mission
from swarmctl.ops.live import fly
from swarmctl.ops.simulation import simulated

Short = Callable[..., Path]

SPEEDUP = 10.0
HOME_M = 5.0
"""They sink when they are this close, and the noise of GNSS comes on top; slots are 150 m away."""
ON_THE_GROUND_M = 3.0
"""The altitude's noise; they fly 50 m and more above the ground."""


@pytest.mark.live
@pytest.mark.slow
async def test_a_mission_flies_on_mavsdk(short_mission: Short, tmp_path: Path) -> None:
    mission = short_mission(
        swarm__backend="mavsdk", swarm__autopilot="px4", sim__autopilot="px4", goal__sigma_m=30
    )
    async with simulated(mission, speedup=SPEEDUP):
        summary = await fly(mission, tmp_path / "out", speedup=SPEEDUP)
    assert summary.result == "located"
    assert summary.setpoints_dropped == 0
    assert summary.mavlink_rejected == 0
    last: dict[str, dict[str, Any]] = {}
    with (tmp_path / "out" / "mission.mcap").open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            last[channel.topic] = json.loads(message.data)
    for sysid in load_mission(mission).swarm.sysids:
        assert not last[f"/vehicle/{sysid}/Heartbeat"]["armed"]
        now = last[f"/vehicle/{sysid}/VehiclePosition"]
        home = last[f"/vehicle/{sysid}/HomePosition"]
        frame = LocalFrame(home["lat_rad"], home["lon_rad"], home["alt_amsl_m"])
        east, north, up = frame.to_enu(now["lat_rad"], now["lon_rad"], now["alt_amsl_m"])
        assert math.hypot(east, north) < HOME_M
        assert abs(up) < ON_THE_GROUND_M


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
