"""Receivers as they are: what is drawn has the statistics that the model says it has."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from scipy import stats

from swarmctl.estimation.model.range_difference import effective_covariance, rd_covariance
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.study.engagement import Engagement, Moment, fly
from swarmctl.study.receivers import ECHO_M, Heard, Reception, SimulatedReceivers, scan_of
from swarmctl.units import Array

RUNS = 4000
RISK = 1e-4
"""Probability that correct code misses a statistical bound."""
FORMATION = np.array([[-1.5, 300.0], [0.1, 300.0], [1.5, 300.0]])
SCENE = Engagement(period_s=0.5, duration_s=5.0)


def moments() -> Iterator[Moment]:
    return fly(SCENE, FORMATION, SCENE.emitter)


def flown(receivers: SimulatedReceivers, companions: int | None = None) -> list[Heard]:
    rngs = (np.random.default_rng(seed) for seed in (1, 2))
    reception = Reception(receivers, RUNS, len(FORMATION), *rngs)
    return [reception.hear(k * 0.5, moment, companions) for k, moment in enumerate(moments())]


def off(heard: Heard) -> tuple[Array, Array]:
    """Errors of the RDs and of the reported positions."""
    m = heard.moment
    at = np.concatenate([m.reference[None], m.companions])
    ranges = np.linalg.norm(m.emitter[:2] - at, axis=-1)
    return heard.rd - (ranges[1:] - ranges[0]), heard.positions - at


def assert_covariance(samples: Array, expected: Array) -> None:
    """Of (runs, n) with mean zero, by the normal approximation of each entry's error."""
    found = samples.T @ samples / len(samples)
    spread = np.sqrt((np.outer(np.diag(expected), np.diag(expected)) + expected**2) / len(samples))
    far = stats.norm.ppf(1.0 - RISK / 2.0) * spread
    assert (np.abs(found - expected) <= far + 1e-12).all()


ALONE = np.eye(3) + 1.0
"""Covariance of differences of independent arrivals of variance 1."""


@pytest.mark.parametrize(
    ("receivers", "at_0", "at_5_s", "lasting"),
    [
        (SimulatedReceivers(arrival_m=2.0, position_m=0.0), 4.0, 4.0, 0.0),
        (SimulatedReceivers(0.0, 0.0, ReceiverErrors(bias_m=9.0)), 81.0, 81.0, 81.0),
        (SimulatedReceivers(0.0, 0.0, ReceiverErrors(9.0, 3.0)), 81.0, 81.0 + 225.0, 81.0),
        (
            SimulatedReceivers(0.0, 0.0, ReceiverErrors(colour_m=2.0, colour_tau_s=4.0)),
            4.0,
            4.0,
            4.0 * math.exp(-5.0 / 4.0),
        ),
    ],
    ids=["white", "bias", "drift", "colour"],
)
def test_arrivals_err_as_the_model_says(
    receivers: SimulatedReceivers, at_0: float, at_5_s: float, lasting: float
) -> None:
    """Variance at the start and 5 s later, and the covariance of the two."""
    heard = flown(receivers)
    first, last = (off(heard[k])[0] for k in (0, -1))
    expected = np.block(
        [[at_0 * ALONE, lasting * ALONE], [lasting * ALONE, at_5_s * ALONE]],
    )
    assert_covariance(np.concatenate([first, last], axis=1), expected)
    np.testing.assert_array_equal(off(heard[-1])[1], 0.0)


def test_reported_positions_err_as_the_model_says() -> None:
    """White and wandering errors of every UAV and axis by itself; the RDs do not follow."""
    receivers = SimulatedReceivers(0.0, 1.0, ReceiverErrors(navigation_m=3.0, navigation_tau_s=6.0))
    heard = flown(receivers)
    first, last = (off(heard[k])[1].reshape(RUNS, 8) for k in (0, -1))
    lasting = 9.0 * math.exp(-5.0 / 6.0)
    expected = np.kron([[10.0, lasting], [lasting, 10.0]], np.eye(8))
    assert_covariance(np.concatenate([first, last], axis=1), expected)
    np.testing.assert_allclose(off(heard[-1])[0], 0.0, atol=1e-9)


def test_white_covariance_is_that_of_the_rds_at_reported_positions() -> None:
    expected = effective_covariance(rd_covariance(np.full(3, 0.5), 0.5), 0.5)
    np.testing.assert_allclose(SimulatedReceivers().white_covariance(3), expected, rtol=1e-12)


def test_echoes_come_on_top_of_the_same_noise() -> None:
    with_echoes, without = flown(SimulatedReceivers(echoes=0.1)), flown(SimulatedReceivers())
    added = np.stack([heard.echo for heard in with_echoes])
    for one, other in zip(with_echoes, without, strict=True):
        np.testing.assert_array_equal(one.rd, other.rd)
        np.testing.assert_array_equal(one.positions, other.positions)
        assert not other.echo.any()
    count = int((added > 0.0).sum())
    low, high = stats.binom.interval(1.0 - RISK, added.size, 0.1)
    assert low <= count <= high
    values = np.sort(added[added > 0.0])
    assert stats.kstest(values, stats.uniform(ECHO_M[0], ECHO_M[1] - ECHO_M[0]).cdf).pvalue > RISK


def test_a_filter_that_knows_white_noise_only_is_told_the_whole_sigma() -> None:
    """Of what its own measurements err by at the start, echoes apart."""
    real = SimulatedReceivers(0.3, 0.4, ReceiverErrors(9.0, 0.3, 1.5, 60.0, 2.0, 0.5), echoes=0.1)
    heard = flown(real)[0]
    scan = scan_of(heard, real)
    np.testing.assert_array_equal(scan.rd, heard.rd + heard.echo)
    np.testing.assert_array_equal(scan.reference, heard.positions[:, 0])
    np.testing.assert_array_equal(scan.companions, heard.positions[:, 1:])
    errors, positions = off(heard)
    assert_covariance(errors, scan.rd_covariance)
    assert_covariance(positions.reshape(RUNS, 8), scan.sigma_p**2 * np.eye(8))
    np.testing.assert_allclose(scan.truth.rd, (heard.rd - errors)[0], atol=1e-9)


def test_of_a_silence_a_filter_hears_what_tells_nothing() -> None:
    some = scan_of(flown(SimulatedReceivers(), 2)[1], SimulatedReceivers())
    assert (some.rd.shape, some.companions.shape) == ((RUNS, 2), (RUNS, 2, 2))
    assert some.truth.baselines.shape == (2, 2)
    none = scan_of(flown(SimulatedReceivers(), 0)[1], SimulatedReceivers())
    assert none.dt == 0.5
    assert np.diag(none.rd_covariance).min() > 1e12
