"""Geometry of the measurements, and the covariance of their errors."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from sim.config import ReceiverConfig
from sim.receivers import Receivers
from swarmctl.units import SPEED_OF_LIGHT_MPS
from tests.sim.receivers import EMITTER, PLACES, POOR, RISK, UTC, WHITE_ONLY


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
@pytest.mark.parametrize("begin_utc_s", [UTC, UTC + 12.98])
@pytest.mark.parametrize("kind", [WHITE_ONLY, POOR], ids=["white only", "every error"])
def test_arrival_times_tell_what_range_differences_tell(
    kind: ReceiverConfig, rho: float, begin_utc_s: float
) -> None:
    config = replace(kind, rho=rho)
    differenced = Receivers(config, tuple(PLACES), 5, UTC)
    stamped = Receivers(config, tuple(PLACES), 5, UTC)
    for k in range(20):
        epoch_utc_s = begin_utc_s + 0.1 * k
        expected = {m.receiver: m for m in differenced.measure(EMITTER, PLACES, epoch_utc_s)}
        arrivals = {m.receiver: m for m in stamped.arrivals(EMITTER, PLACES, epoch_utc_s)}
        assert set(arrivals) == set(PLACES)
        assert len({m.burst for m in arrivals.values()}) == 1
        reference = arrivals[2]
        # The burst reaches the reference at the epoch, but for the receiver's own error: of the
        # microsecond, an echo's 300 m; and the sum here resolves no less.
        assert reference.toa_s + reference.toa_frac_s == pytest.approx(epoch_utc_s, abs=1.3e-6)
        for receiver, difference in expected.items():
            companion = arrivals[receiver]
            later_s = float(companion.toa_s - reference.toa_s)
            later_s += companion.toa_frac_s - reference.toa_frac_s
            # Each fraction is right to 2^-54 s: 17 nm.
            assert SPEED_OF_LIGHT_MPS * later_s == pytest.approx(difference.rd_m, abs=1e-6)
            variance = companion.sigma_s**2 + reference.sigma_s**2
            assert SPEED_OF_LIGHT_MPS**2 * variance == pytest.approx(difference.sigma_m**2)
            assert companion.clock_sigma_s == difference.clock_sigma_s
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


def test_a_clock_error_enters_with_its_sign_and_the_references_in_every_difference() -> None:
    """A companion that stamps late is farther; a reference that does makes all others nearer."""
    off = replace(WHITE_ONLY, clock_bias_sigma_s=100e-9, clock_drift_sigma=1e-9)
    right = Receivers(WHITE_ONLY, tuple(PLACES), 5, UTC)
    wrong = Receivers(off, tuple(PLACES), 5, UTC)
    for epoch_utc_s in (UTC, UTC + 40.0, UTC + 900.0):
        reference_m = wrong.clock_m(2, epoch_utc_s)
        pairs = zip(
            right.measure(EMITTER, PLACES, epoch_utc_s),
            wrong.measure(EMITTER, PLACES, epoch_utc_s),
            strict=True,
        )
        for true, false in pairs:
            clock_m = wrong.clock_m(true.receiver, epoch_utc_s)
            assert false.rd_m - true.rd_m == pytest.approx(clock_m - reference_m, abs=1e-6)
            assert true.clock_sigma_s == 0.0
            since_s = epoch_utc_s - UTC
            assert false.clock_sigma_s == pytest.approx(math.hypot(100e-9, 1e-9 * since_s))


def test_clocks_that_are_started_anew_are_off_by_their_biases_again() -> None:
    receivers = Receivers(POOR, tuple(PLACES), 5, UTC)
    receivers.start_clocks(UTC + 1e6)
    fresh = Receivers(POOR, tuple(PLACES), 5, UTC)
    assert receivers.clock_m(3, UTC + 1e6 + 7.0) == pytest.approx(fresh.clock_m(3, UTC + 7.0))
