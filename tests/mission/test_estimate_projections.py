"""What the recording, guidance and the console are given of an estimate."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.estimation.estimate import Estimate, Measured
from swarmctl.estimation.integrity.health import Verdict
from swarmctl.mission.estimate_projections import estimate_snapshot, recorded, target_of
from swarmctl.mission.mission_file_loading import parse_mission
from tests.missions import short_mission_text

FRAME = parse_mission(short_mission_text()).frame
EPOCH = 1_790_000_000.0
X = np.array([100.0, 200.0, 3.0, 1.0, 2.0, 0.5])
_ROOT = np.diag([10.0, 5.0, 1.0, 0.3, 0.2, 0.1]) + 0.01 * np.arange(36).reshape(6, 6)
P = _ROOT @ _ROOT.T
MEASURED = Measured(EPOCH - 0.2, 1, (2, 3), (3.0, 4.0), (0.5, 0.4))
GOOD = Verdict("tracking", None, 1.0, 0.0, 0.0)


def test_the_recording_keeps_the_estimate_and_what_it_was_made_from() -> None:
    made = recorded(Estimate(EPOCH, X, P, 0.8, 0.1, 2.5, 2, MEASURED), 12.0)
    assert (made.at_s, made.epoch_utc_s, made.measured_utc_s) == (12.0, EPOCH, EPOCH - 0.2)
    assert made.position_enu == (100.0, 200.0, 3.0)
    assert made.velocity_enu == (1.0, 2.0, 0.5)
    assert np.array_equal(np.reshape(made.covariance, (6, 6)), P)
    assert (made.probability, made.nis, made.rd_count) == (0.8, 2.5, 2)
    assert (made.reference, made.receivers) == (1, (2, 3))
    assert (made.sigma_m, made.rho) == ((3.0, 4.0), (0.5, 0.4))


def test_the_recording_says_where_nothing_is_known_of_the_measurements() -> None:
    made = recorded(Estimate(EPOCH, X, P), 12.0)
    assert made.measured_utc_s == EPOCH
    assert made.reference is None
    assert made.receivers == made.sigma_m == made.rho == ()


def test_guidance_is_given_the_horizontal_estimate() -> None:
    target = target_of(Estimate(EPOCH, X, P))
    assert target.position_enu == (100.0, 200.0, 3.0)
    assert target.velocity_enu == (1.0, 2.0, 0.5)
    greatest = np.linalg.eigvalsh(P[:2, :2])[-1], np.linalg.eigvalsh(P[3:5, 3:5])[-1]
    assert target.sigma_m == pytest.approx(math.sqrt(greatest[0]))
    assert target.speed_sigma_mps == pytest.approx(math.sqrt(greatest[1]))
    assert target.covariance == (P[0, 0], P[0, 1], P[1, 1])
    assert target.track_covariance is not None
    east_north = [0, 1, 3, 4]
    for row, i in enumerate(east_north):
        assert target.track_covariance[row].tolist() == P[i, east_north].tolist()


def test_the_console_is_given_the_ellipse_and_the_verdict_in_words() -> None:
    believed = Estimate(EPOCH, X, P)
    last = recorded(Estimate(EPOCH - 1.0, X, P, nis=2.5, rd_count=3), 11.0)
    shown = estimate_snapshot(believed, last, FRAME, age_s=1.0, verdict=GOOD, limit="noise")
    assert FRAME.to_enu(shown.lat_rad, shown.lon_rad, FRAME.to_geodetic(*X[:3])[2]) == (
        pytest.approx((100.0, 200.0, 3.0), abs=1e-3)
    )
    minor, major = np.sqrt(np.linalg.eigvalsh(P[:2, :2]))
    assert (shown.sigma_major_m, shown.sigma_minor_m) == pytest.approx((major, minor))
    axis = np.array([math.cos(shown.sigma_angle_rad), math.sin(shown.sigma_angle_rad)])
    assert axis @ P[:2, :2] @ axis == pytest.approx(major**2)
    assert (shown.nis, shown.rd_count, shown.age_s, shown.limit) == (2.5, 3, 1.0, "noise")
    assert (shown.health, shown.why) == (
        "tracking",
        "The measurements are what the track expects.",
    )


def test_the_console_counts_nothing_before_the_first_update() -> None:
    believed = Estimate(EPOCH, X, P, nis=9.0, rd_count=9)
    shown = estimate_snapshot(believed, None, FRAME, age_s=math.inf, verdict=GOOD, limit="")
    assert (shown.nis, shown.rd_count, shown.age_s) == (0.0, 0, math.inf)
