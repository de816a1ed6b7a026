"""Summaries of flights, and what tests ask of them."""

from __future__ import annotations

import msgspec

from swarmctl import FlightSummary, MissionResult

SUMMARY = FlightSummary(
    result=MissionResult.LOCATED,
    detail="the emitter is located to 3.1 m (1 sigma, larger axis)",
    duration_s=420.0,
    final_error_m=4.25,
    final_sigma_m=3.1,
    final_range_m=340.0,
    pcrb_final_m=2.9,
    nees_final=1.5,
    nees_mean=2.1,
    converged_s=61.5,
    slot_error_rms_m=0.8,
    max_slot_error_m=2.5,
    max_reference_range_m=241.0,
    min_separation_m=11.0,
    min_standoff_m=333.0,
    d_max_m=250.0,
    stand_off_m=300.0,
    rd_measurements=9000,
    estimates=3000,
    health={"initialising": 2.0, "tracking": 300.0},
    mavlink_messages_in=30000,
    mavlink_rejected=0,
    setpoints_out=16000,
    setpoints_dropped=0,
    feed_rejected=0,
    rd_dropped=0,
    rd_aside=7,
    rd_repeated=0,
    wall_s=20.0,
    mission="made_up",
    seed=1,
    versions={"swarmctl": "0.1.0", "python": "3.11.2"},
    commit="abc",
)
"""What a flight with truth could have come to."""
WITHOUT_TRUTH = msgspec.structs.replace(
    SUMMARY,
    final_error_m=None,
    final_range_m=None,
    pcrb_final_m=None,
    nees_final=None,
    nees_mean=None,
    min_standoff_m=None,
    seed=None,
)
"""The same with real vehicles."""

SEPARATION_M = 8.0
"""Least distance of two UAVs in any flight of a test, m."""


def known(figure: float | None) -> float:
    """A figure that has to be there."""
    assert figure is not None
    return figure


def assert_within_limits(summary: FlightSummary, *, stand_off: bool = True) -> None:
    """No UAV came too near to another or the emitter, or went too far from the reference."""
    assert known(summary.max_reference_range_m) <= summary.d_max_m
    assert known(summary.min_separation_m) >= SEPARATION_M
    if stand_off:
        assert known(summary.min_standoff_m) >= summary.stand_off_m
