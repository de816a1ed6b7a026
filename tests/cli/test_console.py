"""What the operator sees."""

import io
import re
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest
from rich.console import Console

from swarmctl.cli.console import Reporter, headless_line, print_summary, render
from swarmctl.decisions import Notice
from swarmctl.mission.estimate_projections import EstimateSnapshot
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.mission.snapshot import Snapshot, VehicleSnapshot
from swarmctl.results import MissionResult
from tests.missions import short_mission_text
from tests.summaries import SUMMARY, WITHOUT_TRUTH

VEHICLE = VehicleSnapshot(
    sysid=2,
    is_reference=False,
    mode="GUIDED",
    armed=True,
    alt_amsl_m=42.1,
    slot_error_m=0.83,
    range_to_reference_m=285.2,
    battery_fraction=0.71,
    silence_s=0.1,
    loss=0.013,
    rate_hz=17.0,
    rtt_s=0.0423,
)
SNAPSHOT = Snapshot(
    mission="short",
    phase="approaching",
    progress="1318 m to the orbit",
    elapsed_s=217.0,
    d_max_m=300.0,
    vehicles=(replace(VEHICLE, sysid=1, is_reference=True, slot_error_m=None), VEHICLE),
    estimate=EstimateSnapshot(
        position_enu=(2240.0, 1110.0, -2.5),
        lat_rad=0.95,
        lon_rad=0.19,
        velocity_enu=(1.4, 0.5, 0.0),
        sigma_major_m=11.6,
        sigma_minor_m=2.2,
        sigma_angle_rad=0.4,
        nis=1.83,
        rd_count=3,
        age_s=0.1,
        health="tracking",
        why="nothing is wrong",
        limit="geometry",
    ),
    rd_rate_hz=30.0,
    rd_used=6000,
    rd_aside=7,
    rd_dropped=12,
)


def shown(snapshot: Snapshot, *notices: Notice) -> str:
    page = io.StringIO()
    Console(file=page, width=140).print(render(snapshot, "a title", list(notices)))
    return page.getvalue()


def test_a_line_says_where_the_mission_is() -> None:
    assert headless_line(SNAPSHOT) == (
        "[  217 s] approaching 1318 m to the orbit"
        " | emitter ± 11.6 m (1σ), NIS 1.8 of 3, 30 RD/s, tracking, limited by geometry"
        " | slots ≤ 0.8 m, ranges ≤ 285 of 300 m"
    )


def test_a_line_before_anything_is_measured_is_short() -> None:
    bare = replace(VEHICLE, slot_error_m=None, range_to_reference_m=None)
    estimate = replace(SNAPSHOT.estimate, rd_count=0)
    line = headless_line(replace(SNAPSHOT, vehicles=(bare,), estimate=estimate))
    assert line == "[  217 s] approaching 1318 m to the orbit"


def test_the_live_console_shows_phase_vehicles_and_estimate() -> None:
    text = shown(SNAPSHOT, Notice(at_s=1.0, level="warning", text="mind the gap"))
    for part in (
        "a title",
        "APPROACHING",
        "1318 m to the orbit",
        "1 reference",
        "GUIDED",
        "42 m AMSL",
        "0.8 m",
        "285 of 300 m",
        "71%",
        "17/s, 1.3% lost, 42 ms",
        "1σ 11.6 x 2.2 m",
        "NIS 1.8 of 3",
        "30 RD/s",
        "6000 used, 7 set aside as echoes, 12 dropped",
        "tracking limited by geometry",
        "mind the gap",
    ):
        assert part in text


def test_a_track_that_is_not_to_be_believed_says_why() -> None:
    estimate = replace(SNAPSHOT.estimate, health="degraded", why="receiver 3 hears echoes")
    text = shown(replace(SNAPSHOT, estimate=estimate))
    assert "degraded limited by geometry" in text
    assert "receiver 3 hears echoes" in text
    assert "nothing is wrong" not in shown(SNAPSHOT)


def test_a_silent_vehicle_shows() -> None:
    silent = replace(VEHICLE, silence_s=4.0)
    never = replace(VEHICLE, silence_s=float("inf"))
    assert "silent 4 s" in shown(replace(SNAPSHOT, vehicles=(silent,)))
    assert "never heard" in shown(replace(SNAPSHOT, vehicles=(never,)))


def test_before_anything_is_measured_the_estimate_is_called_a_prior() -> None:
    estimate = replace(SNAPSHOT.estimate, rd_count=0)
    assert "nothing measured yet" in shown(replace(SNAPSHOT, estimate=estimate))


def test_where_there_is_no_terminal_lines_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    with Reporter(parse_mission(short_mission_text()), headless=False) as reporter:
        assert reporter.every_s == 3.0
        reporter.snapshot(SNAPSHOT)
        reporter.notice(Notice(at_s=12.0, level="error", text="vehicle 3 [x] fell silent"))
    output = capsys.readouterr().out
    assert "1318 m to the orbit" in output
    assert "[   12 s] error: vehicle 3 [x] fell silent" in output


def test_the_summary_tells_how_it_ended_and_the_figures(capsys: pytest.CaptureFixture[str]) -> None:
    print_summary(SUMMARY, Path("somewhere"))
    output = capsys.readouterr().out
    assert "located: the emitter is located to 3.1 m" in output
    assert re.search(r"error of the final estimate +4.25 m", output)
    assert re.search(r"mission time +420 s", output)
    assert "20.0 s, 21 x real time" in output
    assert "somewhere" in output


def test_the_summary_leaves_out_what_is_not_known(capsys: pytest.CaptureFixture[str]) -> None:
    lost = msgspec.structs.replace(
        WITHOUT_TRUTH,
        result=MissionResult.VEHICLE_LOST,
        detail="vehicle 2 has been silent for 5 s",
    )
    print_summary(lost, Path("somewhere"))
    output = capsys.readouterr().out
    assert "vehicle_lost: vehicle 2 has been silent for 5 s" in output
    assert "its 1-sigma, larger axis" in output
    assert "error of the final" not in output
