"""Emitter: drift, wander, altitude."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from sim.config import EmitterConfig
from sim.emitter import Emitter
from swarmctl.frames import LocalFrame

RISK = 1e-4
FRAME = LocalFrame(0.8, 0.1, 50.0)


def test_without_wander_it_drifts_with_its_mean_velocity() -> None:
    config = EmitterConfig(0.8, 0.1, 0.0, (1.5, -0.5, 0.0))
    emitter = Emitter(config, FRAME, 0.02, np.random.default_rng(0))
    for _ in range(5000):
        emitter.advance()
    east, north, _ = emitter.state.position_enu
    assert (east, north) == pytest.approx((150.0, -50.0), abs=1e-6)
    assert emitter.state.velocity_enu == (1.5, -0.5, 0.0)


def test_it_keeps_its_altitude_over_the_curved_sea() -> None:
    config = EmitterConfig(0.8, 0.1, 10.0, (20.0, 0.0, 0.0))
    emitter = Emitter(config, FRAME, 1.0, np.random.default_rng(0))
    for _ in range(300):
        emitter.advance()
    altitude = FRAME.to_geodetic(*emitter.state.position_enu)[2]
    assert altitude == pytest.approx(10.0, abs=0.02)
    assert emitter.state.position_enu[2] < -40.0 - 2.0  # the earth fell away by 2.8 m


def test_a_vertical_mean_velocity_changes_the_altitude() -> None:
    config = EmitterConfig(0.8, 0.1, 10.0, (0.0, 0.0, -0.1))
    emitter = Emitter(config, FRAME, 1.0, np.random.default_rng(0))
    for _ in range(50):
        emitter.advance()
    assert FRAME.to_geodetic(*emitter.state.position_enu)[2] == pytest.approx(5.0, abs=1e-6)


def test_wander_is_a_random_walk_of_the_velocity() -> None:
    # Velocity variance q t and position variance q t³/3 per axis, with q the wander squared.
    wander, duration_s, step_s, count = 0.3, 20.0, 0.1, 1500
    config = EmitterConfig(0.8, 0.1, 50.0, (1.0, 2.0, 0.0), wander)
    speeds, places = [], []
    for seed in range(count):
        emitter = Emitter(config, FRAME, step_s, np.random.default_rng(seed))
        for _ in range(round(duration_s / step_s)):
            emitter.advance()
        (x, y, _), (vx, vy, vz) = emitter.state.position_enu, emitter.state.velocity_enu
        speeds += [vx - 1.0, vy - 2.0]
        places += [x - 1.0 * duration_s, y - 2.0 * duration_s]
        assert vz == 0.0
    low, high = stats.chi2.interval(1.0 - RISK, 2 * count)
    speed_sigma = wander * math.sqrt(duration_s)
    place_sigma = wander * math.sqrt(duration_s**3 / 3.0)
    assert low < np.sum(np.square(speeds)) / speed_sigma**2 < high
    assert low < np.sum(np.square(places)) / place_sigma**2 < high
