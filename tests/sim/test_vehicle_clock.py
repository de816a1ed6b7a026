"""A vehicle's clocks: drift, offset and jitter."""

from __future__ import annotations

import math
import statistics

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.config import ClockConfig
from swarmctl.frames import sped_up_utc_s
from tests.sim.flying import Station, of_type, simulation, vehicle


def system_times(clock: ClockConfig) -> list[tuple[float, float, float]]:
    """True UTC, reported UTC and reported time since power-up over 400 s, s."""
    station = Station(simulation(vehicle(clock=clock)))
    station.advance(2.0)
    station.stream(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, 1.0)
    times = []
    for _ in range(400):
        (message,) = of_type("SYSTEM_TIME", station.advance(1.0))
        times.append((station.world.utc_s, message.time_unix_usec * 1e-6, message.time_boot_ms))
    return [(true, utc, boot * 1e-3) for true, utc, boot in times]


def test_the_boot_clock_drifts_and_utc_is_off() -> None:
    times = system_times(ClockConfig(drift=1e-3, utc_offset_s=0.25))
    assert times[-1][2] - times[0][2] == pytest.approx(399.0 * 1.001, abs=2e-3)
    assert [utc - true for true, utc, _ in times] == pytest.approx([0.25] * 400, abs=1e-5)


def test_the_reports_of_utc_jitter_independently() -> None:
    sigma = 0.01
    errors = [utc - true for true, utc, _ in system_times(ClockConfig(utc_jitter_s=sigma))]
    # Of 400 independent errors: mean and deviation within 4.5 of their own standard deviations.
    assert statistics.fmean(errors) == pytest.approx(0.0, abs=4.5 * sigma / math.sqrt(400))
    assert statistics.stdev(errors) == pytest.approx(sigma, rel=4.5 / math.sqrt(800))


def test_at_a_speed_up_the_computers_utc_is_told() -> None:
    times = system_times(ClockConfig(speedup=5.0))
    sped_up = [sped_up_utc_s(utc, 5.0) for _, utc, _ in times]
    # UTC is told to the microsecond.
    assert sped_up == pytest.approx([true for true, _, _ in times], abs=5e-6)
    assert times[-1][1] - times[0][1] == pytest.approx(399.0 / 5.0, abs=1e-5)
    assert times[-1][2] - times[0][2] == pytest.approx(399.0, abs=1e-2)
