"""Judging the vehicles' clocks on a computer that may be busy."""

import pytest

from swarmctl.events import VehicleClock
from swarmctl.mission.fleet import VehicleState
from swarmctl.mission.preflight_checks import clock_fault

LATE_S = 2.0
"""The first SYSTEM_TIME was read so much later than it came."""


def watched(seconds: float, rate: float = 1.0, boot_rate: float | None = None) -> VehicleState:
    vehicle = VehicleState(1, 50.0)
    vehicle.clock_first = VehicleClock(received_s=LATE_S, sysid=1, utc_s=1e9, boot_s=0.0)
    vehicle.clock_last = VehicleClock(
        received_s=seconds,
        sysid=1,
        utc_s=1e9 + rate * seconds,
        boot_s=(rate if boot_rate is None else boot_rate) * seconds,
    )
    return vehicle


def test_a_report_that_was_read_late_makes_no_clock_run_wrong() -> None:
    for seconds in (4.0, 8.0, 12.0, 30.0):
        assert clock_fault(watched(seconds), LATE_S) is None
    assert clock_fault(watched(4.0), 0.0) is not None


@pytest.mark.parametrize("rate", [0.05, 0.5, 2.0, 20.0])
def test_a_clock_that_does_run_wrong_is_told_all_the_same(rate: float) -> None:
    fault = clock_fault(watched(40.0, rate), LATE_S)
    assert fault is not None
    assert "with the same --speedup as the simulator" in fault


@pytest.mark.parametrize(("utc_rate", "boot_rate"), [(1.0, 5.0), (0.2, 1.0)])
def test_a_simulator_whose_utc_does_not_follow_its_speed_is_found_out(
    utc_rate: float, boot_rate: float
) -> None:
    assert clock_fault(watched(40.0, utc_rate, boot_rate), LATE_S) is not None
