"""A flight's recording and debrief: opened when the flight can begin, closed in any case."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from types import TracebackType

import msgspec

from swarmctl.events import Record
from swarmctl.mission.filter_settings import (
    emitter_prior,
    expected_enu,
    process_noise,
    receiver_errors,
)
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.phases import OBSERVING
from swarmctl.ops.provenance import provenance
from swarmctl.ops.station import Station
from swarmctl.recorder.debrief import Debrief, DebriefSettings
from swarmctl.recorder.flight_recorder import FlightRecorder
from swarmctl.recorder.summary import FlightSummary, write_summary


class Recording:
    """What a station records into; a context manager that closes the files.

    Args:
        mission: The mission.
        mission_path: Its file, copied into the recording.
        out: Directory of the recording; None records nothing and still gives a summary.
        seed: Seed of the simulation; None for real vehicles.
    """

    def __init__(
        self, mission: Mission, mission_path: Path, out: str | Path | None, seed: int | None
    ) -> None:
        prior = emitter_prior(mission)
        self._debrief = Debrief(
            DebriefSettings(
                frame=mission.frame,
                reference=mission.swarm.reference,
                prior_mean=expected_enu(mission),
                prior_covariance=prior.covariance,
                process_noise=process_noise(mission),
                sigma_p_m=mission.filter.sigma_p_m,
                errors=receiver_errors(mission),
                d_max_m=mission.limits.d_max_m,
                stand_off_m=mission.limits.stand_off_m,
                observing_phases=frozenset(map(str, OBSERVING)),
            )
        )
        self._provenance = provenance(seed)
        self._mission_path = mission_path
        self._out = Path(out) if out is not None else None
        self._recorder: FlightRecorder | None = None

    def open(self) -> None:
        """Create the files. Records before that only reach the debrief.

        Raises:
            UsageError: If the directory cannot be used.
        """
        if self._out is not None:
            self._recorder = FlightRecorder(
                self._out,
                mission_name=self._mission_path.name,
                mission_text=self._mission_path.read_text(encoding="utf-8"),
                provenance=self._provenance,
                debrief=self._debrief,
            )

    def __enter__(self) -> Recording:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def record(self, record: Record, utc_s: float) -> None:
        """Keep a record made at ``utc_s``."""
        if self._recorder is not None:
            self._recorder.record(record, utc_s)
        else:
            self._debrief.record(record)

    def traffic(self, frames: Iterable[tuple[float, bytes]], utc_offset_s: float) -> None:
        """Keep MAVLink frames sent or received.

        Args:
            frames: Each with its monotonic time, s.
            utc_offset_s: UTC less that time, s.
        """
        if self._recorder is not None:
            for at_s, raw in frames:
                self._recorder.frame(raw, at_s + utc_offset_s)

    def close(self) -> None:
        """Finish the files, so that they can be read; a second call does nothing."""
        if self._recorder is not None:
            self._recorder.close()
            self._recorder = None

    def summary(self, station: Station, wall_s: float) -> FlightSummary:
        """Sum the flight up; with a directory, write the summary and the plots.

        Args:
            station: The station that flew.
            wall_s: Wall time of the flight, s.
        """
        self.close()
        summary = FlightSummary(
            **msgspec.structs.asdict(self._debrief.figures()),
            **station.counts(),
            **self._provenance,
            wall_s=wall_s,
            mission=station.controller.mission.name,
        )
        if self._out is not None:
            from swarmctl.recorder.plots import write_plots  # noqa: PLC0415 - matplotlib is slow

            write_summary(self._out, summary)
            write_plots(self._debrief, self._out)
        return summary
