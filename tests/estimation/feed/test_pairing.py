"""Arrival times: which belong together, for whom a burst waits, and what the pairs tell."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from swarmctl.estimation.feed.pairing import MAX_SPREAD_S, Arrival, Burst, Pairing, differences
from swarmctl.estimation.model.range_difference import rd_covariance
from swarmctl.units import SPEED_OF_LIGHT_MPS

C = SPEED_OF_LIGHT_MPS
UTC_S = 1_790_000_000


def at(receiver: int, t: float, sigma_s: float = 7e-9) -> Arrival:
    """An arrival t seconds after UTC_S."""
    return Arrival(receiver, UTC_S + int(t // 1.0), t % 1.0, sigma_s)


def pairing(receivers: tuple[int, ...] = (1, 2, 3, 4)) -> Pairing:
    return Pairing(receivers, max_wait_s=1.0)


def hear(to: Pairing, number: int, t: float, receivers: tuple[int, ...]) -> None:
    for receiver in receivers:
        to.add(number, at(receiver, t + 1e-6 * receiver))


def use_whole(of: Pairing) -> list[tuple[int, list[int]]]:
    """Use the bursts that wait for nobody: their numbers and receivers."""
    used = []
    for burst in of.waiting():
        if of.is_whole(burst):
            of.use(burst)
            used.append((burst.number, sorted(burst.arrivals)))
    return used


def only(bursts: list[Burst]) -> Burst:
    (burst,) = bursts
    return burst


# --- Differencing ----------------------------------------------------------------------


@pytest.mark.parametrize("fraction", [0.0, 0.25, 0.999_999_9])
@pytest.mark.parametrize("rd_m", [0.000_001, -123.456_789, 1234.567_891, -29_000.000_003])
def test_a_range_difference_is_exact_to_a_micrometre(fraction: float, rd_m: float) -> None:
    whole = Fraction(fraction) + Fraction(rd_m) / Fraction(C)
    seconds = whole.numerator // whole.denominator
    companion = Arrival(2, UTC_S + seconds, float(whole - seconds), 7e-9)
    found = differences(Arrival(1, UTC_S, fraction, 7e-9), [companion])[2].rd_m
    # A fraction is off by 2^-54 s at most, and so is the difference of two: 50 nm in all.
    assert abs(found - rd_m) < 1e-7
    # As one float of UTC seconds it could be off by tens of metres.
    assert abs(C * (companion.epoch_s - (UTC_S + fraction)) - rd_m) < C * 2.0**-22


def test_the_covariance_is_that_of_differenced_arrival_times() -> None:
    sigma_s = np.array([5e-9, 1e-9, 20e-9, 7e-9])
    arrivals = [at(i, 0.1, float(s)) for i, s in enumerate(sigma_s, start=1)]
    for reference in range(4):
        others = [a for i, a in enumerate(arrivals) if i != reference]
        found = differences(arrivals[reference], others)
        assert list(found) == [a.receiver for a in others]
        _, sigma, rho = np.array(list(found.values())).T
        differencing = np.delete(np.eye(4), reference, axis=0)
        differencing[:, reference] = -1.0
        expected = C**2 * differencing @ np.diag(sigma_s**2) @ differencing.T
        np.testing.assert_allclose(rd_covariance(sigma, rho), expected, rtol=1e-12)


# --- Waiting ---------------------------------------------------------------------------


def test_a_burst_waits_for_everybody_while_everybody_delivers() -> None:
    bursts = pairing()
    hear(bursts, 7, 0.0, (3, 1, 4))
    assert use_whole(bursts) == []
    hear(bursts, 7, 0.0, (2,))
    assert use_whole(bursts) == [(7, [1, 2, 3, 4])]
    assert bursts.waiting() == []
    assert not bursts.dropped


def test_one_who_delivered_a_later_burst_missed_this_one() -> None:
    bursts = pairing()
    hear(bursts, 7, 0.0, (1, 2, 3))
    assert use_whole(bursts) == []
    hear(bursts, 8, 0.1, (4,))
    assert use_whole(bursts) == [(7, [1, 2, 3])]
    # Burst 8 still waits for all of them: nobody was lost.
    hear(bursts, 8, 0.1, (1, 2))
    assert use_whole(bursts) == []
    hear(bursts, 8, 0.1, (3,))
    assert use_whole(bursts) == [(8, [1, 2, 3, 4])]


def test_a_lost_receiver_delays_the_bursts_once_and_may_come_back() -> None:
    bursts = pairing()
    used_at = {}
    for number in range(30):
        hear(bursts, number, 0.15 * number, (1, 2, 3) if number < 25 else (4, 1, 2, 3))
        for used, receivers in use_whole(bursts):
            used_at[used] = (number, len(receivers))
    # The first waits until others are more than a second newer; then each is used as it comes.
    assert used_at == {
        **dict.fromkeys(range(8), (7, 3)),
        **{number: (number, 3) for number in range(8, 25)},
        **{number: (number, 4) for number in range(25, 30)},
    }
    hear(bursts, 30, 4.5, (1, 2, 3))
    assert use_whole(bursts) == []  # it is waited for again
    hear(bursts, 30, 4.5, (4,))
    assert use_whole(bursts) == [(30, [1, 2, 3, 4])]


def test_a_receiver_whose_clock_is_ahead_does_not_hurry_the_others() -> None:
    bursts = pairing()
    bursts.add(7, at(4, 3600.0))
    hear(bursts, 7, 0.0, (1, 2))
    assert use_whole(bursts) == []
    hear(bursts, 7, 0.0, (3,))
    assert use_whole(bursts) == [(7, [1, 2, 3])]


def test_bursts_are_used_in_the_order_of_their_epochs() -> None:
    bursts = pairing((1, 2))
    for number, t in ((9, 0.2), (7, 0.0), (8, 0.1)):
        hear(bursts, number, t, (1, 2))
    assert [number for number, _ in use_whole(bursts)] == [7, 8, 9]


# --- What is not used ------------------------------------------------------------------


def test_what_comes_late_or_twice_is_counted_and_not_used() -> None:
    bursts = pairing()
    hear(bursts, 7, 0.0, (1, 1, 2, 3))
    hear(bursts, 8, 0.1, (4,))
    assert use_whole(bursts) == [(7, [1, 2, 3])]
    hear(bursts, 7, 0.0, (4, 2))
    assert use_whole(bursts) == []
    assert [burst.number for burst in bursts.waiting()] == [8]
    assert bursts.dropped == {"duplicate": 2, "late": 1}


def test_a_number_may_come_round_again() -> None:
    bursts = pairing((1, 2))
    for t in (0.0, 25.6):
        hear(bursts, 255, t, (1, 2))
        assert use_whole(bursts) == [(255, [1, 2])]
    assert not bursts.dropped


def test_a_lone_arrival_is_counted() -> None:
    bursts = pairing((1, 2))
    hear(bursts, 7, 0.0, (1,))
    assert use_whole(bursts) == []
    bursts.give_up(only(bursts.waiting()), "too_old")
    assert bursts.dropped == {"alone": 1}
    assert bursts.complaints == []


def test_one_number_at_impossible_times_is_named_once_and_not_paired() -> None:
    bursts = pairing((1, 2))
    for number in (7, 8):
        bursts.add(number, at(1, 0.1 * number))
        bursts.add(number, at(2, 0.1 * number + 1.01 * MAX_SPREAD_S))
    assert use_whole(bursts) == []
    for burst in bursts.waiting():
        bursts.give_up(burst, "too_old")
    assert bursts.dropped == {"times_apart": 4}
    assert bursts.complaints == [
        "receiver 1 heard burst 7 -0.000168 s from receiver 2, further than any geometry allows: "
        "synchronise their clocks, and number bursts alike"
    ]


def test_two_numbers_for_one_burst_are_named_once_and_not_paired() -> None:
    bursts = pairing((1, 2))
    for number in (7, 8):
        hear(bursts, number, 0.1 * number, (1,))
        hear(bursts, number + 1000, 0.1 * number, (2,))
    assert use_whole(bursts) == []
    for burst in bursts.waiting():
        bursts.give_up(burst, "too_old")
    assert bursts.dropped == {"numbers_differ": 4}
    assert bursts.complaints == [
        "receiver 1 gives the number 7 to the burst that receiver 2 gives the number 1007: all "
        "receivers must number bursts alike"
    ]


def test_a_receiver_that_counts_otherwise_costs_its_own_arrivals_only() -> None:
    bursts = pairing()
    used = []
    for k in range(20):
        hear(bursts, k + 1, 0.1 * k, (4,))  # one ahead of the others, and first to arrive
        hear(bursts, k, 0.1 * k, (1, 2, 3))
        used += use_whole(bursts)
    assert used == [(k, [1, 2, 3]) for k in range(20)]
    assert not bursts.dropped["late"]


def test_what_is_remembered_is_bounded() -> None:
    bursts = pairing((1, 2))
    for number in range(2000):
        hear(bursts, number, 0.02 * number, (1, 2))
        use_whole(bursts)
    assert len(bursts._done) <= 512  # memory has no public face
    assert bursts._waiting == {}
