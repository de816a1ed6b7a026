"""Boot time to UTC."""

from __future__ import annotations

import pytest

from swarmctl.link.clock import BootClock

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
