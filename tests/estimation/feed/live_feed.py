"""A small swarm that flies by an emitter, and the live feed of it."""

from __future__ import annotations

import numpy as np

from swarmctl.estimation.estimate import Estimate
from swarmctl.estimation.feed.measurement_queue import MeasurementQueue
from swarmctl.estimation.filters import FILTERS
from swarmctl.estimation.kernels import ncrkf
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.range_difference import (
    effective_covariance,
    jacobian,
    range_differences,
    rd_covariance,
)
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.estimation.track.track import Track

EPOCH = 1_790_000_000.0
MEAN = np.array([30.0, -40.0, 0.0, 0.5, -0.5, 0.0])
COVARIANCE = np.diag([200.0, 200.0, 1.0, 1.5, 1.5, 0.01]) ** 2
PSD = np.array([4e-4, 4e-4, 0.0])
VELOCITY = (8.0, 3.0, 0.0)
START = {
    1: (-1500.0, 0.0, 60.0),
    2: (-1500.0, 285.0, 75.0),
    3: (-1500.0, -285.0, 90.0),
    4: (-1785.0, 0.0, 105.0),
}
EMITTER, DRIFT = np.array([0.0, 0.0, 0.0]), np.array([0.8, -0.3, 0.0])


class Live(MeasurementQueue):
    """A queue with the track that it feeds at hand."""

    def __init__(self, track: Track, **assumed: float) -> None:
        self.track = track
        super().__init__(track, vehicles=START, **({"sigma_p_m": 0.5} | assumed))

    @property
    def epoch_s(self) -> float | None:
        """Epoch of the track; None before the first measurement."""
        return self.track.epoch_s if self.track.is_begun else None

    def state_at(self, epoch_s: float) -> tuple[np.ndarray, np.ndarray]:
        """What is believed at an epoch."""
        believed = self.track.believed_at(epoch_s)
        return believed.x, believed.P


def linear_track(covariance: np.ndarray = COVARIANCE) -> Track:
    """By the filter whose update :func:`by_hand` repeats."""
    return FILTERS.track("ncrkf", Prior(MEAN, covariance), Behaviour(PSD.tolist()))


def live_feed(covariance: np.ndarray = COVARIANCE, **assumed: float) -> Live:
    """A feed and its track, before any measurement."""
    return Live(linear_track(covariance), **assumed)


def where(vehicle: int, t: float) -> tuple[float, float, float]:
    """Position of a vehicle t seconds after EPOCH."""
    x, y, z = START[vehicle]
    return (x + VELOCITY[0] * t, y + VELOCITY[1] * t, z)


def report(to: Live, t: float, vehicles: tuple[int, ...] = (1, 2, 3, 4)) -> None:
    """Positions of the vehicles at one instant."""
    for vehicle in vehicles:
        to.add_position(vehicle, EPOCH + t, where(vehicle, t), VELOCITY)


def heard(
    t: float, reference: int = 1, receivers: tuple[int, ...] = (2, 3, 4), seed: int = 0
) -> list[float]:
    """Noisy range differences, the same whenever asked for."""
    rng = np.random.default_rng([round(1000 * t), seed])
    companions = np.array([where(v, t) for v in receivers])
    rd = range_differences(EMITTER + DRIFT * t, np.array(where(reference, t)), companions)
    return [float(r) for r in rd + rng.normal(0.0, 2.0, len(receivers))]


def hear(to: Live, t: float, reference: int = 1, receivers: tuple[int, ...] = (2, 3, 4)) -> None:
    """Range differences of one epoch, in one call."""
    rd = heard(t, reference, receivers)
    to.add_range_differences(EPOCH + t, reference, receivers, rd, [3.0] * len(rd), 0.5)


def nis_by_hand(x: np.ndarray, P: np.ndarray, t: float, rd: list[float]) -> float:
    """Of the innovation linearised at the prediction."""
    reference, companions = np.array(where(1, t)), np.array([where(v, t) for v in (2, 3, 4)])
    nu = np.array(rd) - range_differences(x[:3], reference, companions)
    H = jacobian(x[:3], reference, companions)
    S = H @ P[:3, :3] @ H.T + effective_covariance(rd_covariance([3.0] * 3, 0.5), 0.5)
    return float(nu @ np.linalg.solve(S, nu))


def by_hand(x: np.ndarray, P: np.ndarray, t: float, rd: list[float]) -> ncrkf.Update:
    """The update a track with exact positions must make."""
    return ncrkf.update(
        x,
        P,
        np.array(where(1, t)),
        np.array([where(v, t) for v in (2, 3, 4)]),
        np.array(rd),
        rd_covariance([3.0] * 3, 0.5),
        0.5,
    )


def assert_same_track(found: Live, expected: Live, tolerance: float = 1e-7) -> None:
    """States equal to a fraction of their standard deviation."""
    assert found.epoch_s is not None
    assert found.epoch_s == expected.epoch_s
    x, P = found.state_at(found.epoch_s)
    y, Q = expected.state_at(found.epoch_s)
    sigma = np.sqrt(np.diag(Q))
    assert np.abs((x - y) / sigma).max() < tolerance
    assert np.abs((P - Q) / np.outer(sigma, sigma)).max() < tolerance


def run(to: Live, last: float, period: float = 0.1) -> list[Estimate]:
    """Everything on time up to ``last`` seconds."""
    updates = []
    for k in range(round(last / period) + 1):
        report(to, k * period)
        hear(to, k * period)
        updates += to.process()
    return updates
