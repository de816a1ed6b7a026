"""The paper's Table 1 as the tests of formation designs fly it, and its bound."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from swarmctl.estimation.bounds.pcrb import pcrb
from swarmctl.estimation.model.motion import ConstantVelocity
from swarmctl.formation.objectives import Trajectory
from swarmctl.formation.requirements import Requirements
from swarmctl.study.engagement import Engagement, fly
from swarmctl.study.starts import CV, table_1_covariance
from swarmctl.units import Array

TABLE_1 = Engagement(rho=0.5, duration_s=12.0)
PRIOR = table_1_covariance()[np.ix_(CV, CV)]


def standing_at(*degrees: float, d_m: float = 300.0) -> Array:
    """A design (N, 2) at these angles, all at one distance."""
    return np.array([(math.radians(angle), d_m) for angle in degrees])


@cache
def table_1_trajectory() -> Trajectory:
    moments = list(fly(TABLE_1, standing_at(0.0), TABLE_1.emitter))
    return Trajectory(
        TABLE_1.epochs_s,
        np.array([moment.emitter[:2] for moment in moments]),
        np.array([moment.reference for moment in moments]),
        np.ones(len(moments)),
        PRIOR,
    )


def table_1_bound(design: Array) -> float:
    """As the estimation has it, epoch by epoch along a flight of this very design."""
    moments = list(fly(TABLE_1, design, TABLE_1.emitter))
    P = pcrb(
        PRIOR,
        ConstantVelocity((0.0, 0.0)),
        TABLE_1.epochs_s,
        [moment.emitter[:2] for moment in moments],
        [moment.reference for moment in moments],
        [moment.companions for moment in moments],
        TABLE_1.rd_covariance(len(design)),
        TABLE_1.sigma_p_m,
    )
    return math.sqrt(P[-1, 0, 0] + P[-1, 1, 1])


def table_1(companions: int) -> Requirements:
    return Requirements(companions, 300.0, 10.0, 5000.0)
