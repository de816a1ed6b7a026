"""Geometry and statistics of the range differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from sim.config import ReceiverConfig
from sim.receivers import Receivers
from swarmctl.feed.schema import SPEED_OF_LIGHT_MPS

RISK = 1e-4
EMITTER = (1000.0, 2000.0, 0.0)
PLACES = {
    1: (0.0, 0.0, 100.0),
    2: (50.0, 10.0, 90.0),
    3: (-40.0, 30.0, 110.0),
    4: (5.0, -60.0, 100.0),
}


def test_range_difference_is_companion_minus_reference() -> None:
    receivers = Receivers(ReceiverConfig(reference=2, sigma_m=1e-9), tuple(PLACES), seed=0)
    messages = receivers.measure(EMITTER, PLACES, 1e9)
    assert [message.receiver for message in messages] == [1, 3, 4]
    for message in messages:
        a, b = np.array(PLACES[message.receiver]), np.array(PLACES[2])
        expected = np.linalg.norm(a - EMITTER) - np.linalg.norm(b - EMITTER)
        assert message.rd_m == pytest.approx(expected, abs=1e-6)
        assert message.reference == 2
        assert message.epoch_utc_s == 1e9


def test_nothing_without_the_reference_or_without_a_companion() -> None:
    receivers = Receivers(ReceiverConfig(reference=1), tuple(PLACES), seed=0)
    without_reference = {sysid: place for sysid, place in PLACES.items() if sysid != 1}
    assert receivers.measure(EMITTER, without_reference, 0.0) == []
    assert receivers.measure(EMITTER, {1: PLACES[1]}, 0.0) == []
    assert receivers.measure(EMITTER, {}, 0.0) == []
    # Nor does it count as a message.
    assert receivers.measure(EMITTER, PLACES, 0.0)[0].seq == 1


def test_errors_do_not_depend_on_who_hears() -> None:
    config = ReceiverConfig(reference=1)
    all_hear = Receivers(config, tuple(PLACES), seed=5)
    some_hear = Receivers(config, tuple(PLACES), seed=5)
    all_hear.measure(EMITTER, PLACES, 0.0)
    some_hear.measure(EMITTER, {}, 0.0)
    few = {1: PLACES[1], 4: PLACES[4]}
    (alone,) = some_hear.measure(EMITTER, few, 1.0)
    together = all_hear.measure(EMITTER, PLACES, 1.0)
    assert alone.rd_m == together[-1].rd_m


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("epoch_utc_s", [1_790_000_000.0, 1_790_000_012.98])
def test_arrival_times_tell_what_range_differences_tell(rho: float, epoch_utc_s: float) -> None:
    config = ReceiverConfig(reference=2, rho=rho)
    differenced = Receivers(config, tuple(PLACES), seed=5)
    stamped = Receivers(config, tuple(PLACES), seed=5)
    for _ in range(20):
        expected = {m.receiver: m for m in differenced.measure(EMITTER, PLACES, epoch_utc_s)}
        arrivals = {m.receiver: m for m in stamped.arrivals(EMITTER, PLACES, epoch_utc_s)}
        assert set(arrivals) == set(PLACES)
        assert len({m.burst for m in arrivals.values()}) == 1
        reference = arrivals[2]
        # The burst reaches the reference at the epoch, but for the receiver's own error.
        assert reference.toa_s + reference.toa_frac_s == pytest.approx(epoch_utc_s, abs=2.4e-7)
        for receiver, difference in expected.items():
            companion = arrivals[receiver]
            later_s = float(companion.toa_s - reference.toa_s)
            later_s += companion.toa_frac_s - reference.toa_frac_s
            # Each fraction is right to 2^-54 s: 17 nm.
            assert SPEED_OF_LIGHT_MPS * later_s == pytest.approx(difference.rd_m, abs=1e-6)
            variance = companion.sigma_s**2 + reference.sigma_s**2
            assert SPEED_OF_LIGHT_MPS**2 * variance == pytest.approx(difference.sigma_m**2)
            # One without any error states a millimetre: (1 mm / 3 m)² of the variance.
            assert reference.sigma_s**2 / variance == pytest.approx(rho, abs=2e-7)


def test_arrival_times_need_two_receivers_but_not_the_reference() -> None:
    receivers = Receivers(ReceiverConfig(reference=1), tuple(PLACES), seed=0)
    assert receivers.arrivals(EMITTER, {}, 0.0) == []
    assert receivers.arrivals(EMITTER, {1: PLACES[1]}, 0.0) == []
    others = {sysid: place for sysid, place in PLACES.items() if sysid != 1}
    arrivals = receivers.arrivals(EMITTER, others, 1e9)
    assert [(m.receiver, m.burst) for m in arrivals] == [(2, 1), (3, 1), (4, 1)]
    assert all(0 <= m.toa_frac_s < 1.0 for m in arrivals)


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.5, 0.9])
def test_covariance_of_the_range_differences(rho: float) -> None:
    # sigma² ((1 - rho) I + rho 11') has the eigenvalue sigma² (1 + (n - 1) rho) along 1 and
    # sigma² (1 - rho) across it; the scatter in each subspace over the eigenvalue is
    # chi-squared, and the two together fix the matrix up to a rotation within the second.
    sigma, epochs, companions = 3.0, 5000, 3
    config = ReceiverConfig(reference=1, sigma_m=sigma, rho=rho)
    receivers = Receivers(config, tuple(PLACES), seed=11)
    reference = math.dist(EMITTER, PLACES[1])
    true = np.array([math.dist(EMITTER, PLACES[j]) - reference for j in (2, 3, 4)])
    measured = [
        [message.rd_m for message in receivers.measure(EMITTER, PLACES, 0.0)] for _ in range(epochs)
    ]
    errors = np.array(measured) - true
    common = errors.sum(axis=1) / math.sqrt(companions)
    across = errors - errors.mean(axis=1, keepdims=True)
    low, high = stats.chi2.interval(1.0 - RISK, epochs)
    assert low < np.sum(common**2) / (sigma**2 * (1.0 + (companions - 1) * rho)) < high
    low, high = stats.chi2.interval(1.0 - RISK, epochs * (companions - 1))
    assert low < np.sum(across**2) / (sigma**2 * (1.0 - rho)) < high
    # Every companion alone has the stated sigma.
    low, high = stats.chi2.interval(1.0 - RISK, epochs)
    for column in errors.T:
        assert low < np.sum(column**2) / sigma**2 < high
    # Unbiased and white in time.
    bound = stats.norm.isf(RISK / 2.0)
    assert np.all(np.abs(errors.mean(axis=0)) < bound * sigma / math.sqrt(epochs))
    lagged = np.corrcoef(errors[:-1, 0], errors[1:, 0])[0, 1]
    assert abs(lagged) < bound / math.sqrt(epochs - 1)
