"""The simulated battery."""

from __future__ import annotations

import pytest

from sim.autopilots.battery import ENDURANCE_S, Battery


def test_a_full_battery_lasts_half_an_hour_armed_and_fifty_times_that_disarmed() -> None:
    armed, disarmed = Battery(1.0), Battery(1.0)
    armed.draw(0.25 * ENDURANCE_S, armed=True)
    disarmed.draw(0.25 * ENDURANCE_S, armed=False)
    assert armed.charge == pytest.approx(0.75)
    assert disarmed.charge == pytest.approx(0.995)
    armed.draw(2.0 * ENDURANCE_S, armed=True)
    assert armed.charge == 0.0


@pytest.mark.parametrize(
    ("charge", "voltage_v", "left_mah"), [(1.0, 12.6, 3300.0), (0.5, 11.55, 1650.0), (0, 10.5, 0)]
)
def test_voltage_and_capacity_follow_the_charge(
    charge: float, voltage_v: float, left_mah: float
) -> None:
    battery = Battery(charge)
    assert battery.voltage_v == pytest.approx(voltage_v)
    assert battery.left_mah == pytest.approx(left_mah)
    assert battery.left_mah + battery.used_mah == pytest.approx(3300.0)
