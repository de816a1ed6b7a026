"""The (iterated) extended Kalman filter on range differences: the baseline, not our filter.

With one iteration it is the EKF of the paper's Table 1; with more, a Gauss-Newton search for
the most probable state (Bell, Cathey, "The iterated Kalman filter update as a Gauss-Newton
method", IEEE Trans. Automatic Control 38(2), 1993). Accurate near the truth; from a start that
is off by a tenth of the range it may settle anywhere.
"""

from __future__ import annotations

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.model.range_difference import jacobian, range_differences
from swarmctl.units import Array, Mask

_SETTLED = 1e-3
"""A trial's iteration ends once a step is below this many prior sigmas in every state."""


def update(
    x: Array,
    P: Array,
    reference: Array,
    companions: Array,
    rd: Array,
    covariance: Array,
    iterations: int = 1,
) -> tuple[Array, Array]:
    """One measurement update.

    Args:
        x: Predicted state, (..., n), the emitter's position in d axes first, m.
        P: Its covariance, (..., n, n).
        reference: Position of the reference UAV, (..., d), m.
        companions: Positions of the companions, (..., N, d), m.
        rd: Measured range differences, (..., N), m.
        covariance: That of the RDs about those computed at the given positions, (..., N, N), m²,
            as from :func:`~swarmctl.estimation.model.range_difference.effective_covariance`.
        iterations: At most so many linearisations, >= 1.

    Returns:
        Updated x and P.

    Raises:
        EstimationError: iterations is below 1, or the update is singular.
    """
    if iterations < 1:
        raise EstimationError(f"iterations must be at least 1, not {iterations}.")
    d = reference.shape[-1]
    settled = _SETTLED * np.sqrt(np.linalg.diagonal(P))
    moving: Mask = np.ones(x.shape[:-1], dtype=np.bool_)
    found, P_found = x, P
    for _ in range(iterations):
        emitter = found[..., :d]
        J = jacobian(emitter, reference, companions)
        innovation = rd - range_differences(emitter, reference, companions)
        innovation = innovation - np.matvec(J, x[..., :d] - emitter)
        Jt = J.mT.copy()  # in order in memory: twice as fast
        JP = J @ P[..., :d, :]
        try:
            gain = np.linalg.solve(JP[..., :d] @ Jt + covariance, JP).mT
        except np.linalg.LinAlgError:
            raise EstimationError("The update is singular: P is not a covariance.") from None
        proposed = x + np.matvec(gain, innovation)
        narrowed = P - gain @ JP
        if iterations == 1:
            return proposed, 0.5 * (narrowed + narrowed.mT)
        step = np.abs(proposed - found)
        found = np.where(moving[..., None], proposed, found)
        P_found = np.where(moving[..., None, None], narrowed, P_found)
        moving = moving & (step > settled).any(-1)
        if not moving.any():
            break
    return found, 0.5 * (P_found + P_found.mT)
