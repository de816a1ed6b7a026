"""The live feed of arrival times: the same track as from range differences."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.estimate import Estimate
from swarmctl.units import SPEED_OF_LIGHT_MPS
from tests.estimation.feed.live_feed import (
    DRIFT,
    EMITTER,
    EPOCH,
    Live,
    assert_same_track,
    live_feed,
    report,
    where,
)

C = SPEED_OF_LIGHT_MPS
SIGMA_M = {1: 2.0, 2: 1.0, 3: 4.0, 4: 2.5}
ALL = (1, 2, 3, 4)


def path_m(receiver: int, t: float) -> float:
    """Measured length of the path from the emitter, the same whenever asked for, m."""
    error = SIGMA_M[receiver] * np.random.default_rng([round(1000 * t), receiver]).normal()
    return math.dist(EMITTER + DRIFT * t, where(receiver, t)) + float(error)


def hear(to: Live, t: float, receivers: tuple[int, ...] = ALL) -> None:
    """Arrival times of one burst, which UAV 1 hears exactly t seconds after EPOCH."""
    for receiver in receivers:
        to.add_arrival(receiver, round(10 * t), *arrival(receiver, t), SIGMA_M[receiver] / C)


def arrival(receiver: int, t: float) -> tuple[int, float]:
    """Whole seconds and fraction."""
    late_s = (path_m(receiver, t) - path_m(1, t)) / C
    seconds = math.floor(t % 1.0 + late_s)
    return int(EPOCH + t // 1.0) + seconds, t % 1.0 + late_s - seconds


def hear_differences(to: Live, t: float, reference: int) -> None:
    """The same as range differences."""
    for receiver in set(ALL) - {reference}:
        variance = SIGMA_M[receiver] ** 2 + SIGMA_M[reference] ** 2
        to.add_range_differences(
            sum(arrival(reference, t)),
            reference,
            [receiver],
            [path_m(receiver, t) - path_m(reference, t)],
            [math.sqrt(variance)],
            SIGMA_M[reference] ** 2 / variance,
        )


@pytest.mark.parametrize(("leader", "reference"), [(1, 1), (2, 2), (4, 4), (None, 1), (9, 1)])
def test_the_track_is_that_of_range_differences_against_the_leader(
    leader: int | None, reference: int
) -> None:
    live, expected = live_feed(), live_feed()
    found: list[Estimate] = []
    wanted: list[Estimate] = []
    for k in range(31):
        report(live, 0.1 * k)
        report(expected, 0.1 * k)
        hear(live, 0.1 * k)
        hear_differences(expected, 0.1 * k, reference)
        found += live.process(leader)
        wanted += expected.process()
    for to, estimates in ((live, found), (expected, wanted)):
        report(to, 3.2)
        estimates.extend(to.process(leader))
    for one, other in zip(found, wanted, strict=True):
        assert one.measured is not None
        assert other.measured is not None
        assert one.measured.reference == other.measured.reference == reference
        assert set(one.measured.receivers) == set(ALL) - {reference}
        by_receiver = dict(zip(other.measured.receivers, other.measured.sigma_m, strict=True))
        for receiver, sigma in zip(one.measured.receivers, one.measured.sigma_m, strict=True):
            assert sigma == pytest.approx(by_receiver[receiver])
    assert live.counts.used == expected.counts.used == 93
    assert_same_track(live, expected)


def test_a_burst_waits_for_the_positions_and_for_the_last_arrival() -> None:
    live = live_feed()
    report(live, 0.0)
    hear(live, 0.05)
    assert live.process(1) == []
    report(live, 0.1)
    assert [update.rd_count for update in live.process(1)] == [3]
    hear(live, 0.1, (1, 2, 3))
    assert live.process(1) == []
    hear(live, 0.1, (4,))
    (update,) = live.process(1)
    assert (update.rd_count, update.epoch_s) == (3, EPOCH + 0.1)


def test_without_the_leader_the_others_are_differenced() -> None:
    live = live_feed()
    for k in range(40):
        report(live, 0.1 * k, (2, 3, 4))
        hear(live, 0.1 * k, (2, 3, 4))
        live.process(1)
    # Nothing waits for UAV 1 any more; the last may wait for the positions after it.
    assert live.counts.used >= 2 * 39
    assert not live.dropped


def test_a_receiver_whose_position_is_unknown_is_left_out_even_the_leader() -> None:
    live, clean = live_feed(), live_feed()
    for to in (live, clean):
        report(to, 0.0, (2, 3, 4))
        report(to, 0.2, (2, 3, 4))
    hear(live, 0.1)
    hear(clean, 0.1, (2, 3, 4))
    for to in (live, clean):  # long enough to wait neither for positions nor for arrivals
        report(to, 0.5, (2, 3, 4))
        hear(to, 1.5, (2, 3))
    (update,) = live.process(1)
    assert update.rd_count == 2
    assert live.dropped == {"no_position": 1}
    assert len(clean.process(1)) == 1
    assert_same_track(live, clean, 1e-12)


def test_one_usable_receiver_gives_nothing() -> None:
    live = live_feed()
    report(live, 0.0, (2,))
    hear(live, 0.1, (1, 2))
    hear(live, 1.5, (1, 2))
    report(live, 0.5, (2,))
    assert live.process() == []
    assert live.dropped == {"no_position": 2}
    hear(live, 0.2, (3,))
    report(live, 6.0)
    live.process()
    assert live.dropped["alone"] == 1
    assert live.epoch_s is None


def test_without_any_positions_arrivals_do_not_pile_up() -> None:
    live = live_feed()
    for k in range(10):
        hear(live, 0.1 * k)
        assert live.process() == []
    assert live.dropped == {"no_position": 40}
    report(live, 1.0)
    hear(live, 7.0)
    live.process()
    assert live.dropped == {"no_position": 44}


def test_what_is_older_than_the_history_is_dropped() -> None:
    live = live_feed()
    for k in range(11):
        report(live, 0.1 * k)
        hear(live, 0.1 * k)
        live.process()
    report(live, 6.2)
    hear(live, 1.1)
    assert live.process() == []
    assert live.dropped["too_old"] == 4


@pytest.mark.parametrize(
    ("toa_s", "toa_frac_s", "sigma_s"),
    [
        (int(EPOCH), math.nan, 1e-8),
        (int(EPOCH), math.inf, 1e-8),
        (int(EPOCH), 1.0, 1e-8),
        (int(EPOCH), -1e-9, 1e-8),
        (10**400, 0.1, 1e-8),
        (-(10**12), 0.1, 1e-8),
        (int(EPOCH), 0.1, 0.0),
        (int(EPOCH), 0.1, -1e-8),
        (int(EPOCH), 0.1, math.nan),
        (int(EPOCH), 0.1, 1.0),
    ],
)
def test_a_broken_arrival_time_is_counted_and_never_absorbed(
    toa_s: int, toa_frac_s: float, sigma_s: float
) -> None:
    live, clean = live_feed(), live_feed()
    live.add_arrival(4, 1, toa_s, toa_frac_s, sigma_s)
    for to in (live, clean):
        report(to, 0.0)
        hear(to, 0.1)
        report(to, 0.2)
        assert len(to.process(1)) == 1
    assert live.dropped == {"invalid": 1}
    assert_same_track(live, clean, 1e-12)


def test_a_receiver_whose_clock_is_wrong_is_named_and_spoils_nothing() -> None:
    live, clean = live_feed(), live_feed()
    for k in range(80):
        t = 0.1 * k
        for to in (live, clean):
            report(to, t)
            hear(to, t, (1, 2, 3))
        live.add_arrival(4, k, int(EPOCH + t // 1.0) + 2, t % 1.0, 1e-8)
        live.process(1)
        clean.process(1)
    assert_same_track(live, clean, 1e-12)
    assert live.dropped["times_apart"] > 0
    assert set(live.dropped) == {"times_apart"}
    (complaint,) = live.complaints
    assert complaint.startswith("receiver 4 heard burst 0 +")


def test_an_unknown_receiver_and_an_impossible_wait_are_refused() -> None:
    with pytest.raises(EstimationError, match="receiver 9 is unknown"):
        live_feed().add_arrival(9, 1, int(EPOCH), 0.5, 1e-8)
    with pytest.raises(EstimationError, match="max_burst_wait_s must be"):
        live_feed(max_burst_wait_s=math.nan)
