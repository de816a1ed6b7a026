"""The live feed: what arrives late, twice, broken or never, and that the rest is used."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.bounds.consistency import mean_bounds, nees
from swarmctl.estimation.estimate import Measured
from swarmctl.estimation.model import motion
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.range_difference import (
    effective_covariance,
    range_differences,
    rd_covariance,
)
from swarmctl.estimation.model.rows import Rows
from swarmctl.estimation.track.ncrkf_kernel import NcrkfKernel
from swarmctl.estimation.track.track import Track
from tests.estimation.feed.live_feed import (
    COVARIANCE,
    DRIFT,
    EMITTER,
    EPOCH,
    MEAN,
    PSD,
    START,
    VELOCITY,
    Live,
    assert_same_track,
    by_hand,
    hear,
    heard,
    live_feed,
    nis_by_hand,
    report,
    run,
    where,
)


class Notes(Track):
    """Keeps what it is given."""

    def update(self, rows: Rows) -> bool:
        self.rows = rows
        return super().update(rows)


# --- On time ---------------------------------------------------------------------------


def test_the_track_is_the_filter_s() -> None:
    live = live_feed()
    x, P = MEAN, COVARIANCE
    report(live, 0.0)
    for k in range(1, 20):
        hear(live, 0.15 * k - 0.05)
        assert live.process() == []  # positions are known on one side only
        report(live, 0.15 * k)
        (update,) = live.process()
        if k > 1:
            x, P = motion.predict(x, P, 0.15, PSD)
        nis = nis_by_hand(x, P, 0.15 * k - 0.05, heard(0.15 * k - 0.05))
        expected = by_hand(x, P, 0.15 * k - 0.05, heard(0.15 * k - 0.05))
        x, P = expected.x, expected.P
        sigma = np.sqrt(np.diag(P))
        assert np.abs((update.x - x) / sigma).max() < 1e-5
        assert np.abs((update.P - P) / np.outer(sigma, sigma)).max() < 1e-5
        assert update.epoch_s == EPOCH + (0.15 * k - 0.05)
        assert update.rd_count == 3
        assert update.nis == pytest.approx(nis, rel=1e-4)
    assert live.counts.used == 57
    assert not live.dropped


def test_the_prior_holds_until_the_first_measurement_and_prediction_leaves_the_track_alone() -> (
    None
):
    live = live_feed()
    assert live.epoch_s is None
    x, P = live.state_at(EPOCH + 100.0)
    np.testing.assert_array_equal(x, MEAN)
    np.testing.assert_array_equal(P, COVARIANCE)
    x[:] = P[:] = math.nan
    run(live, 1.0)
    assert live.epoch_s == EPOCH + 1.0
    now = live.state_at(EPOCH + 1.0)
    ahead = live.state_at(EPOCH + 3.0)
    expected = motion.predict(*now, 2.0, PSD)
    np.testing.assert_allclose(ahead[0], expected[0])
    np.testing.assert_allclose(ahead[1], expected[1])
    behind = live.state_at(EPOCH + 0.5)
    np.testing.assert_allclose(behind[0], motion.transport(*now, -0.5)[0])
    np.testing.assert_array_equal(live.state_at(EPOCH + 1.0)[0], now[0])


def test_the_track_is_told_what_of_its_rows_the_noise_of_positions_is() -> None:
    track = Notes(NcrkfKernel(PSD), Prior(MEAN, COVARIANCE))
    run(Live(track), 0.1)
    assert track.rows.position_m == 0.5
    Cr = rd_covariance([3.0] * 3, 0.5)
    np.testing.assert_allclose(track.rows.covariance, effective_covariance(Cr, 0.5))


def test_an_estimate_carries_what_it_was_made_from() -> None:
    """An epoch in several messages is one measurement."""
    live = live_feed()
    report(live, 0.0)
    for receiver, sigma in ((3, 2.0), (2, 3.0), (4, 5.0)):
        live.add_range_differences(EPOCH, 1, [receiver], heard(0.0, 1, (receiver,)), [sigma], 0.25)
    (update,) = live.process()
    assert update.measured == Measured(EPOCH, 1, (3, 2, 4), (2.0, 3.0, 5.0), (0.25,) * 3)


def test_what_an_update_hands_out_cannot_change_the_track() -> None:
    live = live_feed()
    update = run(live, 0.5)[-1]
    before = live.state_at(update.epoch_s)[1].copy()
    update.P[:] = math.nan
    np.testing.assert_array_equal(live.state_at(update.epoch_s)[1], before)


def test_a_swarm_s_tracks_are_consistent() -> None:
    """50 trackers fed with noisy positions at 5 Hz and range differences at 10 Hz for 6 s."""
    rng = np.random.default_rng(1)
    errors, covariances = [], []
    root = np.linalg.cholesky(rd_covariance([3.0] * 3, 0.5))
    for _ in range(50):
        truth = MEAN + np.sqrt(np.diag(COVARIANCE)) * rng.standard_normal(6)
        live = live_feed()
        for k in range(61):
            t = 0.1 * k
            if k % 2 == 0:
                for vehicle in START:
                    noisy = np.array(where(vehicle, t)) + 0.5 * rng.standard_normal(3)
                    x, y, z = noisy.tolist()
                    live.add_position(vehicle, EPOCH + t, (x, y, z), VELOCITY)
            companions = np.array([where(v, t) for v in (2, 3, 4)])
            emitter = truth[:3] + truth[3:] * t
            rd = range_differences(emitter, np.array(where(1, t)), companions)
            rd += root @ rng.standard_normal(3)
            live.add_range_differences(EPOCH + t, 1, (2, 3, 4), rd.tolist(), [3.0] * 3, 0.5)
            live.process()
        assert live.epoch_s == EPOCH + 6.0
        x, P = live.state_at(live.epoch_s)
        truth[:3] += truth[3:] * 6.0
        errors.append(x - truth)
        covariances.append(P)
    mean = nees(np.array(errors), np.array(covariances)).mean()
    low, high = mean_bounds(6, 50, 0.999)
    assert low < mean < high


# --- Late, out of order, in pieces, twice ----------------------------------------------


def test_out_of_order_is_put_in_order_while_it_waits() -> None:
    live, ordered = live_feed(), live_feed()
    for to, order in ((live, (0.3, 0.1, 0.2)), (ordered, (0.1, 0.2, 0.3))):
        report(to, 0.0)
        for t in order:
            hear(to, t)
        report(to, 0.4)
        assert [u.epoch_s for u in to.process()] == [EPOCH + t for t in (0.1, 0.2, 0.3)]
    assert_same_track(live, ordered, 1e-12)


def test_a_late_measurement_counts_as_if_it_had_come_in_time() -> None:
    """A second late, with an emitter that may move at tens of m/s: used where it belongs."""
    fast = np.diag([200.0, 200.0, 1.0, 30.0, 30.0, 0.01]) ** 2
    live, on_time = live_feed(fast), live_feed(fast)
    late = 0.7
    for k in range(18):
        t = 0.1 * k
        for to in (live, on_time):
            report(to, t)
            if to is on_time or abs(t - late) > 0.01:
                hear(to, t)
            to.process()
    hear(live, late)
    (update,) = live.process()
    assert update.epoch_s == EPOCH + 1.7
    # Not identical: each update linearises the range anew, about a slightly other estimate.
    assert_same_track(live, on_time, 0.02)


def test_a_late_measurement_before_all_others_moves_no_epoch_back() -> None:
    live = live_feed()
    for t in (0.0, 0.2, 1.0):
        report(live, t)
    hear(live, 1.0)
    live.process()
    hear(live, 0.1)
    (update,) = live.process()
    assert update.epoch_s == live.epoch_s == EPOCH + 1.0


def test_what_is_older_than_the_history_is_dropped() -> None:
    live = live_feed()
    run(live, 6.0, period=0.5)
    hear(live, 0.9)
    assert live.process() == []
    assert live.dropped == {"too_old": 3}
    hear(live, 1.1)
    assert len(live.process()) == 1


def test_one_epoch_in_several_messages_is_one_measurement() -> None:
    live, together = live_feed(), live_feed()
    for to in (live, together):
        report(to, 0.0)
    rd = heard(0.1)
    for receiver, value in zip((2, 3, 4), rd, strict=True):
        live.add_range_differences(EPOCH + 0.1, 1, [receiver], [value], [3.0], 0.5)
    hear(together, 0.1)
    for to in (live, together):
        report(to, 0.2)
    (update,) = live.process()
    assert update.rd_count == 3
    together.process()
    assert_same_track(live, together, 1e-12)


def test_a_straggler_of_a_used_epoch_is_still_used_once() -> None:
    live = live_feed()
    report(live, 0.0)
    hear(live, 0.1, receivers=(2, 3))
    report(live, 0.2)
    live.process()
    for _ in range(2):
        hear(live, 0.1)
        hear(live, 0.1)
    (update,) = live.process()
    assert update.rd_count == 1
    assert live.counts.used == 3
    # Of the twelve offered again, one was new.
    assert live.dropped == {"duplicate": 11}


def test_used_epochs_are_remembered_no_longer_than_the_history() -> None:
    live = live_feed(history_s=1.0)
    run(live, 10.0)
    assert len(live._used_receivers) <= 12  # memory has no public face


# --- Broken ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("epoch", "receiver", "rd", "sigma", "rho"),
    [
        (math.nan, 2, 10.0, 3.0, 0.5),
        (math.inf, 2, 10.0, 3.0, 0.5),
        (EPOCH + 0.1, 2, math.nan, 3.0, 0.5),
        (EPOCH + 0.1, 2, -math.inf, 3.0, 0.5),
        (EPOCH + 0.1, 2, 2e6, 3.0, 0.5),
        (EPOCH + 0.1, 2, 10.0, 0.0, 0.5),
        (EPOCH + 0.1, 2, 10.0, -3.0, 0.5),
        (EPOCH + 0.1, 2, 10.0, math.nan, 0.5),
        (EPOCH + 0.1, 2, 10.0, 3.0, 1.0),
        (EPOCH + 0.1, 2, 10.0, 3.0, -0.1),
        (EPOCH + 0.1, 2, 10.0, 3.0, math.nan),
        (EPOCH + 0.1, 1, 10.0, 3.0, 0.5),
    ],
)
def test_a_broken_range_difference_is_counted_and_never_absorbed(
    epoch: float, receiver: int, rd: float, sigma: float, rho: float
) -> None:
    live, clean = live_feed(), live_feed()
    for to in (live, clean):
        report(to, 0.0)
        hear(to, 0.1, receivers=(3, 4))
    live.add_range_differences(epoch, 1, [receiver], [rd], [sigma], rho)
    for to in (live, clean):
        report(to, 0.2)
        to.process()
    assert live.dropped == {"invalid": 1}
    assert live.counts.used == 2
    assert_same_track(live, clean, 1e-12)


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e7])
def test_a_broken_position_is_counted_and_never_absorbed(bad: float) -> None:
    live, clean = live_feed(), live_feed()
    for to in (live, clean):
        report(to, 0.0)
        hear(to, 0.1)
    live.add_position(2, EPOCH + 0.1, (bad, 0.0, 0.0), VELOCITY)
    live.add_position(2, EPOCH + 0.1, where(2, 0.1), (0.0, bad, 0.0))
    if not math.isfinite(bad):
        live.add_position(2, bad, where(2, 0.1), VELOCITY)
    for to in (live, clean):
        report(to, 0.2)
        to.process()
    assert live.dropped["invalid_position"] == (2 if math.isfinite(bad) else 3)
    assert_same_track(live, clean, 1e-12)


def test_an_update_without_a_finite_result_is_not_absorbed() -> None:
    live = live_feed(sigma_p_m=0.0)
    report(live, 0.0)
    live.add_range_differences(EPOCH + 0.1, 1, [2], heard(0.1)[:1], [1e-170], 0.5)
    report(live, 0.2)
    assert live.process() == []
    assert live.dropped == {"singular": 1}
    assert live.epoch_s is None
    np.testing.assert_array_equal(live.state_at(EPOCH)[0], MEAN)


def test_entries_that_do_not_belong_together_are_refused() -> None:
    with pytest.raises(EstimationError, match="have 2, 1 and 2"):
        live_feed().add_range_differences(EPOCH, 1, [2, 3], [1.0], [3.0, 3.0], 0.5)


# --- Missing ---------------------------------------------------------------------------


def test_a_silent_vehicle_is_waited_for_and_then_extrapolated() -> None:
    live = live_feed()
    report(live, 0.0)
    hear(live, 0.2)
    report(live, 0.45, (1, 2, 3))
    assert live.process() == []
    report(live, 0.55, (1, 2, 3))
    (update,) = live.process()
    assert update.rd_count == 3
    on_time = live_feed()
    report(on_time, 0.0)
    hear(on_time, 0.2)
    report(on_time, 0.45)
    on_time.process()
    assert_same_track(live, on_time, 1e-6)  # it flew straight on


def test_a_vehicle_silent_for_too_long_costs_its_own_range_difference_only() -> None:
    live = live_feed()
    report(live, 0.0)
    report(live, 0.9, (1, 2, 3))
    hear(live, 1.0)
    report(live, 1.4, (1, 2, 3))
    (update,) = live.process()
    assert update.rd_count == 2
    assert live.dropped == {"no_position": 1}


def test_without_the_reference_nothing_is_known() -> None:
    live = live_feed()
    report(live, 0.0, (2, 3, 4))
    hear(live, 0.1)
    report(live, 0.5, (2, 3, 4))
    assert live.process() == []
    assert live.dropped == {"no_position": 3}


def test_without_any_positions_measurements_do_not_pile_up() -> None:
    live = live_feed()
    hear(live, 0.0)
    assert live.process() == []
    assert live.dropped == {"no_position": 3}
    report(live, 1.0)
    hear(live, 5.9)
    assert live.process() == []
    assert live.dropped == {"no_position": 3}  # still waiting
    hear(live, 6.1)
    live.process()
    assert live.dropped == {"no_position": 6}


# --- Changing swarms -------------------------------------------------------------------


def test_sets_and_references_may_change() -> None:
    live = live_feed()
    counts = []
    for k, (reference, receivers) in enumerate(
        [(1, (2, 3, 4)), (1, (2,)), (4, (1, 2, 3)), (2, (4, 3)), (1, (2, 3, 4))]
    ):
        report(live, 0.1 * k)
        hear(live, 0.1 * k, reference, receivers)
        counts += [update.rd_count for update in live.process()]
    assert counts == [3, 1, 3, 2, 3]
    assert live.counts.used == 12
    assert not live.dropped


def test_two_references_at_one_epoch_are_two_measurements() -> None:
    live = live_feed()
    report(live, 0.0)
    hear(live, 0.0, 1, (2,))
    hear(live, 0.0, 3, (4,))
    assert [update.rd_count for update in live.process()] == [1, 1]


def test_one_companion_is_enough_for_a_bearing() -> None:
    live = live_feed()
    for k in range(30):
        report(live, 0.1 * k)
        hear(live, 0.1 * k, receivers=(2,))
        live.process()
    x, P = live.state_at(EPOCH + 2.9)
    # Companion 2 is at +90 degrees: north is across the line of sight, east along it.
    assert P[1, 1] < 0.05 * COVARIANCE[1, 1]
    assert P[0, 0] > 0.5 * COVARIANCE[0, 0]
    assert abs(x[1] - (EMITTER + DRIFT * 2.9)[1]) < 4.0 * math.sqrt(P[1, 1])


# --- Wrong arguments -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sigma_p_m": -1.0}, "sigma_p_m must be"),
        ({"max_wait_s": math.nan}, "max_wait_s must be"),
        ({"history_s": -1.0}, "history_s must be"),
        ({"max_extrapolation_s": math.inf}, "max_extrapolation_s must be"),
    ],
)
def test_a_queue_that_cannot_be_is_refused(change: dict[str, float], message: str) -> None:
    with pytest.raises(EstimationError, match=message):
        live_feed(COVARIANCE, **change)


def test_a_vehicle_nobody_knows_is_named() -> None:
    live = live_feed()
    with pytest.raises(EstimationError, match="vehicle 9 is unknown: the vehicles are 1, 2, 3, 4"):
        live.add_position(9, EPOCH, (0.0, 0.0, 60.0), VELOCITY)
    with pytest.raises(EstimationError, match="reference 9 is unknown"):
        live.add_range_differences(EPOCH, 9, [2], [0.0], [3.0], 0.5)
    with pytest.raises(EstimationError, match="receiver 9 is unknown"):
        live.add_range_differences(EPOCH, 1, [2, 9], [0.0, 0.0], [3.0, 3.0], 0.5)


def test_an_epoch_must_be_finite() -> None:
    with pytest.raises(EstimationError, match="epoch_s must be finite"):
        live_feed().state_at(math.nan)


@pytest.mark.parametrize(("off_s", "words"), [(60.0, "60.0 s ahead of"), (-20.0, "20.0 s behind")])
def test_measurements_of_another_time_are_complained_of_once(off_s: float, words: str) -> None:
    live = live_feed()
    for k in range(30):
        report(live, 0.1 * k)
        hear(live, 0.1 * k)
        live.process()
    used = live.counts.used
    for k in range(30, 40):
        report(live, 0.1 * k)
        t = EPOCH + 0.1 * k + off_s
        live.add_range_differences(t, 1, (2, 3, 4), heard(0.1 * k), [3.0] * 3, 0.5)
        live.process()
    (complaint,) = live.complaints
    assert f"range differences are {words} the vehicles' positions" in complaint
    assert live.counts.used == used
    assert live.dropped.total() == 30
