"""filterpy's EKF as a study's filter; its steps and batches are in test_filters."""

from __future__ import annotations

import numpy as np

from swarmctl.study.batch_filter import RelativePrior, Scan, Truth
from swarmctl.study.filterpy_filter import filterpy_ekf


def test_a_run_that_fails_leaves_the_others_alone() -> None:
    """Without any covariance the innovation's is singular; NaN is refused by the inverse."""
    companions = np.array([[300.0, 0.0], [0.0, 300.0], [-300.0, 0.0]])
    rd, nothing = np.zeros((3, 3)), np.zeros((3, 3))
    truth = Truth(companions, rd[0])
    scan = Scan(0.0, np.zeros((3, 2)), np.zeros(2), companions, rd, nothing, 0.0, truth)
    prior = RelativePrior(np.tile(np.arange(9.0) + 500.0, (3, 1)), np.eye(9), np.zeros(4))
    ekf = filterpy_ekf()
    belief = ekf.start(prior)
    P = belief.P.copy()
    P[1] = 0.0
    P[2] = np.nan
    found = ekf.step(belief._replace(P=P), scan._replace(rd_covariance=0.25 * np.eye(3)))
    assert np.isfinite(found.x[:2]).all()
    assert np.isnan(found.x[2]).all()
    assert np.isnan(found.P[2]).all()
    singular = ekf.step(belief._replace(P=P), scan)
    assert np.isfinite(singular.x[0]).all()
    assert np.isnan(singular.x[1:]).all()
