"""When a fault is there."""

from __future__ import annotations

from sim.faults import Faults


def test_a_vehicle_without_faults_is_on_air_and_has_gps() -> None:
    assert Faults().is_on_air(1e6)
    assert Faults().gps_works(1e6)


def test_a_silent_vehicle_is_never_on_air() -> None:
    assert not Faults(silent=True).is_on_air(0.0)


def test_a_fault_with_a_time_begins_then() -> None:
    faults = Faults(dies_at_s=10.0, gps_lost_at_s=20.0)
    assert [faults.is_on_air(t) for t in (9.99, 10.0)] == [True, False]
    assert [faults.gps_works(t) for t in (19.99, 20.0)] == [True, False]
