"""The shipped mission script: every line of it is run, on sockets and in memory."""

import contextlib
import runpy
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader

import swarmctl
from missions.find_beacon import find_beacon, in_words
from sim.world import World
from swarmctl.mission.snapshot import Snapshot
from swarmctl.recorder.summary import read_summary
from tests.summaries import SUMMARY, WITHOUT_TRUTH, known

Short = Callable[..., Path]
SCRIPT = str(Path(__file__).parents[1] / "missions" / "find_beacon.py")


@pytest.mark.slow
@pytest.mark.live
async def test_the_mission_script_finds_the_beacon(short_mission: Short) -> None:
    summary = await find_beacon(short_mission(), speedup=12.0)
    assert summary.result is swarmctl.MissionResult.LOCATED


@pytest.fixture
def recording(short_mission: Short, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the script's flight is recorded: in memory, and cut once there are estimates."""

    @contextlib.asynccontextmanager
    async def simulated(mission: Path, *, speedup: float) -> AsyncIterator[None]:
        yield

    async def fly(
        mission: Path, *, speedup: float, on_snapshot: Callable[[Snapshot], None]
    ) -> swarmctl.FlightSummary:
        summary = swarmctl.fly_in_memory(
            short_mission(),
            tmp_path,
            seed=3,
            on_snapshot=on_snapshot,
            until=lambda snapshot: snapshot.elapsed_s > 60.0,
        )
        return msgspec.structs.replace(
            summary, result=swarmctl.MissionResult.CANCELLED, detail="the flight is cut here"
        )

    monkeypatch.setattr(swarmctl, "simulated", simulated)
    monkeypatch.setattr(swarmctl, "fly", fly)
    monkeypatch.setattr("swarmctl.recorder.plots.write_plots", lambda *_: None)
    return tmp_path


def topics(recording: Path) -> set[str]:
    with (recording / "mission.mcap").open("rb") as stream:
        return {channel.topic for _, channel, _ in make_reader(stream).iter_messages()}


def test_the_script_tells_the_error_where_the_truth_is_known(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runpy.run_path(SCRIPT, run_name="__main__")
    assert "/truth/EmitterTruth" in topics(recording)
    *progress, last = capsys.readouterr().out.splitlines()
    assert any("vehicles at altitude" in line for line in progress)
    error_m = known(read_summary(recording).final_error_m)
    assert last == f"cancelled: the flight is cut here, {error_m:.1f} m off"


def test_the_script_ends_well_where_nobody_tells_the_truth(
    recording: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As with real vehicles."""
    publications = World.publications

    def without_truth(world: World) -> list[tuple[str, bytes]]:
        return [(topic, data) for topic, data in publications(world) if "truth" not in topic]

    monkeypatch.setattr(World, "publications", without_truth)
    runpy.run_path(SCRIPT, run_name="__main__")
    assert not any("truth" in topic.lower() for topic in topics(recording))
    summary = read_summary(recording)
    assert (summary.final_error_m, summary.min_standoff_m, summary.nees_mean) == (None, None, None)
    assert known(summary.final_sigma_m) > 0.0
    assert capsys.readouterr().out.splitlines()[-1] == "cancelled: the flight is cut here"


@pytest.mark.parametrize(
    ("summary", "words"),
    [
        (SUMMARY, "located: the emitter is located to 3.1 m (1 sigma, larger axis), 4.2 m off"),
        (WITHOUT_TRUTH, "located: the emitter is located to 3.1 m (1 sigma, larger axis)"),
        (
            msgspec.structs.replace(
                WITHOUT_TRUTH,
                result=swarmctl.MissionResult.LOW_BATTERY,
                detail="vehicle 2 is low",
            ),
            "low_battery: vehicle 2 is low",
        ),
    ],
    ids=["truth", "no truth", "lost"],
)
def test_the_script_puts_every_summary_in_words(
    summary: swarmctl.FlightSummary, words: str
) -> None:
    assert in_words(summary) == words
