"""A mission file's words in the estimator's terms."""

import math

import numpy as np
import pytest

from swarmctl.estimation.filters import FILTERS, Filters, NewKernel
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.estimation.track.kernel import Kernel
from swarmctl.mission.filter_settings import (
    emitter_prior,
    expected_enu,
    new_track,
    process_noise,
    receiver_errors,
)
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.mission_file_loading import parse_mission
from tests.missions import short_mission_text

SECTOR = {"bearing_deg": 60.0, "width_deg": 60.0, "nearest_m": 1000.0, "farthest_m": 6000.0}


def in_a_sector() -> Mission:
    return parse_mission(
        short_mission_text(
            emitter={"sector": SECTOR, "alt_amsl_m": 0.0},
            filter={"kind": "tracker"},
            limits__geofence_radius_m=7000.0,
        )
    )


def test_a_sector_is_a_prior_with_its_moments() -> None:
    """Against moments of emitters drawn uniformly in bearing and range."""
    mission = in_a_sector()
    rng = np.random.default_rng(0)
    count = 200_000
    bearing = np.radians(rng.uniform(30.0, 90.0, count))
    distance = rng.uniform(1000.0, 6000.0, count)
    drawn = distance * np.array([np.sin(bearing), np.cos(bearing)])
    mean, covariance = emitter_prior(mission)
    # Five standard errors of a mean, and of a second moment by the fourth.
    assert np.abs(mean[:2] - drawn.mean(1)).max() < 5.0 * 1500.0 / math.sqrt(count)
    np.testing.assert_allclose(covariance[:2, :2], np.cov(drawn), rtol=0.02)
    # The sea curves away by 0.08 m at 1 km and by 2.8 m at 6 km.
    ground = -mission.origin.alt_amsl_m
    assert mean[2] == pytest.approx(ground - 0.5 * (0.08 + 2.83), abs=0.02)
    assert covariance[2, 2] == pytest.approx(1.0 + (0.5 * (2.83 - 0.08)) ** 2, abs=0.03)
    assert expected_enu(mission) == pytest.approx(mean[:3])


def test_nanoseconds_are_metres() -> None:
    mission = parse_mission(
        short_mission_text(
            filter={
                "clock_bias_ns": 10.0,
                "clock_drift_ns_per_s": 0.2,
                "navigation_sigma_m": 0.5,
                "navigation_tau_s": 40.0,
                "colour_sigma_m": 0.3,
                "colour_tau_s": 0.7,
            }
        )
    )
    errors = receiver_errors(mission)
    assert errors.bias_m == pytest.approx(2.9979, abs=1e-4)
    assert errors.drift_mps == pytest.approx(0.059958, abs=1e-6)
    rest = ReceiverErrors(errors.bias_m, errors.drift_mps, 0.5, 40.0, 0.3, 0.7)
    assert errors == rest


def test_the_kind_says_what_tracks() -> None:
    made: list[tuple[str, Behaviour]] = []

    def noting(name: str) -> NewKernel:
        def make(behaviour: Behaviour) -> Kernel:
            made.append((name, behaviour))
            return FILTERS[name](behaviour)

        return make

    filters = Filters({name: noting(name) for name in FILTERS})
    missions = parse_mission(short_mission_text()), in_a_sector()
    for mission in missions:
        new_track(mission, filters)
    assert [name for name, _ in made] == ["ncrkf", "tracker"]
    for mission, (_, behaviour) in zip(missions, made, strict=True):
        assert behaviour.process_noise.tolist() == list(process_noise(mission))
        assert behaviour.errors == receiver_errors(mission)
