"""The recording of a flight: its files in one directory.

===================  ==================================================================
``mission.yaml``     the mission file that was flown
``vehicles.tlog``    every MAVLink frame, for MAVProxy, Mission Planner, QGroundControl
``mission.mcap``     every observation, decision and command, for Foxglove and replay
===================  ==================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from swarmctl.errors import UsageError
from swarmctl.events import Record
from swarmctl.recorder.debrief import Debrief
from swarmctl.recorder.mcap_log import McapLog
from swarmctl.recorder.tlog import TlogWriter

MISSION_FILE = "mission.yaml"
TLOG_FILE = "vehicles.tlog"
MCAP_FILE = "mission.mcap"


class FlightRecorder:
    """Records a flight. The same records and frames give the same bytes.

    Args:
        directory: Directory of the recording; created if it is not there.
        mission_name: Name of the mission file, without directories.
        mission_text: Its text.
        provenance: Seed, versions and commit.
        debrief: Takes every record too.

    Raises:
        UsageError: The directory holds a recording already or cannot be written.
    """

    def __init__(
        self,
        directory: Path,
        *,
        mission_name: str,
        mission_text: str,
        provenance: Mapping[str, object],
        debrief: Debrief,
    ) -> None:
        try:
            for name in (MISSION_FILE, TLOG_FILE, MCAP_FILE):
                if (directory / name).exists():
                    msg = (
                        f"{directory} holds a recording already ({name}): "
                        "choose another directory or remove that one."
                    )
                    raise UsageError(msg)
            directory.mkdir(parents=True, exist_ok=True)
            (directory / MISSION_FILE).write_text(mission_text, encoding="utf-8")
            self._tlog = TlogWriter(directory / TLOG_FILE)
            self._mcap = McapLog(
                directory / MCAP_FILE,
                mission_name=mission_name,
                mission_text=mission_text,
                provenance=provenance,
            )
        except OSError as error:
            msg = (
                f"The flight cannot be recorded in {directory} ({error.strerror}): "
                "choose a directory that can be written."
            )
            raise UsageError(msg) from error
        self.debrief = debrief

    def record(self, record: Record, utc_s: float) -> None:
        """Keep a record that was made or arrived at ``utc_s`` (UTC, s)."""
        self._mcap.write(record, utc_s)
        self.debrief.record(record)

    def frame(self, raw: bytes, utc_s: float) -> None:
        """Keep a MAVLink frame that was received or sent at ``utc_s`` (UTC, s)."""
        self._tlog.write(raw, utc_s)

    def close(self) -> None:
        """Finish the files."""
        self._tlog.close()
        self._mcap.close()
