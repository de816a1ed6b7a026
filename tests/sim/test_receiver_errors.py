"""The statistics of every part of the receivers' errors."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy import stats

from sim.noise import Normals, generator
from sim.receivers import Receivers
from swarmctl.units import SPEED_OF_LIGHT_MPS
from tests.sim.receivers import PLACES, POOR, RISK, UTC, WHITE_ONLY, arrival_errors_m


def test_the_white_draws_are_each_receivers_own_and_the_same_with_every_other_error_on() -> None:
    sigma_m = {j: 3.0 * math.sqrt(0.3 if j == 2 else 0.7) for j in PLACES}
    own = {j: Normals(generator(5, "receiver", j)) for j in PLACES}
    clean = Receivers(replace(WHITE_ONLY, rho=0.3), tuple(PLACES), 5, UTC)
    poor = Receivers(replace(POOR, rho=0.3, nlos_share=0.0), tuple(PLACES), 5, UTC)
    # What the poor ones have besides: without any white part.
    rest = Receivers(replace(POOR, rho=0.3, nlos_share=0.0, sigma_m=1e-12), tuple(PLACES), 5, UTC)
    for k in range(50):
        expected = {j: sigma_m[j] * normals.draw() for j, normals in own.items()}
        epoch_utc_s = UTC + k
        white = arrival_errors_m(clean, epoch_utc_s)
        assert white == pytest.approx(expected, abs=1e-6)
        every, besides = arrival_errors_m(poor, epoch_utc_s), arrival_errors_m(rest, epoch_utc_s)
        assert {j: every[j] - besides[j] for j in PLACES} == pytest.approx(expected, abs=1e-6)


def test_clock_errors_are_drawn_once_for_each_receiver_and_grow_with_its_drift() -> None:
    bias_s, drift, seeds = 10e-9, 0.2e-9, 500
    config = replace(WHITE_ONLY, clock_bias_sigma_s=bias_s, clock_drift_sigma=drift)
    swarms = [Receivers(config, tuple(PLACES), seed, UTC) for seed in range(seeds)]
    at_start = np.array([[r.clock_m(j, UTC) for j in PLACES] for r in swarms])
    rates = np.array([[r.drift_mps(j) for j in PLACES] for r in swarms])
    later = np.array([[r.clock_m(j, UTC + 300.0) for j in PLACES] for r in swarms])
    np.testing.assert_allclose(later, at_start + 300.0 * rates, rtol=0.0, atol=1e-9)
    low, high = stats.chi2.interval(1.0 - RISK, at_start.size)
    assert low < np.sum((at_start / (SPEED_OF_LIGHT_MPS * bias_s)) ** 2) < high
    assert low < np.sum((rates / (SPEED_OF_LIGHT_MPS * drift)) ** 2) < high
    # Independent of one another: of the receivers', and bias of drift. Fisher's z.
    bound = math.tanh(stats.norm.isf(RISK / 2.0) / math.sqrt(seeds - 3))
    for a, b in combinations(np.hstack([at_start, rates]).T, 2):
        assert abs(np.corrcoef(a, b)[0, 1]) < bound


def test_echoes_come_late_by_a_uniform_detour_at_the_stated_share_of_arrivals() -> None:
    share, epochs = 0.1, 4000
    config = replace(WHITE_ONLY, sigma_m=1e-12, nlos_share=share, nlos_min_m=20.0, nlos_max_m=80.0)
    receivers = Receivers(config, tuple(PLACES), seed=3)
    late = np.array([list(arrival_errors_m(receivers, float(k)).values()) for k in range(epochs)])
    echoed = late > 1e-3
    assert np.all(np.abs(late[~echoed]) < 1e-3)
    assert stats.binomtest(int(echoed.sum()), echoed.size, share).pvalue > RISK
    assert stats.kstest(late[echoed], "uniform", args=(20.0, 60.0)).pvalue > RISK
    # At each receiver by itself, and no more likely after one than otherwise.
    together = echoed[:, 0] & echoed[:, 1]
    assert stats.binomtest(int(together.sum()), epochs, share**2).pvalue > RISK
    again = echoed[0::2] & echoed[1::2]
    assert stats.binomtest(int(again.sum()), again.size, share**2).pvalue > RISK


def test_colour_is_a_stationary_gauss_markov_process_of_every_arrival() -> None:
    sigma, tau_s, bursts = 2.0, 0.5, 4000
    config = replace(WHITE_ONLY, sigma_m=1e-12, colour_sigma_m=sigma, colour_tau_s=tau_s)
    # A burst after 0.1 s, then one after 0.9 s: the gap decides, not the count.
    epochs = np.cumsum(np.tile([0.1, 0.9], bursts // 2))
    receivers = Receivers(config, tuple(PLACES), seed=4)
    x = np.array([list(arrival_errors_m(receivers, float(t)).values()) for t in epochs])
    phi = np.exp(-np.diff(epochs) / tau_s)[:, None]
    drive = (x[1:] - phi * x[:-1]) / (sigma * np.sqrt(1.0 - phi**2))
    low, high = stats.chi2.interval(1.0 - RISK, drive[::2].size)
    assert low < np.sum(drive[::2] ** 2) < high
    assert low < np.sum(drive[1::2] ** 2) < high
    bound = math.tanh(stats.norm.isf(RISK / 2.0) / math.sqrt(len(drive) - 4))
    assert abs(np.corrcoef(drive[:-1, 0], drive[1:, 0])[0, 1]) < bound
    for a, b in combinations(drive.T, 2):
        assert abs(np.corrcoef(a, b)[0, 1]) < bound
    # Nor has it anything to do with the white part.
    clean = Receivers(WHITE_ONLY, tuple(PLACES), seed=4)
    white = np.array([list(arrival_errors_m(clean, float(t)).values()) for t in epochs])
    for a, b in zip(drive.T, white[1:].T, strict=True):
        assert abs(np.corrcoef(a, b)[0, 1]) < bound
    # From the first burst on, over receivers and seeds.
    first = [
        error
        for seed in range(500)
        for error in arrival_errors_m(Receivers(config, tuple(PLACES), seed), 1.0).values()
    ]
    low, high = stats.chi2.interval(1.0 - RISK, len(first))
    assert low < np.sum(np.square(first)) / sigma**2 < high
