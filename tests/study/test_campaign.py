"""A campaign: the same draws for all, the same result wherever it is flown, sound bounds."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
import pytest

from swarmctl.errors import EstimationError, UsageError
from swarmctl.estimation.bounds.pcrb import pcrb
from swarmctl.estimation.model.motion import ConstantAcceleration, ConstantVelocity, transition
from swarmctl.estimation.model.range_difference import effective_relative_covariance, jacobian
from swarmctl.study import campaign as campaign_module
from swarmctl.study.batch_filter import BatchEstimate, BatchFilter, Belief, RelativePrior, Scan
from swarmctl.study.campaign import CHUNK, Campaign, FormationResult, run_campaign
from swarmctl.study.engagement import Engagement, fly, prior_at, relative_state
from swarmctl.study.executors import executing
from swarmctl.study.filters import iterated_ekf
from swarmctl.study.registry import standard_registry
from swarmctl.study.starts import (
    CA,
    CV,
    JUMP,
    Draw,
    DrawnEstimate,
    DrawnTruth,
    RangeIgnorant,
    Start,
    table_1_covariance,
)
from swarmctl.study.tally import BoundTally, Tally
from swarmctl.units import Array

FORMATIONS = standard_registry().formations()
SHORT = Engagement(duration_s=0.1, rho=0.5)
"""Six epochs."""


class Dead:
    """Dead reckoning, as a user writes it. It keeps what it sees."""

    relative = False

    def __init__(self) -> None:
        self.priors: list[RelativePrior] = []
        self.scans: list[Scan] = []
        self.tracks: list[BatchEstimate] = []

    def start(self, prior: RelativePrior) -> Belief:
        self.priors.append(prior)
        x = prior.mean[..., CV] + prior.reference
        return Belief(x, np.broadcast_to(prior.covariance[np.ix_(CV, CV)], (*x.shape, 4)))

    def step(self, belief: Belief, scan: Scan) -> Belief:
        self.scans.append(scan)
        F = transition(scan.dt, 2)
        return Belief(belief.x @ F.T, F @ belief.P @ F.T)

    def estimate(self, belief: Belief, scan: Scan) -> BatchEstimate:
        self.tracks.append(BatchEstimate(belief.x, belief.P))
        return self.tracks[-1]


def assert_same(found: dict[str, FormationResult], expected: dict[str, FormationResult]) -> None:
    """To the last bit, and in the same order."""
    assert list(found) == list(expected)
    for name, result in expected.items():
        assert list(found[name].tallies) == list(result.tallies)
        for candidate, tally in result.tallies.items():
            assert_same_sums(found[name].tallies[candidate], tally)
        assert_same_sums(found[name].cv_bound, result.cv_bound)
        assert_same_sums(found[name].ca_bound, result.ca_bound)


def assert_same_sums(found: Tally | BoundTally, expected: Tally | BoundTally) -> None:
    for each in fields(expected):
        np.testing.assert_array_equal(
            getattr(found, each.name), getattr(expected, each.name), err_msg=each.name
        )


def tally_of(tracks: list[BatchEstimate], truth: list[Array]) -> Tally:
    """One tally of all runs at once, ``truth`` (4,) or (runs, 4) at each epoch."""
    error = np.stack([track.x - at for track, at in zip(tracks, truth, strict=True)])
    P = np.stack([track.P for track in tracks])
    return Tally.of(error, np.linalg.diagonal(P), P[..., 0, 1], np.zeros(len(tracks)))


def truth_of(engagement: Engagement, emitter: Array) -> list[Array]:
    return [m.emitter for m in fly(engagement, FORMATIONS["uniform"], emitter)]


# --- Wherever it is flown --------------------------------------------------------------


@pytest.fixture(scope="module")
def matched() -> Campaign:
    """All filters, both formations, three chunks."""
    noise = (0.01, 0.01)
    return Campaign(
        DrawnTruth(),
        standard_registry().filters(noise),
        FORMATIONS,
        2 * CHUNK + 30,
        3,
        noise,
        SHORT,
    )


@pytest.fixture(scope="module")
def flown_here(matched: Campaign) -> dict[str, FormationResult]:
    return run_campaign(matched)


def test_a_study_is_the_same_on_several_processes(
    matched: Campaign, flown_here: dict[str, FormationResult]
) -> None:
    with executing(workers=2) as executor:
        assert_same(run_campaign(matched, executor), flown_here)


def test_a_study_is_the_same_on_a_dask_cluster(
    matched: Campaign, flown_here: dict[str, FormationResult]
) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=False,
        protocol="tcp",
        dashboard_address=None,
    ) as cluster:
        address = cluster.scheduler_address.replace("tcp://", "dask://")
        assert address.startswith("dask://127.0.0.1:")
        with executing(address=address) as executor:
            assert_same(run_campaign(matched, executor), flown_here)


def test_all_runs_of_all_chunks_are_counted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three chunks, the last one short; the sums are those of all their runs at once."""
    monkeypatch.setattr(campaign_module, "CHUNK", 7)
    dead, told = Dead(), []
    campaign = Campaign(
        DrawnEstimate(), {"dead": dead}, {"uniform": FORMATIONS["uniform"]}, 17, 1, engagement=SHORT
    )
    assert campaign.chunks == 3
    result = run_campaign(campaign, on_progress=lambda *done: told.append(done))["uniform"]
    assert told == [(7, 17), (14, 17), (17, 17)]

    assert [len(prior.mean) for prior in dead.priors] == [7, 7, 3]
    means = np.concatenate([prior.mean for prior in dead.priors])
    assert len(np.unique(means[:, 0])) == 17  # no chunk is drawn twice
    epochs = len(SHORT.epochs_s)
    chunks = [dead.tracks[i : i + epochs] for i in range(0, 3 * epochs, epochs)]
    whole = [
        BatchEstimate(*(np.concatenate(part) for part in zip(*tracks, strict=True)))
        for tracks in zip(*chunks, strict=True)
    ]
    expected = tally_of(whole, truth_of(SHORT, SHORT.emitter))
    for each in fields(Tally):
        np.testing.assert_allclose(
            getattr(result.tallies["dead"], each.name), getattr(expected, each.name), rtol=1e-12
        )


@pytest.mark.parametrize("start", [DrawnEstimate(), DrawnTruth()], ids=repr)
def test_what_is_kept_does_not_grow_with_the_runs(
    start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(campaign_module, "CHUNK", 5)

    def sizes(runs: int) -> list[int]:
        filters = {"iterated": iterated_ekf()}
        result = run_campaign(Campaign(start, filters, FORMATIONS, runs, 1, (0.1, 0.1), SHORT))
        kept: list[Tally | BoundTally] = []
        for each in result.values():
            kept += [*each.tallies.values(), each.cv_bound, each.ca_bound]
        return [np.asarray(getattr(sums, f.name)).nbytes for sums in kept for f in fields(sums)]

    assert sizes(40) == sizes(4)


# --- The same draws --------------------------------------------------------------------


def test_every_formation_and_every_filter_meets_the_same_noise() -> None:
    """RDs and positions less what they are without noise; the sums differ by rounding only."""
    one, other = Dead(), Dead()
    campaign = Campaign(
        DrawnEstimate(), {"one": one, "other": other}, FORMATIONS, 5, 1, engagement=SHORT
    )
    run_campaign(campaign)
    epochs = len(SHORT.epochs_s)
    assert len(one.scans) == 2 * epochs
    for mine, yours in zip(one.scans, other.scans, strict=True):
        assert mine is yours
    for first, second in zip(one.scans[:epochs], one.scans[epochs:], strict=True):
        assert not np.array_equal(first.truth.baselines, second.truth.baselines)
        np.testing.assert_array_equal(first.reference, second.reference)
        for a, b in (
            (first.rd - first.truth.rd, second.rd - second.truth.rd),
            (
                first.companions - first.truth.baselines,
                second.companions - second.truth.baselines,
            ),
        ):
            np.testing.assert_allclose(a, b, atol=1e-9)
    of_first, of_second = one.priors
    np.testing.assert_array_equal(of_first.mean, of_second.mean)


def test_the_noise_does_not_depend_on_how_a_run_begins_but_on_the_seed() -> None:
    def noise(start: Start, seed: int) -> Array:
        dead = Dead()
        one = {"uniform": FORMATIONS["uniform"]}
        run_campaign(Campaign(start, {"dead": dead}, one, 4, seed, (0.1, 0.1), SHORT))
        return np.stack([scan.rd - scan.truth.rd for scan in dead.scans])

    expected = noise(DrawnEstimate(), 1)
    for start in (DrawnTruth(), RangeIgnorant()):
        np.testing.assert_allclose(noise(start, 1), expected, atol=1e-9)
    assert np.abs(noise(DrawnEstimate(), 2) - expected).min() > 1e-9
    # No epoch's noise is another's.
    assert len(np.unique(np.round(expected, 9))) == expected.size


# --- Filters ---------------------------------------------------------------------------


def test_a_filter_of_one_s_own_gets_its_tally_beside_the_others() -> None:
    """In 16 s dead reckoning errs by its prior: as sigma + 16 s times that of the velocity."""
    runs = 2000
    engagement = Engagement(period_s=4.0)
    dead, one = Dead(), {"uniform": FORMATIONS["uniform"]}
    campaign = Campaign(DrawnEstimate(), {"dead": dead}, one, runs, 1, engagement=engagement)
    tally = run_campaign(campaign)["uniform"].tallies["dead"]
    P = table_1_covariance()
    variance = P[0, 0] + engagement.epochs_s**2 * P[3, 3]
    np.testing.assert_allclose(tally.claimed[:, 0], np.sqrt(variance), rtol=1e-9)
    # The mean square of ``runs`` errors in two axes, to 4 standard errors.
    far = 4.0 * math.sqrt(2.0 / (2 * runs))
    np.testing.assert_allclose(tally.rmse**2 / (2.0 * variance), 1.0, atol=far)
    np.testing.assert_allclose(tally.mean_nees, 2.0, atol=4.0 * math.sqrt(4.0 / runs))


class Relative(Dead):
    """Dead reckoning told relative to the reference UAV."""

    relative = True

    def estimate(self, belief: Belief, scan: Scan) -> BatchEstimate:
        velocity = np.broadcast_to(scan.velocity, scan.reference.shape)
        return BatchEstimate(
            belief.x - np.concatenate([scan.reference, velocity], axis=-1), belief.P
        )


@pytest.mark.parametrize("start", [DrawnEstimate(), DrawnTruth()], ids=repr)
def test_a_relative_track_is_judged_by_the_relative_truth(start: Start) -> None:
    """Where positions are measured exactly both tracks have the same errors."""
    exact = replace(SHORT, sigma_p_m=0.0)
    filters: dict[str, BatchFilter] = {"relative": Relative(), "absolute": Dead()}
    result = run_campaign(Campaign(start, filters, FORMATIONS, 6, 1, (0.1, 0.1), exact))
    for each in result.values():
        for name in ("error", "square", "nees"):
            relative, absolute = (getattr(each.tallies[f], name) for f in filters)
            np.testing.assert_allclose(relative, absolute, rtol=1e-9)


class Breaking(Dead):
    """As Dead, but run 3 breaks down at the third epoch, run 1 at the fifth."""

    def __init__(self, wrong: float) -> None:
        super().__init__()
        self.given: list[Belief] = []
        self._wrong = wrong

    def step(self, belief: Belief, scan: Scan) -> Belief:
        self.given.append(belief)
        x, P, _ = super().step(belief, scan)
        broken = {3: 3, 5: 1}.get(len(self.scans))
        if broken is not None:
            x[broken] = self._wrong
        return Belief(x, P)


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_a_broken_run_is_lost_and_leaves_the_others_alone(wrong: float) -> None:
    """From then on it is no number, though the filter is given a sound belief in its place."""
    sound, breaking = Dead(), Breaking(wrong)
    one = {"uniform": FORMATIONS["uniform"]}
    filters: dict[str, BatchFilter] = {"breaking": breaking, "sound": sound}
    result = run_campaign(Campaign(DrawnEstimate(), filters, one, 6, 1, engagement=SHORT))[
        "uniform"
    ]
    tracks = [BatchEstimate(track.x.copy(), track.P) for track in sound.tracks]
    for k, run_lost in ((2, 3), (4, 1)):
        for track in tracks[k:]:
            track.x[run_lost] = np.nan
    expected = tally_of(tracks, truth_of(SHORT, SHORT.emitter))
    assert expected.finite.tolist() == [6, 6, 5, 5, 4, 4]
    assert expected.lost.tolist() == [0, 0, 1, 1, 2, 2]
    assert_same_sums(result.tallies["breaking"], expected)
    assert result.tallies["sound"].finite.min() == 6
    assert all(np.isfinite(belief.x).all() for belief in breaking.given)


class Raising(Dead):
    """Fails at the third epoch."""

    def __init__(self, error: Exception) -> None:
        super().__init__()
        self._error = error

    def step(self, belief: Belief, scan: Scan) -> Belief:
        if len(self.scans) == 2:
            raise self._error
        return super().step(belief, scan)


def test_a_slow_filter_flies_the_first_chunk_only() -> None:
    campaign = Campaign(
        DrawnEstimate(),
        {"quick": Dead(), "slow": Dead()},
        {"uniform": FORMATIONS["uniform"]},
        CHUNK + 10,
        1,
        engagement=SHORT,
    )
    every = run_campaign(campaign)["uniform"].tallies
    found = run_campaign(replace(campaign, slow=frozenset({"slow"})))["uniform"].tallies
    assert (found["quick"].runs, found["slow"].runs) == (CHUNK + 10, CHUNK)
    assert_same_sums(found["quick"], every["quick"])
    first = run_campaign(replace(campaign, runs=CHUNK))["uniform"].tallies
    assert_same_sums(found["slow"], first["slow"])


@pytest.mark.parametrize(
    "error",
    [
        EstimationError("P is no covariance."),
        np.linalg.LinAlgError("P is no covariance."),
        ValueError("P is no covariance."),
    ],
)
def test_a_filter_that_fails_is_named(error: Exception) -> None:
    filters: dict[str, BatchFilter] = {"sound": Dead(), "mine": Raising(error)}
    campaign = Campaign(DrawnEstimate(), filters, FORMATIONS, 2, 1, engagement=SHORT)
    with pytest.raises(EstimationError, match=r"mine failed at epoch 2: P is no covariance\."):
        run_campaign(campaign)


class Guarding(Dead):
    """Says of every other run that its guard fired."""

    def step(self, belief: Belief, scan: Scan) -> Belief:
        return super().step(belief, scan)._replace(guarded=np.arange(len(belief.x)) % 2 == 0)


def test_the_guard_s_firings_are_counted_per_epoch() -> None:
    filters: dict[str, BatchFilter] = {"guarding": Guarding(), "plain": Dead()}
    result = run_campaign(Campaign(DrawnEstimate(), filters, FORMATIONS, 7, 1, engagement=SHORT))
    assert result["uniform"].tallies["guarding"].guarded.tolist() == [4.0] * 6
    assert result["uniform"].tallies["plain"].guarded.tolist() == [0.0] * 6


# --- The bounds ------------------------------------------------------------------------


@dataclass(frozen=True)
class Given:
    """Begins with these emitters, (4,) or (runs, 4), undisturbed."""

    emitters: Array

    @staticmethod
    def covariance() -> Array:
        return table_1_covariance()

    def draw(self, engagement: Engagement, rng: np.random.Generator, runs: int) -> Draw:
        mean = np.broadcast_to(relative_state(engagement, self.emitters), (runs, 9))
        return Draw(prior_at(mean, self.covariance(), engagement), self.emitters, disturbed=False)


NOISE = (0.3, 0.7)
BOUNDED = replace(SHORT, duration_s=0.4)


def cv_bound(emitter: Array) -> Array:
    """By :func:`pcrb`, diagonal, (K, ..., 4)."""
    moments = list(fly(BOUNDED, FORMATIONS["uniform"], emitter))
    history = pcrb(
        table_1_covariance()[np.ix_(CV, CV)],
        ConstantVelocity(NOISE),
        BOUNDED.epochs_s,
        [m.emitter[..., :2] for m in moments],
        [m.reference for m in moments],
        [m.companions for m in moments],
        BOUNDED.rd_covariance(3),
        BOUNDED.sigma_p_m,
    )
    diagonal: Array = np.linalg.diagonal(history)
    return diagonal


def ca_bound(emitter: Array) -> Array:
    """Fisher's information added up, diagonal of position and velocity, (K, 4)."""
    F, Q = ConstantAcceleration(JUMP).step(BOUNDED.period_s)
    information = np.linalg.inv(table_1_covariance()[np.ix_(CA, CA)])
    history = []
    for k, m in enumerate(fly(BOUNDED, FORMATIONS["uniform"], emitter)):
        if k:
            information = np.linalg.inv(F @ np.linalg.inv(information) @ F.T + Q)
        C = effective_relative_covariance(
            BOUNDED.rd_covariance(3),
            BOUNDED.sigma_p_m,
            m.emitter[:2] - m.reference,
            m.companions - m.reference,
        )
        H = np.zeros((3, 6))
        H[:, :2] = jacobian(m.emitter[:2], m.reference, m.companions)
        information = information + H.T @ np.linalg.solve(C, H)
        history.append(np.diag(np.linalg.inv(information))[:4])
    return np.array(history)


def bounds(emitters: Array, runs: int) -> FormationResult:
    one = {"uniform": FORMATIONS["uniform"]}
    return run_campaign(Campaign(Given(emitters), {}, one, runs, 1, NOISE, BOUNDED))["uniform"]


def test_one_trajectory_has_one_bound_however_many_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign_module, "CHUNK", 2)
    emitter = BOUNDED.emitter
    found = bounds(emitter, 5)
    assert (found.cv_bound.count, found.ca_bound.count) == (1, 1)
    expected = cv_bound(emitter)
    np.testing.assert_allclose(found.cv_bound.standard_deviation**2, expected, rtol=1e-9)
    np.testing.assert_allclose(found.cv_bound.rmse**2, expected[:, :2].sum(-1), rtol=1e-9)
    np.testing.assert_allclose(found.ca_bound.variance, ca_bound(emitter), rtol=1e-6)


def test_drawn_trajectories_have_the_mean_of_their_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Emitters so far apart that no one's bound is another's."""
    rng = np.random.default_rng(1)
    emitters = BOUNDED.emitter + rng.normal(0.0, [500.0, 500.0, 10.0, 10.0], (5, 4))
    found = bounds(emitters, 5)
    assert (found.cv_bound.count, found.ca_bound.count) == (5, 5)
    each = np.stack([cv_bound(emitter) for emitter in emitters])
    assert np.ptp(each[:, -1, 0]) > 0.01 * each[:, -1, 0].mean()
    np.testing.assert_allclose(found.cv_bound.variance / 5, each.mean(0), rtol=1e-9)
    each = np.stack([ca_bound(emitter) for emitter in emitters])
    np.testing.assert_allclose(found.ca_bound.variance / 5, each.mean(0), rtol=1e-6)


# --- Wrong arguments -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda c: replace(c, runs=1), "A study needs at least 2 runs, not 1."),
        (lambda c: replace(c, seed=-1), "A seed must be 0 or more, not -1."),
        (
            lambda c: run_campaign(replace(c, formations={"bad": np.zeros((3, 3))})),
            "A formation must be",
        ),
    ],
)
def test_wrong_arguments_are_named(change: Callable[[Campaign], object], sentence: str) -> None:
    campaign = Campaign(DrawnEstimate(), {}, FORMATIONS, 2, 0, engagement=SHORT)
    with pytest.raises(UsageError, match=sentence):
        change(campaign)
