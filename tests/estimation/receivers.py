"""Receivers with clocks, navigation errors and echoes, in Table 1's engagement at 10 Hz."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from swarmctl.estimation.model.range_difference import range_differences
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.estimation.model.rows import Rows, star
from swarmctl.units import Array
from tests.estimation.scenarios import table_1

SIGMA_M = 0.5
"""White part of a range difference; half of its variance is the reference's."""
WHITE = SIGMA_M**2 * 0.5 * (np.eye(3) + 1.0)
PERIOD_S = 0.1
REAL = ReceiverErrors(bias_m=9.0, drift_mps=0.3, navigation_m=1.5, navigation_tau_s=60.0)


class Flight(NamedTuple):
    """What one run measures; time is the first axis."""

    rows: list[Rows]
    true_rows: list[Rows]  # with the true positions
    emitter: Array  # (K, 4)


def flight(
    rng: np.random.Generator, errors: ReceiverErrors, until_s: float, echoes: float = 0.0
) -> Flight:
    """Fly Table 1's engagement once.

    Args:
        rng: Of all errors.
        errors: Drawn, and moved as they say.
        until_s: Length, s.
        echoes: Share of range differences with 50-300 m too much.
    """
    scene = table_1()
    step = round(PERIOD_S / 0.02)
    count = round(until_s / PERIOD_S) + 1
    bias = errors.bias_m * rng.standard_normal(4)
    drift = errors.drift_mps * rng.standard_normal(4)
    navigation = errors.navigation_m * rng.standard_normal((4, 2))
    keep = math.exp(-PERIOD_S / errors.navigation_tau_s)
    rows, true_rows = [], []
    for k in range(count):
        e = scene.emitter[k * step]
        at = np.concatenate([scene.reference[k * step][None], scene.companions[k * step]])
        reported = at + navigation
        rd = range_differences(e[:2], at[0], at[1:]) + (bias[1:] - bias[0])
        rd = rd + np.linalg.cholesky(WHITE) @ rng.standard_normal(3)
        rd = rd + np.where(rng.random(3) < echoes, rng.uniform(50.0, 300.0, 3), 0.0)
        t = k * PERIOD_S
        rows.append(star(t, 0, reported[0], [1, 2, 3], reported[1:], rd, WHITE))
        true_rows.append(star(t, 0, at[0], [1, 2, 3], at[1:], rd, WHITE))
        bias = bias + PERIOD_S * drift
        refreshed = math.sqrt(1.0 - keep**2) * errors.navigation_m
        navigation = keep * navigation + refreshed * rng.standard_normal((4, 2))
    return Flight(rows, true_rows, scene.emitter[: count * step : step])
