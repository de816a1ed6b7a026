"""Receivers of vehicles that are only heard, against what those vehicles said."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import msgspec
import pytest

from sim.config import EmitterConfig, ReceiverConfig, SimConfig
from sim.sitl_receivers import REACH_S, SitlReceivers
from swarmctl.feed.schema import RangeDifferenceMessage, TruthMessage
from swarmctl.frames import LocalFrame, sped_up_utc_s
from tests.link.wire import Sender
from tests.sim.flying import (
    ALT,
    LAT,
    LON,
    arrival_times,
    range_differences,
    receivers_truths,
    simulation,
    vehicle,
)

FRAME = LocalFrame(LAT, LON, ALT)
UTC = 1_790_000_000.0
DRIFT = (1.0, -2.0, 0.0)
EXACT = ReceiverConfig(reference=1, rate_hz=10.0, sigma_m=1e-6)
SPEEDS = {1: (4.0, 0.0, 0.0), 2: (3.0, 5.0, -1.0), 3: (0.0, -6.0, 0.0)}
STARTS = {1: (0.0, 0.0, 30.0), 2: (60.0, 10.0, 45.0), 3: (-20.0, 80.0, 60.0)}


def config(receivers: ReceiverConfig = EXACT) -> SimConfig:
    emitter = EmitterConfig(LAT + 1e-4, LON + 1e-4, ALT, DRIFT)
    return simulation(*(vehicle(i) for i in SPEEDS), receivers=receivers, emitter=emitter)


def place(sysid: int, since_s: float) -> tuple[float, float, float]:
    x, y, z = (p + since_s * v for p, v in zip(STARTS[sysid], SPEEDS[sysid], strict=True))
    return x, y, z


class Autopilot:
    """Says where it is, by a clock of its own."""

    def __init__(
        self,
        sysid: int,
        boot_s: float = 0.0,
        utc_error_s: float = 0.0,
        speedup: float = 1.0,
        pace: float = 1.0,
    ) -> None:
        self._sysid, self._boot_s, self._utc_error_s = sysid, boot_s, utc_error_s
        self._speedup, self._pace = speedup, pace
        self._sender = Sender(sysid)

    def time(self, since_s: float) -> bytes:
        return self._sender.pack(
            "SYSTEM_TIME",
            time_unix_usec=round(
                sped_up_utc_s(UTC + since_s + self._utc_error_s, 1.0 / self._speedup) * 1e6
            ),
            time_boot_ms=round((since_s * self._pace + self._boot_s) * 1e3),
        )

    def position(self, since_s: float, height_m: float = 30.0) -> bytes:
        lat, lon, alt = FRAME.to_geodetic(*place(self._sysid, since_s))
        vx, vy, vz = SPEEDS[self._sysid]
        return self._sender.pack(
            "GLOBAL_POSITION_INT",
            time_boot_ms=round((since_s * self._pace + self._boot_s) * 1e3),
            lat=round(math.degrees(lat) * 1e7),
            lon=round(math.degrees(lon) * 1e7),
            alt=round(alt * 1e3),
            relative_alt=round(height_m * 1e3),
            vx=round(vy * 100),
            vy=round(vx * 100),
            vz=round(-vz * 100),
        )


SWARM = [Autopilot(sysid, boot_s=100.0 * sysid) for sysid in SPEEDS]


def heard(
    listening: SitlReceivers, until_s: float, swarm: list[Autopilot] = SWARM, height_m: float = 30.0
) -> list[tuple[str, bytes]]:
    """What is published while every vehicle reports at 4 Hz, each at its own instants."""
    said = []
    for i, pilot in enumerate(swarm):
        said += [(float(k), pilot.time(float(k))) for k in range(int(until_s))]
        for k in range(int(until_s * 4)):
            at_s = k / 4 + 0.03 * i
            said.append((at_s, pilot.position(at_s, height_m)))
    for _, datagram in sorted(said):
        listening.receive(datagram)
    return listening.publications()


def differences(publications: list[tuple[str, bytes]]) -> list[RangeDifferenceMessage]:
    return [message for epoch in range_differences(publications) for message in epoch]


def truths(publications: list[tuple[str, bytes]]) -> list[TruthMessage]:
    return [
        msgspec.json.decode(payload, type=TruthMessage)
        for topic, payload in publications
        if topic.endswith("truth")
    ]


def emitter_at(since_s: float, published: list[TruthMessage]) -> tuple[float, float, float]:
    first = published[0]
    start = FRAME.to_enu(math.radians(first.lat_deg), math.radians(first.lon_deg), first.alt_amsl_m)
    since_first_s = UTC + since_s - first.epoch_utc_s
    x, y, z = (p + since_first_s * v for p, v in zip(start, DRIFT, strict=True))
    return x, y, z


@pytest.mark.parametrize("speedup", [1.0, 5.0])
def test_measured_is_where_the_vehicles_say_they_were_at_the_epoch(speedup: float) -> None:
    """At a speed-up that their UTC does not follow, also if none is simulated exactly so fast."""
    swarm = [
        Autopilot(sysid, 100.0 * sysid, speedup=speedup, pace=pace if speedup > 1.0 else 1.0)
        for sysid, pace in zip(SPEEDS, (1.0, 0.95, 1.02), strict=True)
    ]
    listening = SitlReceivers(config(), speedup)
    published = heard(listening, 20.0, swarm)
    assert listening.complaints() == []
    found, truth = differences(published), truths(published)
    epochs = sorted({m.epoch_utc_s - UTC for m in found})
    # 20 s at 10 Hz, but for those that begin and end it; a speed-up shows after 2 s.
    assert len(epochs) >= (195 if speedup == 1.0 else 174)
    assert [b - a for a, b in itertools.pairwise(epochs)] == pytest.approx(
        [0.1] * (len(epochs) - 1), abs=1e-6
    )
    for m in found:
        since_s = m.epoch_utc_s - UTC
        emitter = emitter_at(since_s, truth)
        expected = math.dist(emitter, place(m.receiver, since_s)) - math.dist(
            emitter, place(1, since_s)
        )
        # Reports resolve 11 mm (1e-7 degrees) and 1 cm/s, SYSTEM_TIME 1 ms of 8 m/s.
        assert m.rd_m == pytest.approx(expected, abs=0.05)
    # The emitter drifts by the vehicles' clocks.
    moved = [
        FRAME.to_enu(math.radians(t.lat_deg), math.radians(t.lon_deg), t.alt_amsl_m)
        for t in (truth[0], truth[-1])
    ]
    for axis in (0, 1):
        span_s = truth[-1].epoch_utc_s - truth[0].epoch_utc_s
        assert moved[1][axis] - moved[0][axis] == pytest.approx(DRIFT[axis] * span_s, abs=1e-3)
    assert len(truth) == pytest.approx(40 if speedup == 1.0 else 36, abs=1)


def test_arrival_times_are_published_where_the_mission_wants_them() -> None:
    published = heard(SitlReceivers(config(replace(EXACT, publish="arrival_times"))), 5.0)
    assert not differences(published)
    assert {m.receiver for m in arrival_times(published)} == {1, 2, 3}


def test_a_receiver_on_the_ground_hears_nothing() -> None:
    assert not differences(heard(SitlReceivers(config()), 5.0, height_m=4.9))
    assert differences(heard(SitlReceivers(config()), 5.0, height_m=5.1))


def test_a_vehicle_that_falls_silent_is_soon_without_a_receiver_and_delays_nobody_more() -> None:
    listening = SitlReceivers(config())
    heard(listening, 5.0)
    published = heard_after(listening, 5.0, 10.0, SWARM[:2])
    last = {m.receiver: m.epoch_utc_s - UTC for m in differences(published)}
    # Its last report was at 4.81 s, and then it may be where it flew on to for REACH_S.
    assert last[3] == pytest.approx(4.81 + REACH_S, abs=0.1)
    assert last[2] == pytest.approx(9.75, abs=0.1)


def heard_after(
    listening: SitlReceivers, since_s: float, until_s: float, swarm: list[Autopilot]
) -> list[tuple[str, bytes]]:
    """What is published while some vehicles go on reporting."""
    for k in range(int(since_s * 4), int(until_s * 4)):
        for i, pilot in enumerate(swarm):
            listening.receive(pilot.position(k / 4 + 0.03 * i))
    return listening.publications()


def test_clocks_that_differ_measure_each_vehicle_by_its_own() -> None:
    """As the controller, which knows no other clock either, places the vehicles."""
    late = Autopilot(2, utc_error_s=-0.8)
    published = heard(SitlReceivers(config()), 10.0, [SWARM[0], late, SWARM[2]])
    truth = truths(published)
    of_late = [m for m in differences(published) if m.receiver == 2]
    assert len(of_late) > 80
    for m in of_late:
        since_s = m.epoch_utc_s - UTC
        emitter = emitter_at(since_s, truth)
        expected = math.dist(emitter, place(2, since_s + 0.8)) - math.dist(
            emitter, place(1, since_s)
        )
        assert m.rd_m == pytest.approx(expected, abs=0.05)


def test_a_clock_too_far_behind_is_named_once_and_its_receiver_is_left_out() -> None:
    listening = SitlReceivers(config())
    late = Autopilot(2, utc_error_s=-9.0)
    published = heard(listening, 30.0, [SWARM[0], late, SWARM[2]])
    assert {m.receiver for m in differences(published)} == {3}
    (complaint,) = listening.complaints()
    assert complaint.startswith("The clock of UAV 2 (SYSTEM_TIME) is 9.0 s behind")
    assert listening.complaints() == []


def test_vehicles_that_outrun_the_utc_they_tell_are_named_once_where_the_speed_up_is_not() -> None:
    listening = SitlReceivers(config())
    heard(listening, 20.0, [*SWARM[:2], Autopilot(3, speedup=5.0)])
    complaints = [c for c in listening.complaints() if "--speedup" in c]
    assert len(complaints) == 1
    assert complaints[0].startswith("UAV 3 is simulated 5 times as fast as the UTC that it tells")


def test_a_step_of_utc_is_no_speed_up() -> None:
    listening = SitlReceivers(config())
    heard(listening, 20.0)
    for k in range(20, 30):
        listening.receive(Autopilot(1, boot_s=100.0, utc_error_s=18.0).time(float(k)))
    assert not [c for c in listening.complaints() if "--speedup" in c]


def test_reports_in_any_order_measure_the_same() -> None:
    def measured(order: int) -> dict[tuple[int, float], float]:
        listening = SitlReceivers(config())
        for pilot in SWARM:
            listening.receive(pilot.time(0.0))
        for k in range(40):
            for pilot in SWARM[::order]:
                listening.receive(pilot.position(k / 4))
        found = differences(listening.publications())
        return {(m.receiver, m.epoch_utc_s): m.rd_m for m in found}

    assert measured(1) == measured(-1)


def test_vehicles_that_boot_anew_are_heard_anew() -> None:
    listening = SitlReceivers(config())
    heard(listening, 10.0)
    # UTC goes on, and boot time begins again.
    again = [Autopilot(sysid, boot_s=-20.0) for sysid in SPEEDS]
    for pilot in again:
        listening.receive(pilot.time(20.0))
    published = heard_after(listening, 20.0, 25.0, again)
    epochs = [m.epoch_utc_s - UTC for m in differences(published)]
    assert min(epochs) == pytest.approx(20.0, abs=0.3)
    assert max(epochs) == pytest.approx(24.75, abs=0.1)


@pytest.mark.parametrize("error_s", [3600.0, -3600.0])
def test_clocks_that_are_set_anew_are_followed_at_once(error_s: float) -> None:
    listening = SitlReceivers(config())
    heard(listening, 5.0)
    again = [Autopilot(sysid, utc_error_s=error_s) for sysid in SPEEDS]
    for pilot in again:
        listening.receive(pilot.time(5.0))
    published = heard_after(listening, 5.0, 10.0, again)
    epochs = {m.epoch_utc_s - UTC - error_s for m in differences(published)}
    assert len(epochs) == pytest.approx(48, abs=4)
    # Nothing is made up of the time between.
    for message in truths(published):
        assert 4.0 < message.epoch_utc_s - UTC - error_s < 10.0


def test_a_report_that_was_overtaken_changes_nothing() -> None:
    listening = SitlReceivers(config())
    heard(listening, 5.0)
    on_ground = [pilot.position(3.0, height_m=0.0) for pilot in SWARM]
    for k in range(20, 40):
        for pilot, late in zip(SWARM, on_ground, strict=True):
            listening.receive(pilot.position(k / 4))
            if k == 20:
                listening.receive(late)
    epochs = {m.epoch_utc_s for m in differences(listening.publications())}
    assert len(epochs) == pytest.approx(50, abs=2)


@pytest.mark.parametrize(
    "datagram",
    [
        b"",
        b"\xfd" * 300,
        SWARM[0].position(5.0)[:-3],
        Sender(9).pack("GLOBAL_POSITION_INT", lat=1, lon=1, time_boot_ms=1),
        Sender(1, compid=191).pack("GLOBAL_POSITION_INT", lat=1, lon=1, time_boot_ms=1),
        Sender(1).pack("GLOBAL_POSITION_INT", time_boot_ms=105_000),
        Sender(1).pack("SYSTEM_TIME", time_boot_ms=105_000),
        Sender(1).heartbeat(),
    ],
    ids=[
        "nothing",
        "noise",
        "truncated",
        "not-in-the-swarm",
        "another-component",
        "no-position-yet",
        "no-utc-yet",
        "another-message",
    ],
)
def test_what_is_no_report_changes_nothing(datagram: bytes) -> None:
    disturbed, undisturbed = SitlReceivers(config()), SitlReceivers(config())
    for listening in (disturbed, undisturbed):
        heard(listening, 5.0)
    disturbed.receive(datagram)
    after = heard_after(disturbed, 5.0, 8.0, SWARM)
    assert after == heard_after(undisturbed, 5.0, 8.0, SWARM)
    assert differences(after)


def test_the_receivers_clocks_start_with_the_first_report_and_are_told_once_a_second() -> None:
    poor = replace(EXACT, clock_bias_sigma_s=100e-9, clock_drift_sigma=10e-9)
    listening, exact = SitlReceivers(config(poor)), SitlReceivers(config())
    published = heard(listening, 20.0)
    told = receivers_truths(published)
    assert [truth.receiver for truth in told[0]] == [1, 2, 3]
    assert len(told) == pytest.approx(20, abs=1)
    # Of vehicles whose reports are the truth nobody knows more.
    assert {truth.navigation_enu for each in told for truth in each} == {(0.0, 0.0, 0.0)}
    # 1.8e9 s of drift would be 5000 km.
    assert all(abs(truth.clock_m) < 1000.0 for truth in told[0])
    clocks = {(t.receiver, t.epoch_utc_s): t.clock_m for each in told for t in each}
    right = {(m.receiver, m.epoch_utc_s): m.rd_m for m in differences(heard(exact, 20.0))}
    compared = 0
    for m in differences(published):
        if (m.receiver, m.epoch_utc_s) in clocks:
            off_m = clocks[m.receiver, m.epoch_utc_s] - clocks[1, m.epoch_utc_s]
            assert m.rd_m - right[m.receiver, m.epoch_utc_s] == pytest.approx(off_m, abs=1e-4)
            compared += 1
    assert compared == pytest.approx(40, abs=4)
    # Clocks that are set anew do not make up the drift of the time between.
    for pilot in (again := [Autopilot(sysid, utc_error_s=3e7) for sysid in SPEEDS]):
        listening.receive(pilot.time(20.0))
    later = receivers_truths(heard_after(listening, 20.0, 25.0, again))
    for truth, first in zip(later[0], told[0], strict=True):
        assert truth.clock_m == pytest.approx(first.clock_m, abs=1e-6)


def test_a_beacon_that_seldom_bursts_is_told_of_as_often() -> None:
    seldom = replace(EXACT, rate_hz=0.1)
    published = heard(SitlReceivers(config(seldom)), 35.0)
    bursts = sorted({m.epoch_utc_s for m in differences(published)})
    assert bursts == [UTC + 10.0, UTC + 20.0, UTC + 30.0]
    for m in differences(published):
        emitter = emitter_at(m.epoch_utc_s - UTC, truths(published))
        expected = math.dist(emitter, place(m.receiver, m.epoch_utc_s - UTC)) - math.dist(
            emitter, place(1, m.epoch_utc_s - UTC)
        )
        assert m.rd_m == pytest.approx(expected, abs=0.05)
    assert len(truths(published)) == pytest.approx(70, abs=1)
