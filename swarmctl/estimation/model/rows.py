"""The rows of an epoch: range differences of any pairs of receivers, as every filter takes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from swarmctl.units import Array, Mask


class Rows(NamedTuple):
    """The range differences of one epoch.

    Attributes:
        epoch_s: s.
        first: Receiver i of each, by id.
        second: Receiver j of each; ``rd`` = distance to j minus distance to i.
        first_at: Reported position of i, (K, d), m.
        second_at: Reported position of j, (K, d), m.
        rd: (K,), m.
        covariance: Covariance of their white noise, (K, K), m², positive definite.
        position_m: 1-sigma of the reported positions' white noise per axis, m: what of the
            covariance is theirs. All receivers' alike.
    """

    epoch_s: float
    first: Sequence[int]
    second: Sequence[int]
    first_at: Array
    second_at: Array
    rd: Array
    covariance: Array
    position_m: float = 0.0

    def where(self, kept: Mask) -> Rows:
        """Those of the rows that a mask (K,) keeps."""
        picked = np.flatnonzero(kept).tolist()
        return Rows(
            self.epoch_s,
            [self.first[k] for k in picked],
            [self.second[k] for k in picked],
            self.first_at[picked],
            self.second_at[picked],
            self.rd[picked],
            self.covariance[np.ix_(picked, picked)],
            self.position_m,
        )


def star(
    epoch_s: float,
    reference: int,
    reference_at: Array,
    companions: Sequence[int],
    companions_at: Array,
    rd: Array,
    covariance: Array,
    position_m: float = 0.0,
) -> Rows:
    """The rows of RDs that share one reference.

    Args:
        epoch_s: s.
        reference: Its id.
        reference_at: (d,), m.
        companions: Ids, N of them.
        companions_at: (N, d), m.
        rd: (N,), m.
        covariance: (N, N), m².
        position_m: As of :class:`Rows`.
    """
    n = len(companions)
    at = np.broadcast_to(reference_at, (n, reference_at.shape[-1]))
    first = [reference] * n
    return Rows(epoch_s, first, companions, at, companions_at, rd, covariance, position_m)
