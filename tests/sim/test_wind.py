"""Mean wind and gusts."""

from __future__ import annotations

import numpy as np
import pytest

from sim.config import WindConfig
from sim.noise import Normals, generator
from sim.wind import Wind


def wind(gust_sigma_mps: float) -> Wind:
    config = WindConfig((4.0, -2.0, 0.5), gust_sigma_mps, gust_tau_s=5.0)
    return Wind(config, 0.02, Normals(generator(1, "gust", 1)))


def test_without_gusts_the_wind_is_its_mean() -> None:
    assert wind(0.0).advance() == (4.0, -2.0, 0.5)


def test_gusts_blow_about_the_mean_with_their_sigma() -> None:
    gusty = wind(2.0)
    # 20000 s are 2000 independent gusts: 3 sigma are 0.13 m/s of the mean, 5 % of the sigma.
    blown = np.array([gusty.advance() for _ in range(1_000_000)][::50])
    assert blown.mean(axis=0) == pytest.approx([4.0, -2.0, 0.5], abs=0.2)
    assert blown.std(axis=0) == pytest.approx([2.0] * 3, rel=0.1)
