"""Whole filters: how they start, step and answer, and what must not matter to them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmctl.errors import EstimationError
from swarmctl.estimation.bounds.consistency import mean_bounds
from swarmctl.estimation.kernels import ncrkf as ncrkf_kernel
from swarmctl.estimation.model.motion import ConstantAcceleration, ConstantVelocity
from swarmctl.estimation.model.range_difference import (
    effective_covariance,
    effective_relative_covariance,
    jacobian,
    range_differences,
    rd_covariance,
)
from swarmctl.study import ekf_update as ekf_kernel
from swarmctl.study import paper_filters
from swarmctl.study.batch_filter import (
    BatchEstimate,
    BatchFilter,
    Belief,
    RelativePrior,
    Scan,
    Truth,
)
from swarmctl.study.filter_coordinates import CoordinatesName
from swarmctl.study.filterpy_filter import filterpy_ekf
from swarmctl.study.filters import ekf, iterated_ekf, ncrkf, okf
from swarmctl.units import Array
from tests.estimation.scenarios import table_1

STATES: tuple[CoordinatesName, ...] = ("absolute", "relative", "accelerated")


def all_filters(d: int) -> dict[str, BatchFilter]:
    """Every filter, for d axes."""
    noise = (0.04,) * d
    return {
        "ncrkf, paper": ncrkf("paper"),
        "okf": okf(),
        "ekf": ekf(),
        "once linearised": iterated_ekf(1, process_noise=noise),
        "filterpy": filterpy_ekf(noise),
        **{f"ncrkf, {s}": ncrkf(state=s, process_noise=noise) for s in STATES},
        **{f"iterated ekf, {s}": iterated_ekf(state=s, process_noise=noise) for s in STATES},
    }


NAMES = list(all_filters(2))


class Flight(NamedTuple):
    """A prior and a few scans."""

    prior: RelativePrior
    scans: list[Scan]


DIRECTIONS = [
    [0.0, 1.0, 0.2],
    [0.0, -1.0, 0.3],
    [-1.0, 0.0, -0.2],
    [0.1, 0.5, 0.9],
    [0.2, -0.6, -0.8],
    [-0.7, 0.7, 0.1],
]
"""Of the companions: wide across the line of sight, or the paper's filter has no covariance."""


def some_flight(seed: int, d: int, n: int, *batch: int) -> Flight:
    """Three scans, 0.5 s apart, of an emitter known to 100 m, by a swarm 2 km away."""
    rng = np.random.default_rng(seed)
    size = 3 * (d + 1)
    sigma = np.repeat([100.0, 5.0, 1.0], d + 1)
    root = sigma[:, None] * (np.eye(size) + 0.1 * rng.standard_normal((size, size)))
    e, own = np.zeros(d), 40.0 * rng.standard_normal(d)
    p_0 = 30.0 * rng.standard_normal(d)
    p_0[0] -= 2000.0
    mean = np.zeros(size)
    mean[:d], mean[d], mean[d + 1 : 2 * d + 1] = e - p_0, np.linalg.norm(e - p_0), -own
    mean = mean + rng.standard_normal((*batch, size)) @ root.T
    prior = RelativePrior(mean, root @ root.T, np.concatenate([p_0, own]))
    Cr = rd_covariance(rng.uniform(0.5, 1.5, n), 0.5)
    offsets = 400.0 * (np.array(DIRECTIONS)[:n, :d] + 0.1 * rng.standard_normal((n, d)))
    scans = []
    for dt in (0.0, 0.5, 0.5):
        p_0 = p_0 + dt * own
        scans.append(scan_of(rng, dt, e, p_0, own, p_0 + offsets, Cr, 0.5, *batch))
    return Flight(prior, scans)


def scan_of(
    rng: np.random.Generator,
    dt: float,
    e: Array,
    p_0: Array,
    own: Array,
    p: Array,
    Cr: Array,
    sigma_p: float,
    *batch: int,
) -> Scan:
    """What is measured, with noise, in each trial of the batch."""
    rd = range_differences(e, p_0, p)
    return Scan(
        dt,
        p_0 + sigma_p * rng.standard_normal((*batch, *p_0.shape)),
        own,
        p + sigma_p * rng.standard_normal((*batch, *p.shape)),
        rd + rng.standard_normal((*batch, *rd.shape)) @ np.linalg.cholesky(Cr).T,
        Cr,
        sigma_p,
        Truth(p - p_0, rd),
    )


def run(tracker: BatchFilter, flight: Flight) -> list[BatchEstimate]:
    """The answers after each scan."""
    belief, tracks = tracker.start(flight.prior), []
    for scan in flight.scans:
        belief = tracker.step(belief, scan)
        tracks.append(tracker.estimate(belief, scan))
    return tracks


def assert_same(
    found: BatchEstimate, expected: BatchEstimate, sigma: Array, tolerance: float
) -> None:
    """Alike to ``tolerance`` on the scale of ``sigma``."""
    assert np.abs((found.x - expected.x) / sigma).max() < tolerance
    assert np.abs((found.P - expected.P) / np.outer(sigma, sigma)).max() < tolerance


def prior_sigma(prior: RelativePrior) -> Array:
    """Of position and velocity, one per kind."""
    d = prior.reference.shape[-1] // 2
    return np.repeat(np.sqrt(np.diag(prior.covariance)[[0, d + 1]]), d)


# --- Start and answer ------------------------------------------------------------------


def test_each_state_takes_its_own_of_the_prior_and_gives_it_back() -> None:
    """Before any scan, the answer is the prior: absolute, or relative to the reference UAV."""
    rng = np.random.default_rng(1)
    root = rng.standard_normal((9, 9))
    prior = RelativePrior(
        rng.normal(0.0, 100.0, (4, 9)), root @ root.T, np.array([7.0, -8.0, 0.5, 2.0])
    )
    p, v, a = prior.mean[:, 0:2], prior.mean[:, 3:5], prior.mean[:, 6:8]
    p_0, v_0 = prior.reference[:2], prior.reference[2:]
    kept = prior.mean.copy()
    expected: list[tuple[BatchFilter, bool, list[Array]]] = [
        (ncrkf(), False, [p + p_0, v + v_0]),
        (iterated_ekf(), False, [p + p_0, v + v_0]),
        (ncrkf(state="relative"), True, [p, v + v_0]),
        (ncrkf(state="accelerated"), True, [p, v, a]),
        (ekf(), True, [p, v, a]),
        (ncrkf("paper"), True, [prior.mean]),
        (okf(), True, [prior.mean]),
    ]
    scan = some_flight(2, 2, 3).scans[0]._replace(velocity=v_0)
    for tracker, relative, parts in expected:
        belief = tracker.start(prior)
        np.testing.assert_array_equal(belief.x, np.concatenate(parts, axis=-1))
        picked = [[0, 1, 3, 4], [0, 1, 3, 4, 6, 7], [*range(9)]][(belief.x.shape[-1] - 4) // 2]
        assert belief.P.shape == (4, len(picked), len(picked))
        np.testing.assert_array_equal(belief.P[3], prior.covariance[np.ix_(picked, picked)])

        assert tracker.relative is relative
        track = tracker.estimate(belief, scan)
        answer = [p, v] if relative else [p + p_0, v + v_0]
        np.testing.assert_allclose(track.x, np.concatenate(answer, axis=-1), rtol=1e-12)
        np.testing.assert_array_equal(
            track.P[1], prior.covariance[np.ix_([0, 1, 3, 4], [0, 1, 3, 4])]
        )
    np.testing.assert_array_equal(prior.mean, kept)


# --- A step ----------------------------------------------------------------------------


def paper_s(x: Array, P: Array, scan: Scan) -> tuple[Array, Array]:
    m = scan.companions - scan.reference
    return paper_filters.ncrkf_update(x, P, m, scan.rd, np.diag(scan.rd_covariance), scan.sigma_p)


def optimal(x: Array, P: Array, scan: Scan) -> tuple[Array, Array]:
    m, variance = scan.companions - scan.reference, np.diag(scan.rd_covariance)
    return paper_filters.okf_update(
        x, P, scan.truth.baselines, scan.truth.rd, m, scan.rd, variance, scan.sigma_p
    )


def table_1_s(x: Array, P: Array, scan: Scan) -> tuple[Array, Array]:
    R = np.diag(np.diag(scan.rd_covariance))
    return ekf_kernel.update(
        x, P, 0.0 * scan.reference, scan.companions - scan.reference, scan.rd, R
    )


def absolute(x: Array, P: Array, scan: Scan) -> tuple[Array, Array]:
    at = (scan.reference, scan.companions, scan.rd, scan.rd_covariance)
    return ncrkf_kernel.update(x, P, *at, scan.sigma_p)[:2]


def relative(x: Array, P: Array, scan: Scan) -> tuple[Array, Array]:
    m = scan.companions - scan.reference
    C = effective_relative_covariance(scan.rd_covariance, scan.sigma_p, x[:2], m)
    return ncrkf_kernel.update(x, P, 0.0 * scan.reference, m, scan.rd, C, 0.0)[:2]


def iterated(x: Array, P: Array, scan: Scan) -> tuple[Array, Array]:
    C = effective_covariance(scan.rd_covariance, scan.sigma_p)
    return ekf_kernel.update(x, P, scan.reference, scan.companions, scan.rd, C, 4)


def once_linearised(x: Array, P: Array, scan: Scan) -> tuple[Array, Array]:
    C = effective_covariance(scan.rd_covariance, scan.sigma_p)
    return ekf_kernel.update(x, P, scan.reference, scan.companions, scan.rd, C)


VELOCITY, ACCELERATION = ConstantVelocity((0.04, 0.09)), ConstantAcceleration((0.04, 0.09))
JUMP = 0.1**2


@pytest.mark.parametrize(
    ("tracker", "model", "own_motion", "update"),
    [
        (ncrkf("paper"), ConstantAcceleration((JUMP, JUMP, 2 * JUMP)), False, paper_s),
        (okf(), ConstantAcceleration((JUMP, JUMP, 2 * JUMP)), False, optimal),
        (ekf(), ConstantAcceleration((JUMP, JUMP)), False, table_1_s),
        (ncrkf(process_noise=(0.04, 0.09)), VELOCITY, False, absolute),
        (ncrkf(process_noise=(0.04, 0.09), state="relative"), VELOCITY, True, relative),
        (ncrkf(process_noise=(0.04, 0.09), state="accelerated"), ACCELERATION, False, relative),
        (iterated_ekf(4, process_noise=(0.04, 0.09)), VELOCITY, False, iterated),
        (filterpy_ekf((0.04, 0.09)), VELOCITY, False, once_linearised),
    ],
)
def test_a_step_is_the_model_s_prediction_and_the_update(
    tracker: BatchFilter,
    model: ConstantVelocity | ConstantAcceleration,
    own_motion: bool,
    update: Callable[[Array, Array, Scan], tuple[Array, Array]],
) -> None:
    """At dt = 0 the update alone: a jump per step would show in the covariance."""
    flight = some_flight(3, 2, 4)
    belief = tracker.start(flight.prior)
    for scan in flight.scans:
        x, P = belief.x, belief.P
        if scan.dt > 0.0:
            F, Q = model.step(scan.dt)
            x, P = F @ x, F @ P @ F.T + Q
        if own_motion:
            x = x - np.concatenate([scan.dt * scan.velocity, 0.0 * scan.velocity])
        x, P = update(x, P, scan)
        belief = tracker.step(belief, scan)
        sigma = np.sqrt(np.diag(P))
        assert_same(BatchEstimate(belief.x, belief.P), BatchEstimate(x, P), sigma, 1e-9)


def test_the_guard_s_firing_is_told() -> None:
    """As in test_ncrkf: a wave without curvature, and a prior that knows no range."""
    angles = np.linspace(0.6, 2.6, 12)
    m = 300.0 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    Cr = rd_covariance(np.full(12, 3.0), 0.5)
    rd = -m[:, 0]
    scan = Scan(0.0, np.zeros(2), np.zeros(2), m, rd, Cr, 0.5, Truth(m, rd))
    mean = np.array([5000.0, *[0.0] * 8])
    for spread, fires in ((8000.0, True), (500.0, False)):
        prior = RelativePrior(mean, np.diag([spread**2] * 3 + [1.0] * 6), np.zeros(4))
        for state in STATES:
            tracker = ncrkf(state=state)
            assert tracker.step(tracker.start(prior), scan).guarded == fires


@pytest.mark.parametrize("name", NAMES)
def test_a_batch_is_a_loop(name: str) -> None:
    tracker = all_filters(3)[name]
    flight = some_flight(4, 3, 4, 3, 2)
    sigma = prior_sigma(flight.prior)
    batch = run(tracker, flight)
    for i in np.ndindex(3, 2):
        scans = [
            s._replace(reference=s.reference[i], companions=s.companions[i], rd=s.rd[i])
            for s in flight.scans
        ]
        one = run(tracker, Flight(flight.prior._replace(mean=flight.prior.mean[i]), scans))
        for of_batch, expected in zip(batch, one, strict=True):
            assert_same(BatchEstimate(of_batch.x[i], of_batch.P[i]), expected, sigma, 1e-9)


# --- What must not matter --------------------------------------------------------------

seeds = st.integers(0, 2**32 - 1)


def turned(flight: Flight, turn: Array, shift: Array) -> Flight:
    d = shift.size
    with_range = np.eye(d + 1)
    with_range[:d, :d] = turn
    T = np.kron(np.eye(3), with_range)
    mean, covariance, reference = flight.prior
    p_0, v_0 = reference[:d], reference[d:]
    prior = RelativePrior(
        T @ mean, T @ covariance @ T.T, np.concatenate([turn @ p_0 + shift, turn @ v_0])
    )
    scans = [
        s._replace(
            reference=turn @ s.reference + shift,
            velocity=turn @ s.velocity,
            companions=s.companions @ turn.T + shift,
            truth=Truth(s.truth.baselines @ turn.T, s.truth.rd),
        )
        for s in flight.scans
    ]
    return Flight(prior, scans)


@settings(max_examples=40, deadline=None)
@given(seed=seeds, d=st.sampled_from([2, 3]), n=st.integers(4, 6))
def test_where_north_is_and_the_origin_do_not_matter(seed: int, d: int, n: int) -> None:
    here = some_flight(seed, d, n)
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.standard_normal((d, d)))[0]
    shift = rng.normal(0.0, 3000.0, d)
    there = turned(here, turn, shift)
    both = np.kron(np.eye(2), turn)
    sigma = prior_sigma(here.prior)
    for name, tracker in all_filters(d).items():
        # An iterated EKF ends once its step is below 1e-3 prior sigmas in each axis: where the
        # axes are decides whether it makes one more. At worst in all 2 d axes, at all 3 scans.
        tolerance = 3 * 2 * d * 1e-3 if name.startswith("iterated") else 1e-5
        offset = np.zeros(2 * d)
        if not tracker.relative:
            offset[:d] = shift
        for a, b in zip(run(tracker, here), run(tracker, there), strict=True):
            back = BatchEstimate(both.T @ (b.x - offset), both.T @ b.P @ both)
            assert_same(back, a, sigma, tolerance)


@settings(max_examples=40, deadline=None)
@given(seed=seeds, n=st.integers(4, 6))
def test_the_companions_names_do_not_matter(seed: int, n: int) -> None:
    here = some_flight(seed, 3, n)
    order = np.random.default_rng(seed).permutation(n)
    scans = [
        s._replace(
            companions=s.companions[order],
            rd=s.rd[order],
            rd_covariance=s.rd_covariance[np.ix_(order, order)],
            truth=Truth(s.truth.baselines[order], s.truth.rd[order]),
        )
        for s in here.scans
    ]
    for tracker in all_filters(3).values():
        there = run(tracker, here._replace(scans=scans))
        for a, b in zip(run(tracker, here), there, strict=True):
            assert_same(b, a, prior_sigma(here.prior), 1e-5)


# --- Absolute and relative -------------------------------------------------------------


def table_1_flight(seed: int, runs: int, sigma_p: float) -> Flight:
    """The first 2 s of Table 1 in so many runs, own motion known."""
    rng, truth = np.random.default_rng(seed), table_1()
    Cr = rd_covariance(np.full(3, 0.5), 0.0)
    own = np.diff(truth.reference, axis=0) / 0.02
    own = np.concatenate([own[:1], own])
    covariance = np.diag([100.0, 100.0, 141.0, 30.0, 30.0, 42.0, 10.0, 10.0, 14.0]) ** 2 / 9.0
    mean = np.zeros(9)
    mean[:2], mean[3:5] = -truth.reference[0], truth.emitter[0, 2:] - own[0]
    mean = mean + rng.standard_normal((runs, 9)) @ np.sqrt(covariance)
    scans = []
    for k in range(100):
        e, p_0, p = truth.emitter[k, :2], truth.reference[k], truth.companions[k]
        scans.append(scan_of(rng, 0.02 if k else 0.0, e, p_0, own[k], p, Cr, sigma_p, runs))
    return Flight(
        RelativePrior(mean, covariance, np.concatenate([truth.reference[0], own[0]])), scans
    )


def on_the_map(track: BatchEstimate, reference: Array, own: Array) -> Array:
    """A relative answer, made absolute by where the reference UAV truly is."""
    x = track.x.copy()
    x[..., :2] += reference
    x[..., 2:] += own
    return x


BOTH_WAYS = [
    (ncrkf(state="absolute"), ncrkf(state="relative")),
    (iterated_ekf(state="absolute"), iterated_ekf(state="relative")),
]


@pytest.mark.parametrize(("absolute", "relative"), BOTH_WAYS)
def test_absolute_and_relative_are_one_filter_where_positions_are_exact(
    absolute: BatchFilter, relative: BatchFilter
) -> None:
    flight = table_1_flight(5, 4, 0.0)
    for scan, a, b in zip(flight.scans, run(absolute, flight), run(relative, flight), strict=True):
        x = on_the_map(b, scan.reference, scan.velocity)
        for i in range(4):
            sigma = np.sqrt(np.diag(a.P[i]))
            assert_same(BatchEstimate(x[i], b.P[i]), BatchEstimate(a.x[i], a.P[i]), sigma, 1e-9)


@pytest.mark.parametrize(("absolute", "relative"), BOTH_WAYS)
def test_absolute_and_relative_agree_far_within_their_sigma(
    absolute: BatchFilter, relative: BatchFilter
) -> None:
    """The RDs computed by the two differ by J dp_0, J the Jacobian: little beside the noise.

    If the covariance of J dp_0 is at most lambda times that of the RDs, the covariance of the
    estimates' difference is at most lambda times theirs: lambda is 0.4 % in this geometry.
    (The weights differ by sigma_p² (1 - u_iᵀ u_j), 0.4 % of the noise; squared, nothing.)
    """
    runs, sigma_p, truth = 60, 0.5, table_1()
    flight = table_1_flight(6, runs, sigma_p)
    C = effective_covariance(flight.scans[0].rd_covariance, sigma_p)
    J = jacobian(truth.emitter[99, :2], truth.reference[99], truth.companions[99])
    largest = np.linalg.eigvals(np.linalg.solve(C, sigma_p**2 * J @ J.T)).real.max()
    assert largest < 0.005
    a, b = run(absolute, flight)[-1], run(relative, flight)[-1]
    apart = on_the_map(b, truth.reference[99], flight.scans[99].velocity) - a.x
    squared = np.vecdot(apart, np.linalg.solve(a.P, apart[..., None])[..., 0])
    assert squared.mean() < largest * mean_bounds(4, runs, 0.9999)[1]


# --- To add one, and wrong arguments ---------------------------------------------------


class Dead:
    """Dead reckoning: a user's own filter, which inherits nothing."""

    relative = False

    def start(self, prior: RelativePrior) -> Belief:
        d = prior.reference.shape[-1] // 2
        p, v = prior.mean[..., :d], prior.mean[..., d + 1 : 2 * d + 1]
        x = np.concatenate([p, v], axis=-1) + prior.reference
        return Belief(x, np.broadcast_to(np.eye(2 * d), (*x.shape, 2 * d)))

    def step(self, belief: Belief, scan: Scan) -> Belief:
        F, _ = ConstantVelocity((0.0,) * scan.reference.shape[-1]).step(scan.dt)
        return Belief(belief.x @ F.T, F @ belief.P @ F.T)

    def estimate(self, belief: Belief, scan: Scan) -> BatchEstimate:
        return BatchEstimate(belief.x, belief.P)


def test_a_filter_of_one_s_own_inherits_nothing() -> None:
    """That it is a BatchFilter, mypy says."""
    flight = some_flight(7, 3, 4, 5)
    own: BatchFilter = Dead()
    x = run(own, flight)[-1].x
    start = own.start(flight.prior).x
    np.testing.assert_allclose(x[:, :3], start[:, :3] + 1.0 * start[:, 3:], rtol=1e-12)


def test_wrong_arguments_are_named() -> None:
    unknown: Any = "best"
    with pytest.raises(EstimationError, match="variant must be"):
        ncrkf(unknown)
    with pytest.raises(EstimationError, match="state must be"):
        ncrkf(state=unknown)
    with pytest.raises(EstimationError, match="state must be"):
        iterated_ekf(state=unknown)
    with pytest.raises(EstimationError, match="iterations must be at least 1"):
        iterated_ekf(0)
    with pytest.raises(EstimationError, match="process noise must be"):
        ncrkf(process_noise=(0.1, -0.1))
    with pytest.raises(EstimationError, match="variance must be"):
        iterated_ekf(state="accelerated", process_noise=(0.1, -0.1))
    prior = some_flight(8, 3, 4).prior
    with pytest.raises(EstimationError, match="process_noise must have 3 entries"):
        ncrkf(process_noise=(0.1, 0.1)).start(prior)


@pytest.mark.parametrize("name", NAMES)
def test_a_prior_that_cannot_be_one_is_named(name: str) -> None:
    tracker, prior = all_filters(2)[name], some_flight(8, 2, 3).prior
    indefinite = prior.covariance.copy()
    indefinite[0, 0] = -1.0
    for change, message in (
        ({"mean": prior.mean * np.nan}, r"prior\.mean must be finite"),
        ({"mean": prior.mean[:6]}, r"prior\.mean must have shape"),
        ({"covariance": indefinite}, r"prior\.covariance must be positive definite"),
        ({"covariance": np.eye(4)}, r"prior\.covariance must have shape"),
    ):
        with pytest.raises(EstimationError, match=message):
            tracker.start(prior._replace(**change))
