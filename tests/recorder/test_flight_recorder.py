"""The directory a flight leaves behind."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.reader import make_reader
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.errors import UsageError
from swarmctl.recorder.debrief import Debrief
from swarmctl.recorder.flight_recorder import FlightRecorder
from tests.recorder import flight as made_up
from tests.recorder.samples import ONE_OF_EACH

UTC_S = made_up.UTC_S


def recorder(directory: Path) -> FlightRecorder:
    return FlightRecorder(
        directory,
        mission_name="beacon.yaml",
        mission_text="name: beacon\n",
        provenance={"seed": 1},
        debrief=Debrief(made_up.SETTINGS),
    )


def record_a_flight(directory: Path) -> FlightRecorder:
    it = recorder(directory)
    for k, record in enumerate(ONE_OF_EACH):
        it.record(record, UTC_S + k)
    it.frame(
        mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 4, 3).pack(mavlink.MAVLink(None)), UTC_S
    )
    it.close()
    return it


def test_everything_is_there_and_opens(tmp_path: Path) -> None:
    directory = tmp_path / "flights" / "7"
    it = record_a_flight(directory)
    assert sorted(p.name for p in directory.iterdir()) == [
        "mission.mcap",
        "mission.yaml",
        "vehicles.tlog",
    ]
    assert (directory / "mission.yaml").read_text() == "name: beacon\n"
    with (directory / "mission.mcap").open("rb") as stream:
        assert len(list(make_reader(stream).iter_messages())) == len(ONE_OF_EACH)
    reader = mavutil.mavlink_connection(str(directory / "vehicles.tlog"))
    assert reader.recv_msg().get_type() == "HEARTBEAT"
    reader.close()
    assert it.debrief.figures().estimates == 1


def test_the_same_flight_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        record_a_flight(tmp_path / name)
    for name in ("mission.mcap", "mission.yaml", "vehicles.tlog"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


@pytest.mark.parametrize("name", ["mission.yaml", "vehicles.tlog", "mission.mcap"])
def test_a_recording_is_never_overwritten(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"precious")
    with pytest.raises(UsageError) as caught:
        recorder(tmp_path)
    assert str(caught.value) == (
        f"{tmp_path} holds a recording already ({name}): "
        "choose another directory or remove that one."
    )
    assert [p.name for p in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_bytes() == b"precious"


def test_an_empty_directory_is_used(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    record_a_flight(tmp_path)
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_a_directory_that_cannot_be_is_a_usage_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError) as caught:
        recorder(tmp_path / "file" / "flight")
    assert str(caught.value) == (
        f"The flight cannot be recorded in {tmp_path / 'file' / 'flight'} (Not a directory): "
        "choose a directory that can be written."
    )
