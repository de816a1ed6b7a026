"""Range differences and the vehicles' positions at their epoch become the rows of an epoch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from swarmctl.estimation.estimate import Measured
from swarmctl.estimation.feed.alignment import SwarmPositions
from swarmctl.estimation.feed.pairing import Measurement
from swarmctl.estimation.model.range_difference import effective_covariance, rd_covariance
from swarmctl.estimation.model.rows import Rows, star


class Located(NamedTuple):
    """An epoch's range differences whose receivers' positions are known.

    Attributes:
        rows: As the track takes them.
        measured: What they were made from.
    """

    rows: Rows
    measured: Measured


def locate(
    positions: SwarmPositions,
    epoch_s: float,
    reference: int,
    measurements: Mapping[int, Measurement],
    sigma_p_m: float,
) -> Located | None:
    """Put the vehicles' positions to range differences of one epoch and reference.

    Args:
        positions: Where the vehicles were.
        epoch_s: s.
        reference: System id of the reference's vehicle.
        measurements: By companion.
        sigma_p_m: 1-sigma of the vehicles' reported positions, per axis, m.

    Returns:
        None if the reference's position or that of every companion is not known.
    """
    reference_at = positions.at(reference, epoch_s)
    places = {receiver: positions.at(receiver, epoch_s) for receiver in measurements}
    known = {receiver: at for receiver, at in places.items() if at is not None}
    if reference_at is None or not known:
        return None
    receivers = list(known)
    rd, sigma, rho = np.array([measurements[receiver] for receiver in receivers]).T
    rows = star(
        epoch_s,
        reference,
        np.array(reference_at),
        receivers,
        np.array(list(known.values())),
        rd,
        effective_covariance(rd_covariance(sigma, rho), sigma_p_m),
        sigma_p_m,
    )
    measured = Measured(
        epoch_s, reference, tuple(receivers), tuple(sigma.tolist()), tuple(rho.tolist())
    )
    return Located(rows, measured)
