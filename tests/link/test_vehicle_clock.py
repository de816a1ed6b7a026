"""Boot time to UTC."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmctl.frames import sped_up_utc_s
from swarmctl.link.vehicle_clock import BootClock, RoundTrips

UTC_S = 1_790_000_000.0


def test_nothing_is_known_before_the_first_system_time() -> None:
    assert BootClock().to_utc(12.0) is None


def test_maps_times_before_and_after_the_pair() -> None:
    clock = BootClock()
    clock.update(UTC_S, 100.0)
    assert clock.to_utc(99.8) == pytest.approx(UTC_S - 0.2, abs=1e-6)
    assert clock.to_utc(100.3) == pytest.approx(UTC_S + 0.3, abs=1e-6)


def test_a_step_of_the_vehicles_utc_is_followed() -> None:
    clock = BootClock()
    clock.update(UTC_S, 100.0)
    clock.update(UTC_S + 1.0 + 18.0, 101.0)
    assert clock.to_utc(101.0) == UTC_S + 19.0


def test_an_overtaken_pair_does_not_bring_the_old_offset_back() -> None:
    clock = BootClock()
    clock.update(UTC_S + 18.0, 101.0)
    clock.update(UTC_S - 1.0, 100.0)
    assert clock.to_utc(101.0) == UTC_S + 18.0


@pytest.mark.parametrize("late_s", [0.1, 1.9])
def test_a_late_position_is_still_mapped(late_s: float) -> None:
    clock = BootClock()
    clock.update(UTC_S, 100.0)
    assert clock.to_utc(100.0 - late_s) == pytest.approx(UTC_S - late_s, abs=1e-6)


@pytest.mark.parametrize("boot_s", [3.0, 97.9])
def test_a_reboot_seen_in_a_position_forgets_the_offset_for_good(boot_s: float) -> None:
    clock = BootClock()
    clock.update(UTC_S, 100.0)
    assert clock.to_utc(boot_s) is None
    assert clock.to_utc(99.9) is None
    clock.update(UTC_S + 160.0, 99.0)
    assert clock.to_utc(99.5) == UTC_S + 160.5


def test_a_reboot_seen_in_a_system_time_takes_the_new_offset() -> None:
    clock = BootClock()
    clock.update(UTC_S, 100.0)
    clock.update(UTC_S + 30.0, 15.0)
    assert clock.to_utc(16.0) == UTC_S + 31.0


# --- Simulators with a speed-up ----------------------------------------------------------


@dataclass(frozen=True)
class Lockstep:
    """PX4's SITL: UTC is the computer's; the time since boot goes as fast as the simulator can."""

    started_s: float
    rate: float

    def boot_s(self, wall_s: float) -> float:
        return math.floor((wall_s - self.started_s) * self.rate * 1e3) / 1e3


def told_until(wall_s: float, vehicle: Lockstep, speedup: float) -> BootClock:
    """The clock that has heard the vehicle once a second of its own."""
    clock = BootClock(speedup)
    for k in range(math.floor((wall_s - vehicle.started_s) * vehicle.rate)):
        at_s = vehicle.started_s + k / vehicle.rate
        clock.update(UTC_S + at_s, vehicle.boot_s(at_s))
    return clock


def test_at_a_speed_up_vehicles_that_tell_the_computers_utc_share_one_time() -> None:
    """Started one after the other, none exactly as fast as asked for, one long after the rest."""
    speedup = 5.0
    swarm = [Lockstep(0.0, 5.0), Lockstep(1.3, 4.8), Lockstep(2.9, 4.6), Lockstep(40.0, 5.1)]
    for wall_s in (60.0, 60.37, 61.1):
        clocks = [told_until(wall_s, vehicle, speedup) for vehicle in swarm]
        epochs = [
            clock.to_utc(vehicle.boot_s(wall_s))
            for clock, vehicle in zip(clocks, swarm, strict=True)
        ]
        # Times since boot are cut to the millisecond, the slope's two ends and the time itself.
        assert epochs == pytest.approx([sped_up_utc_s(UTC_S + wall_s, speedup)] * 4, abs=3e-3)
        assert all(clock.error_s is not None and clock.error_s < 3e-3 for clock in clocks)


def test_at_a_speed_up_utc_that_follows_it_is_taken_as_it_is() -> None:
    clock = BootClock(5.0)
    for k in range(4):
        clock.update(UTC_S + k, 100.0 + k)
    assert clock.to_utc(103.5) == pytest.approx(UTC_S + 3.5, abs=1e-6)


def test_at_a_speed_up_nothing_is_known_before_the_rate_shows_also_after_a_reboot() -> None:
    clock, vehicle = BootClock(5.0), Lockstep(0.0, 5.0)
    for k in range(2):
        clock.update(UTC_S + k / 5.0, vehicle.boot_s(k / 5.0))
        assert clock.to_utc(float(k)) is None
        assert clock.error_s is None
    clock.update(UTC_S + 0.4, 2.0)
    assert clock.to_utc(2.0) == pytest.approx(sped_up_utc_s(UTC_S + 0.4, 5.0), abs=1e-6)
    for k in range(20, 30):
        clock.update(UTC_S + k / 5.0, float(k))
    # It boots again, now as a vehicle whose UTC follows.
    clock.update(UTC_S + 50.0, 1.0)
    assert clock.to_utc(1.0) is None
    clock.update(UTC_S + 52.0, 3.0)
    assert clock.to_utc(3.0) == UTC_S + 52.0


# --- Uncertainty -----------------------------------------------------------------------


def test_pairs_that_agree_are_as_good_as_the_millisecond_they_are_cut_to() -> None:
    clock = BootClock()
    assert clock.error_s is None
    for k in range(20):
        clock.update(UTC_S + k + 0.0004 * (k % 2), 100.0 + k)
    assert clock.error_s == 1e-3


def test_a_step_of_utc_shows_in_the_uncertainty_until_it_is_ten_pairs_ago() -> None:
    clock = BootClock()
    for k in range(5):
        clock.update(UTC_S + k, 100.0 + k)
    for k in range(5, 15):
        assert k == 5 or clock.error_s == pytest.approx(18.0)
        clock.update(UTC_S + 18.0 + k, 100.0 + k)
    assert clock.error_s == pytest.approx(1e-3, abs=1e-6)


def test_a_reboot_begins_the_uncertainty_anew() -> None:
    clock = BootClock()
    clock.update(UTC_S, 100.0)
    clock.update(UTC_S + 30.0, 15.0)
    assert clock.error_s == 1e-3
    assert clock.to_utc(1.0) is None
    assert clock.error_s is None


# --- Round trips -----------------------------------------------------------------------


def test_the_shortest_of_the_last_ten_round_trips_counts() -> None:
    trips = RoundTrips()
    assert (trips.latest_s, trips.boot_offset_s) == (None, None)
    # 40 s ahead; 10 ms there; back 10 ms once, else 50 ms.
    for k in range(11):
        back_s = 0.01 if k == 0 else 0.05
        trips.add(100.0 + k, 140.01 + k, 100.01 + k + back_s)
        expected = (40.0, 0.01) if k < 10 else (39.98, 0.03)
        assert trips.boot_offset_s == pytest.approx(expected)
    assert trips.latest_s == pytest.approx(0.06)


@given(st.floats(-1e4, 1e4), st.lists(st.tuples(st.floats(0, 2), st.floats(0, 2)), min_size=1))
def test_the_true_offset_is_always_within_the_bound(
    offset_s: float, ways: list[tuple[float, float]]
) -> None:
    trips = RoundTrips()
    for k, (there_s, back_s) in enumerate(ways):
        trips.add(float(k), k + there_s + offset_s, k + there_s + back_s)
    assert trips.boot_offset_s is not None
    found_s, error_s = trips.boot_offset_s
    assert abs(found_s - offset_s) <= error_s + 1e-9


def test_a_reboot_is_not_averaged_with_what_was_before() -> None:
    trips = RoundTrips()
    trips.add(100.0, 140.0, 100.01)
    trips.add(102.0, 1.0, 102.3)
    assert trips.boot_offset_s == pytest.approx((-101.15, 0.15))
