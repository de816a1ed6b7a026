"""Missions with a signing key: in memory and over UDP, and with a vehicle that has another key."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.decisions import Notice
from swarmctl.link.signing import timestamp_at
from swarmctl.mission.mission_file_loading import load_mission
from swarmctl.ops.in_memory import UTC_START_S as UTC_S
from swarmctl.ops.in_memory import fly_in_memory
from swarmctl.ops.live import fly
from swarmctl.ops.mission_signing import signing
from swarmctl.ops.simulation import simulated
from tests.link.signers import KEY
from tests.missions import BRIEF

Short = Callable[..., Path]

SPEEDUP = 10.0
SIGNED: int = mavlink.MAVLINK_IFLAG_SIGNED


@pytest.fixture
def signed_mission(short_mission: Short, tmp_path: Path) -> Short:
    """Writes a short mission with a signing key beside it."""
    (tmp_path / "swarm.key").write_bytes(KEY)
    return lambda **changes: short_mission(
        swarm__signing_key_file="swarm.key", goal__sigma_m=30, **BRIEF, **changes
    )


def speakers(tlog: Path) -> set[tuple[int, bool]]:
    """System ids of a recording, and whether their frames are signed."""
    reader = mavutil.mavlogfile(str(tlog))
    said = set()
    with contextlib.closing(reader):
        while (message := reader.recv_msg()) is not None:
            said.add((message.get_srcSystem(), bool(message.get_msgbuf()[2] & SIGNED)))
    return said


EVERYBODY_SIGNS = {(sysid, True) for sysid in (1, 2, 3, 4, 245)}


@pytest.mark.slow
def test_a_mission_with_a_key_flies_in_memory(signed_mission: Short, tmp_path: Path) -> None:
    mission = signed_mission(swarm__autopilot="px4", sim__autopilot="px4")
    summary = fly_in_memory(mission, tmp_path / "out")
    assert (summary.result, summary.mavlink_rejected) == ("located", 0)
    assert speakers(tmp_path / "out" / "vehicles.tlog") == EVERYBODY_SIGNS
    assert not (tmp_path / "swarm.key.timestamp").exists()


@pytest.mark.live
@pytest.mark.slow
async def test_a_mission_with_a_key_flies_over_udp(signed_mission: Short, tmp_path: Path) -> None:
    mission = signed_mission()
    async with simulated(mission, speedup=SPEEDUP):
        summary = await fly(mission, speedup=SPEEDUP)
    # What is not signed with the key is refused on either side.
    assert (summary.result, summary.mavlink_rejected) == ("located", 0)
    assert not (tmp_path / "swarm.key.timestamp").exists()


async def test_in_real_time_the_timestamp_is_kept_for_the_next_start(
    signed_mission: Short, tmp_path: Path
) -> None:
    async with signing(load_mission(signed_mission()), UTC_S, 1.0) as used:
        assert used is not None
        stored = int((tmp_path / "swarm.key.timestamp").read_text())
        assert stored > used.timestamp >= timestamp_at(UTC_S)
    async with signing(load_mission(signed_mission()), UTC_S, 1.0) as again:
        assert again is not None
        assert again.timestamp == stored


def test_a_vehicle_with_another_key_is_refused_and_named(signed_mission: Short) -> None:
    faults = [{"sysid": 3, "kind": "other_key"}]
    said: list[Notice] = []
    summary = fly_in_memory(signed_mission(sim__faults=faults), on_notice=said.append)
    assert summary.result == "vehicle_silent"
    assert "vehicle 3" in str(summary.detail)
    # A heartbeat a second until the mission gives up after 30 s.
    assert summary.mavlink_rejected == pytest.approx(30, abs=5)
    (named,) = (notice.text for notice in said if "signed with another key" in notice.text)
    assert "of system 3" in named
