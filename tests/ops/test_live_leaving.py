"""What the operator is told when the swarm is left in flight."""

from __future__ import annotations

from typing import Literal

import pytest

from swarmctl.events import Heartbeat, Mode, ParameterValue
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.ops.live import what_vehicles_do
from swarmctl.ops.station import Station
from swarmctl.ops.vehicle_links import native_link
from tests.missions import short_mission_text


@pytest.fixture
def station() -> Station:
    mission = parse_mission(short_mission_text())
    return Station(mission, native_link(mission), 0.0, 0.0, None)


def hear(
    station: Station,
    sysid: int,
    autopilot: Literal["ardupilot", "px4", "other"],
    mode_name: str,
    parameters: dict[str, float],
) -> None:
    fleet = station.controller.fleet
    fleet.observe(
        Heartbeat(
            received_s=0.0,
            sysid=sysid,
            autopilot=autopilot,
            is_multirotor=True,
            mode=Mode.GUIDED,
            mode_name=mode_name,
            armed=True,
        )
    )
    for name, value in parameters.items():
        fleet.observe(
            ParameterValue(received_s=0.0, sysid=sysid, parameter=name, value=value, own_name=name)
        )


def test_each_vehicle_does_what_its_own_autopilot_and_parameters_make_it_do(
    station: Station,
) -> None:
    hear(station, 1, "ardupilot", "GUIDED", {})
    hear(station, 2, "ardupilot", "GUIDED", {"FS_GCS_ENABLE": 1.0})
    hear(station, 3, "px4", "OFFBOARD", {"COM_OBL_RC_ACT": 3.0})
    lines = what_vehicles_do(station).splitlines()[1:]
    assert "vehicle 1 (GUIDED) brakes about 3 s after the last setpoint and hovers" in lines[0]
    assert "vehicle 2 (GUIDED) brakes about 3 s after the last setpoint and returns" in lines[1]
    assert "vehicle 3 (OFFBOARD) leaves OFFBOARD about 1 s after the last setpoint" in lines[2]
    assert "returns to its own home" in lines[2]
    assert lines[3] == "  vehicle 4 was never heard."
    assert len(lines) == 4
