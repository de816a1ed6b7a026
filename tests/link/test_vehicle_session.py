"""What a vehicle says becomes observations."""

from __future__ import annotations

import math
from typing import Any

import pytest

from swarmctl.events import (
    GpsFix,
    HomePosition,
    LandedState,
    StatusText,
    VehicleAttitude,
    VehicleClock,
    VehiclePosition,
    VehicleStatus,
    VehicleVersion,
)
from tests.link.bench import AT_1, AT_2, Bench, Vehicle


def test_every_observation_of_a_vehicle(two: tuple[Bench, Vehicle, Vehicle]) -> None:
    bench, one, _ = two
    messages: dict[str, dict[str, Any]] = {
        "SYSTEM_TIME": {"time_unix_usec": 1_790_000_000_000_000, "time_boot_ms": 60_000},
        "GLOBAL_POSITION_INT": {"lat": 1, "lon": 1},
        "ATTITUDE": {},
        "SYS_STATUS": {},
        "GPS_RAW_INT": {},
        "HOME_POSITION": {"latitude": 1},
        "AUTOPILOT_VERSION": {},
        "EXTENDED_SYS_STATE": {},
        "STATUSTEXT": {"text": b"hello"},
    }
    for name, fields in messages.items():
        bench.receive(one.pack(name, **fields))
    assert [type(event) for event in bench.heard] == [
        VehicleClock,
        VehiclePosition,
        VehicleAttitude,
        VehicleStatus,
        GpsFix,
        HomePosition,
        VehicleVersion,
        LandedState,
        StatusText,
    ]
    assert all(getattr(event, "sysid", None) == 1 for event in bench.heard)
    assert {event.received_s for event in bench.heard} == {50.0}


def test_positions_get_their_utc_from_their_own_vehicles_clock(
    two: tuple[Bench, Vehicle, Vehicle],
) -> None:
    bench, one, two_ = two
    bench.receive(one.pack("GLOBAL_POSITION_INT", lat=1, lon=1, time_boot_ms=59_000), AT_1)
    bench.receive(
        one.pack("SYSTEM_TIME", time_unix_usec=1_790_000_000_500_000, time_boot_ms=60_000), AT_1
    )
    bench.receive(
        two_.pack("SYSTEM_TIME", time_unix_usec=1_790_000_000_500_000, time_boot_ms=9_000), AT_2
    )
    bench.receive(one.pack("GLOBAL_POSITION_INT", lat=1, lon=1, time_boot_ms=60_200), AT_1)
    bench.receive(two_.pack("GLOBAL_POSITION_INT", lat=1, lon=1, time_boot_ms=9_300), AT_2)
    bench.receive(one.pack("GLOBAL_POSITION_INT", lat=1, lon=1, time_boot_ms=2_000), AT_1)
    before, after, other, rebooted = (
        position.epoch_utc_s for position in bench.of(VehiclePosition)
    )
    assert before is None
    assert after == pytest.approx(1_790_000_000.7, abs=1e-6)
    assert other == pytest.approx(1_790_000_000.8, abs=1e-6)
    assert rebooted is None


def test_a_position_carries_all_its_fields(two: tuple[Bench, Vehicle, Vehicle]) -> None:
    bench, _, two_ = two
    bench.receive(
        two_.pack(
            "GLOBAL_POSITION_INT",
            time_boot_ms=1500,
            lat=450_000_000,
            lon=-900_000_000,
            alt=120_500,
            vx=100,
            vy=-200,
            vz=300,
        ),
        AT_2,
    )
    (position,) = bench.of(VehiclePosition)
    assert (position.received_s, position.sysid, position.boot_s) == (50.0, 2, 1.5)
    assert position.lat_rad == pytest.approx(math.pi / 4, abs=1e-15)
    assert position.lon_rad == pytest.approx(-math.pi / 2, abs=1e-15)
    assert position.alt_amsl_m == 120.5
    assert position.velocity_enu == (-2.0, 1.0, -3.0)
