"""The true emitter's position between its samples."""

from __future__ import annotations

import pytest

from swarmctl.recorder.truth import TruthTrack


def test_a_single_sample_moves_with_its_velocity() -> None:
    truth = TruthTrack()
    truth.add(100.0, (10.0, 20.0, 0.0), (1.0, -2.0, 0.0))
    assert truth.at(101.5) == (11.5, 17.0, 0.0)
    assert truth.latest_s == 100.0


def test_between_two_samples_it_is_on_their_line() -> None:
    truth = TruthTrack()
    truth.add(100.0, (10.0, 20.0, 0.0), (50.0, 50.0, 50.0))
    truth.add(104.0, (18.0, 20.0, -4.0), (0.0, 0.0, 0.0))
    assert truth.at(101.0) == pytest.approx((12.0, 20.0, -1.0))
    assert truth.at(105.0) == pytest.approx((20.0, 20.0, -5.0))


def test_an_older_or_repeated_sample_is_left_out() -> None:
    truth = TruthTrack()
    truth.add(100.0, (10.0, 20.0, 0.0), (0.0, 0.0, 0.0))
    truth.add(100.0, (99.0, 99.0, 0.0), (0.0, 0.0, 0.0))
    truth.add(99.0, (99.0, 99.0, 0.0), (0.0, 0.0, 0.0))
    assert truth.at(100.0) == (10.0, 20.0, 0.0)
