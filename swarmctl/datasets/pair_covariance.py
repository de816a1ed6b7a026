"""The rows of an epoch with the covariance of their noise, whatever pairs were measured."""

from __future__ import annotations

import numpy as np

from swarmctl.datasets.reading import Epoch, ReceiverPositions
from swarmctl.estimation.model.rows import Rows
from swarmctl.units import Array

LARGEST_RHO = 0.495
"""Largest share where pairs close a loop (ab, bc, ac): a hundredth of the variance stays each
row's own, because the covariance is singular if the arrivals have all of it."""


def pair_covariance(first: list[int], second: list[int], sigma_m: Array, rho: float = 0.5) -> Array:
    """Covariance of the white noise of an epoch's range differences (RDs).

    Each of the two arrivals of an RD has the share ``rho`` of its variance; the rest is the
    pair's own. So the covariance of the pairs (a, b) and (c, d) is

        sigma_ab sigma_cd [rho (d_ac - d_ad - d_bc + d_bd) + (1 - 2 rho) d_ab,cd]

    With rho = ½ and equal receivers, each arrival has the variance sigma²/2 and nothing is the
    pair's own.

    Args:
        first: Receiver i of each of the K rows.
        second: Receiver j of each row.
        sigma_m: 1-sigma of each RD, (K,), m.
        rho: 0 (rows are independent) to ½; at most :data:`LARGEST_RHO` is used where the pairs
            close a loop.

    Returns:
        (K, K), m², positive definite.
    """
    i, j = np.array(first), np.array(second)
    ids = np.unique(np.concatenate([i, j]))
    signs = (j[:, None] == ids).astype(float) - (i[:, None] == ids)
    if np.linalg.matrix_rank(signs) < len(i):
        rho = min(rho, LARGEST_RHO)
    shares = rho * (signs @ signs.T) + (1.0 - 2.0 * rho) * np.eye(len(i))
    covariance: Array = shares * np.outer(sigma_m, sigma_m)
    return covariance


def rows_of(epoch: Epoch, receivers: ReceiverPositions, rho: float) -> tuple[Rows | None, int]:
    """Turn an epoch into the rows that a track takes.

    Args:
        epoch: What was measured.
        receivers: Where the receivers were.
        rho: As for :func:`pair_covariance`.

    Returns:
        The rows, or None if there are none; and how many measurements were left out because a
        receiver's position is not known at that time.
    """
    at = {
        receiver: receivers.trajectories[receiver].at(epoch.epoch_s)
        for m in epoch.measurements
        for receiver in (m.first, m.second)
    }
    known = {receiver: position for receiver, position in at.items() if position is not None}
    good = [m for m in epoch.measurements if m.first in known and m.second in known]
    left_out = len(epoch.measurements) - len(good)
    if not good:
        return None, left_out
    first, second = [m.first for m in good], [m.second for m in good]
    return Rows(
        epoch.epoch_s,
        first,
        second,
        np.stack([known[r] for r in first]),
        np.stack([known[r] for r in second]),
        np.array([m.rd_m for m in good]),
        pair_covariance(first, second, np.array([m.sigma_m for m in good]), rho),
    ), left_out
