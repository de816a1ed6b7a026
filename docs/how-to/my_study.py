"""Rows and curves of one's own: ``swarmctl study table1|consistency|track --with my_study.py``."""

from math import pi

import numpy as np

from swarmctl.study import (
    BatchEstimate,
    Belief,
    Registry,
    RelativePrior,
    Scan,
    iterated_ekf,
    ncrkf,
)


class Uncorrelated:
    """What does it cost to forget that all range differences share a receiver?"""

    relative = False
    ekf = iterated_ekf()

    def start(self, prior: RelativePrior) -> Belief:
        """The belief before the first scan."""
        return self.ekf.start(prior)

    def step(self, belief: Belief, scan: Scan) -> Belief:
        """Predict, then update with the variances only."""
        variances = np.diag(np.diag(scan.rd_covariance))
        return self.ekf.step(belief, scan._replace(rd_covariance=variances))

    def estimate(self, belief: Belief, scan: Scan) -> BatchEstimate:
        """Position and velocity."""
        return self.ekf.estimate(belief, scan)


def register(registry: Registry) -> None:
    """Add three filters and a formation to those of the study."""
    # The same filter in other coordinates: which are best?
    registry.register_filter("NCRKF, relative", lambda q: ncrkf(state="relative", process_noise=q))
    jump = (0.01, 0.01)  # Table 1's Q, (m/s²)²
    registry.register_filter(
        "NCRKF, relative CA", lambda _: ncrkf(state="accelerated", process_noise=jump)
    )
    registry.register_filter("uncorrelated EKF", lambda _: Uncorrelated())

    # Angle from the line of sight (rad) and distance from the reference UAV (m), one pair for
    # each companion.
    registry.register_formation("axis behind", [(-pi / 2, 300.0), (pi, 300.0), (pi / 2, 300.0)])
