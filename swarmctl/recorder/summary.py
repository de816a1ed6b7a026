"""What came of a flight: the figures that ``summary.json`` holds, and the file itself."""

from __future__ import annotations

from pathlib import Path

import msgspec

from swarmctl.results import MissionResult

SUMMARY_FILE = "summary.json"


class FlightFigures(msgspec.Struct, frozen=True, kw_only=True):
    """The figures that the debrief works out; lengths in m, times in s of mission time.

    What needs the true emitter is None where nobody tells it: with real vehicles.

    Attributes:
        result: How the mission ended; None if it did not.
        detail: The same as a sentence.
        duration_s: Time from the first record to the end.
        final_error_m: Horizontal distance of the final estimate from the true emitter. The final
            estimate is the last of the observing phases, or of the flight if it never observed.
        final_sigma_m: Larger axis of its horizontal 1-sigma ellipse.
        final_range_m: 3-D distance of the reference UAV from the true emitter at its epoch.
        pcrb_final_m: The same axis of the Cramér-Rao bound along the flown geometry.
        nees_final: Its normalised estimation error squared (2 degrees of freedom: 2 is right).
        nees_mean: Mean horizontal NEES over the estimates of the observing phases after
            convergence.
        converged_s: Time from the first formed plan until the larger 1-sigma axis first was
            below 25 m; 0 if it was before.
        slot_error_rms_m: RMS distance of the followers from their slots, while the formation
            stood in the observing phases.
        max_slot_error_m: Greatest such distance.
        max_reference_range_m: Greatest distance of a follower from the reference UAV, likewise.
        min_separation_m: Least 3-D distance between two airborne UAVs.
        min_standoff_m: Least 3-D distance of an airborne UAV from the true emitter.
        d_max_m: The mission's limit of ``max_reference_range_m``.
        stand_off_m: The mission's limit of ``min_standoff_m``.
        rd_measurements: Range differences or arrival times received.
        estimates: Estimates made.
        health: Seconds that the track was in each status until the end; None without a track.
    """

    result: MissionResult | None
    detail: str | None
    duration_s: float
    final_error_m: float | None
    final_sigma_m: float | None
    final_range_m: float | None
    pcrb_final_m: float | None
    nees_final: float | None
    nees_mean: float | None
    converged_s: float | None
    slot_error_rms_m: float | None
    max_slot_error_m: float | None
    max_reference_range_m: float | None
    min_separation_m: float | None
    min_standoff_m: float | None
    d_max_m: float
    stand_off_m: float
    rd_measurements: int
    estimates: int
    health: dict[str, float] | None


class FlightSummary(FlightFigures, frozen=True, kw_only=True):
    """What came of a flight: the contents of ``summary.json``.

    Attributes:
        mavlink_messages_in: MAVLink messages received from the mission's vehicles.
        mavlink_rejected: MAVLink inputs that were malformed or not wanted.
        setpoints_out: Setpoints sent.
        setpoints_dropped: Setpoints not sent for want of a vehicle that takes them.
        feed_rejected: Messages of the feed that were malformed or not wanted.
        rd_dropped: Range differences and arrival times that could not be used.
        rd_aside: Range differences set aside as echoes.
        rd_repeated: Range differences left out as copies of earlier ones.
        wall_s: Wall time of the flight, s.
        mission: Name of the mission.
        seed: Seed of the simulation; None for real vehicles.
        versions: Versions of swarmctl, Python and the packages that shape numbers.
        commit: Commit of the checkout; None outside one.
    """

    mavlink_messages_in: int
    mavlink_rejected: int
    setpoints_out: int
    setpoints_dropped: int
    feed_rejected: int
    rd_dropped: int
    rd_aside: int
    rd_repeated: int
    wall_s: float
    mission: str
    seed: int | None
    versions: dict[str, str]
    commit: str | None


def write_summary(directory: Path, summary: FlightSummary) -> Path:
    """Write ``summary.json``, keys sorted, indented; a number that is not finite becomes null.

    Returns:
        The file written.
    """
    path = directory / SUMMARY_FILE
    encoded = msgspec.json.encode(summary, order="sorted")
    path.write_bytes(msgspec.json.format(encoded, indent=2) + b"\n")
    return path


def read_summary(directory: Path) -> FlightSummary:
    """Read the ``summary.json`` of a recording.

    Raises:
        OSError: The file cannot be read.
        msgspec.DecodeError: It is not a summary.
    """
    return msgspec.json.decode((directory / SUMMARY_FILE).read_bytes(), type=FlightSummary)
