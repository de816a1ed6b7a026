"""Other people's filters, on the same model and the same draws as the paper's EKF.

They are given an analytic Jacobian and ready-made measurements, which is to their advantage.
Their packages are optional and untyped: they are imported where they are used.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from importlib.metadata import version
from typing import Any

import numpy as np

from swarmctl.study.engagement import Engagement
from swarmctl.study.starts import JUMP
from swarmctl.units import Array
from tests.benchmarks.contestants import (
    FORMATION,
    SINGLES,
    Answer,
    Contestant,
    Flight,
    one_at_a_time,
)

FIRST_EPOCH = datetime(2026, 1, 1, tzinfo=UTC)


def transition_and_noise() -> tuple[Array, Array]:
    """F and Q of the paper's EKF, state [p, v, a], written out a second time."""
    T = Engagement().period_s
    F = np.kron([[1.0, T, T * T / 2.0], [0.0, 1.0, T], [0.0, 0.0, 1.0]], np.eye(2))
    return F, np.diag([0.0, 0.0, 0.0, 0.0, *JUMP])


def expected_rd(state: Array, baselines: Array) -> Array:
    """Range differences (N, K) at K states in columns (6, K), relative to the reference UAV."""
    east, north = state[0], state[1]
    ranges = np.hypot(east - baselines[:, :1], north - baselines[:, 1:])
    differences: Array = ranges - np.hypot(east, north)
    return differences


def expected_rd_by_state(state: Array, baselines: Array) -> Array:
    """Derivative (N, 6) of :func:`expected_rd` by one state (6,)."""
    p = state[:2]
    sight = p - baselines
    H = np.zeros((len(baselines), 6))
    H[:, :2] = sight / np.hypot(sight[:, :1], sight[:, 1:]) - p / math.hypot(*p)
    return H


def six_states(flight: Flight) -> tuple[Array, Array]:
    """Prior of [p, v, a]: means (SINGLES, 6) and covariance (6, 6)."""
    picked = [0, 1, 3, 4, 6, 7]
    return flight.prior.mean[:SINGLES, picked], flight.prior.covariance[np.ix_(picked, picked)]


def relative_scans(flight: Flight, trial: int) -> Iterator[tuple[int, Array, Array]]:
    """Epoch number, measured range differences and baselines of one trial."""
    for k, scan in enumerate(flight.scans):
        yield k, scan.rd[trial], scan.companions[trial] - scan.reference[trial]


def filterpy_ekf(flight: Flight) -> Contestant:
    """The ExtendedKalmanFilter of filterpy.

    Raises:
        ImportError: It is not installed.
    """
    package: Any = importlib.import_module("filterpy.kalman")
    means, covariance = six_states(flight)
    ekfs = []
    for mean in means:
        ekf = package.ExtendedKalmanFilter(dim_x=6, dim_z=len(FORMATION))
        ekf.x, ekf.P = mean.copy(), covariance.copy()
        ekf.F, ekf.Q = transition_and_noise()
        ekf.R = flight.scans[0].rd_covariance
        ekfs.append(ekf)

    def expected(state: Array, baselines: Array) -> Array:
        return expected_rd(state[:, None], baselines)[:, 0]

    def step(ekf: Any, heard: tuple[int, Array, Array]) -> Any:  # noqa: ANN401  no types there
        k, rd, baselines = heard
        if k:
            ekf.predict()
        ekf.update(rd, expected_rd_by_state, expected, args=(baselines,), hx_args=(baselines,))
        return ekf

    scans = [list(relative_scans(flight, trial)) for trial in range(SINGLES)]
    return one_at_a_time(
        f"filterpy {version('filterpy')}: EKF", ekfs, scans, step, lambda ekf: (ekf.x, ekf.P)
    )


def stone_soup(name: str, updater_name: str, flight: Flight) -> Contestant:
    """A filter of Stone Soup: its linear predictor and one of its updaters.

    Raises:
        ImportError: It is not installed.
    """
    linear: Any = importlib.import_module("stonesoup.models.transition.linear")
    predictors: Any = importlib.import_module("stonesoup.predictor.kalman")
    updaters: Any = importlib.import_module("stonesoup.updater.kalman")
    states: Any = importlib.import_module("stonesoup.types.state")
    detections: Any = importlib.import_module("stonesoup.types.detection")
    hypotheses: Any = importlib.import_module("stonesoup.types.hypothesis")
    model = _stone_soup_s_model()

    F, Q = transition_and_noise()
    predictor = predictors.KalmanPredictor(
        linear.LinearGaussianTimeInvariantTransitionModel(transition_matrix=F, covariance_matrix=Q)
    )
    updater = getattr(updaters, updater_name)()
    R = flight.scans[0].rd_covariance
    period = timedelta(seconds=Engagement().period_s)
    heard = [
        [
            detections.Detection(
                rd[:, None],
                timestamp=FIRST_EPOCH + k * period,
                measurement_model=model(ndim_state=6, mapping=(0, 1), baselines=baselines, R=R),
            )
            for k, rd, baselines in relative_scans(flight, trial)
        ]
        for trial in range(SINGLES)
    ]
    means, covariance = six_states(flight)
    starts = [states.GaussianState(mean[:, None], covariance, FIRST_EPOCH) for mean in means]

    def step(state: Any, detection: Any) -> Any:  # noqa: ANN401  no types there
        if detection.timestamp != FIRST_EPOCH:
            state = predictor.predict(state, timestamp=detection.timestamp)
        return updater.update(hypotheses.SingleHypothesis(state, detection))

    def read(state: Any) -> Answer:  # noqa: ANN401
        return np.asarray(state.state_vector, np.float64)[:, 0], np.asarray(state.covar)

    return one_at_a_time(f"Stone Soup {version('stonesoup')}: {name}", starts, heard, step, read)


def _stone_soup_s_model() -> Any:  # noqa: ANN401  a class of a package without types
    """Stone Soup's kind of measurement model, made here because its package is optional."""
    base: Any = importlib.import_module("stonesoup.models.measurement.base")
    models: Any = importlib.import_module("stonesoup.models.base")
    declared: Any = importlib.import_module("stonesoup.base").Property
    arrays: Any = importlib.import_module("stonesoup.types.array")

    class RangeDifferences(base.MeasurementModel, models.GaussianModel):  # type: ignore[misc]
        baselines = declared(np.ndarray)
        R = declared(np.ndarray)

        @property
        def ndim_meas(self) -> int:
            return len(self.baselines)

        def covar(self, **_: object) -> Array:
            covariance: Array = self.R
            return covariance

        def function(self, state: Any, noise: object = False, **_: object) -> Any:  # noqa: ANN401
            columns = expected_rd(np.asarray(state.state_vector, np.float64), self.baselines)
            one = columns.shape[1] == 1
            return columns.view(arrays.StateVector if one else arrays.StateVectors)

        def jacobian(self, state: Any, **_: object) -> Array:  # noqa: ANN401
            x = np.asarray(state.state_vector, np.float64)
            return expected_rd_by_state(x[:, 0], self.baselines)

    return RangeDifferences
