"""What others are given of an estimate: the recording, guidance, and the console and the page.

Each is a projection of :class:`swarmctl.estimation.estimate.Estimate`, made here. What is
published over MQTT is a projection of the recorded one
(:func:`swarmctl.ops.estimate_publication.estimate_message`).
"""

from __future__ import annotations

import numpy as np

from swarmctl import decisions
from swarmctl.estimation.bounds.consistency import ellipse
from swarmctl.estimation.estimate import Estimate
from swarmctl.mission.target import Target
from swarmctl.units import Vector

_HORIZONTAL = (0, 1, 3, 4)
"""Rows of the horizontal position and velocity in the state."""


def recorded(estimate: Estimate, now: float) -> decisions.Estimate:
    """The estimate as it is recorded and sent to all who watch.

    Args:
        estimate: After an update, with what it was made from.
        now: Controller's time, s.
    """
    position, velocity = _vectors(estimate)
    measured = estimate.measured
    return decisions.Estimate(
        at_s=now,
        epoch_utc_s=estimate.epoch_s,
        position_enu=position,
        velocity_enu=velocity,
        covariance=tuple(estimate.P.ravel().tolist()),
        probability=estimate.probability,
        nis=estimate.nis,
        rd_count=estimate.rd_count,
        measured_utc_s=estimate.epoch_s if measured is None else measured.epoch_s,
        reference=None if measured is None else measured.reference,
        receivers=() if measured is None else measured.receivers,
        sigma_m=() if measured is None else measured.sigma_m,
        rho=() if measured is None else measured.rho,
    )


def target_of(estimate: Estimate) -> Target:
    """The estimate as guidance relies on it."""
    position, velocity = _vectors(estimate)
    P = estimate.P
    return Target(
        position,
        velocity,
        float(ellipse(P[:3, :3]).major),
        float(ellipse(P[3:, 3:]).major),
        (float(P[0, 0]), float(P[0, 1]), float(P[1, 1])),
        P[np.ix_(_HORIZONTAL, _HORIZONTAL)],
    )


def _vectors(estimate: Estimate) -> tuple[Vector, Vector]:
    east, north, up, v_east, v_north, v_up = estimate.x.tolist()
    return (east, north, up), (v_east, v_north, v_up)
