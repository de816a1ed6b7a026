"""What is believed: modes, models of motion, and the receivers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.estimation.track.contrast import Contrast
from swarmctl.estimation.track.manoeuvre import Manoeuvre
from swarmctl.estimation.track.modes import Mixture
from tests.estimation.receivers import REAL, flight

CAR = Manoeuvre(20.0)
REAL_CONTRAST = Contrast(np.ones((2, 2)), np.zeros((2, 2)), np.zeros((2, 2)))
"""Of positions that are exact."""


def two_modes(manoeuvre: Manoeuvre | None = None) -> Mixture:
    """3 : 1, a kilometre apart."""
    x = np.array([[500.0, 0.0, 10.0, 0.0], [-500.0, 0.0, -10.0, 0.0]])
    P = np.broadcast_to(np.diag([4.0, 4.0, 1.0, 1.0]), (2, 4, 4))
    behaviour = Behaviour((0.0, 0.0), REAL, manoeuvre)
    return Mixture(behaviour, x, P, np.log([0.75, 0.25]) + 7.0, {})


@pytest.mark.parametrize("dt", [-2.0, 0.0, 3.0])
def test_all_modes_together_are_as_wide_as_they_are_apart(dt: float) -> None:
    """Position at dt: ± (500 + 10 dt), of variance 4 + dt² each."""
    mean, P = two_modes(CAR).all_after(dt)
    assert mean[0] == pytest.approx(500.0 + 10.0 * dt)
    apart = 2.0 * (500.0 + 10.0 * dt)
    assert P[0, 0] == pytest.approx(4.0 + dt**2 + 0.25 * apart**2)
    assert P[1, 1] == pytest.approx(4.0 + dt**2)


def test_modes_are_weighed_by_bayes_and_the_improbable_forgotten() -> None:
    mixture = two_modes()
    mixture.compare(np.array([0.0, math.log(2.0)]), REAL_CONTRAST)
    assert [e.probability for e in mixture.estimates(0.0)] == pytest.approx([0.6, 0.4])
    mixture.compare(np.array([-20.0, 0.0]), REAL_CONTRAST)
    (left,) = mixture.estimates(0.0)
    assert left.x[0] == -500.0
    assert mixture.x.shape == (1, 1, 4)


def test_what_the_noise_of_positions_says_of_modes_is_not_believed() -> None:
    """Of all measurements together: a real contrast brings the earlier ones in, too."""
    mixture = two_modes()
    noise = Contrast(*(np.full((2, 2), value) for value in (8.0, 8.0, 12.0)))
    for log_odds in (-30.0, 50.0, -40.0):
        mixture.compare(np.array([0.0, -log_odds]), noise)
        assert [e.probability for e in mixture.estimates(0.0)] == pytest.approx([0.75, 0.25])
    # Found 24 + 56, of which 24 + 3 sqrt(36) are noise: a share of 0.475 of 22 - 20.
    mixture.compare(
        np.array([0.0, -22.0]), Contrast(*np.full((1, 2, 2), 56.0), *np.zeros((2, 2, 2)))
    )
    odds = 3.0 * math.exp(0.475 * 2.0)
    found = [e.probability for e in mixture.estimates(0.0)]
    assert found == pytest.approx([odds / (odds + 1.0), 1.0 / (odds + 1.0)])


def test_the_best_mode_stays_so_until_another_is_twice_as_probable() -> None:
    mixture = two_modes()
    for more, best, probability in (
        (5.0, 0, 3.0 / 8.0),
        (1.3, 1, 6.5 / 9.5),
        (0.3, 1, 1.95 / 4.95),
    ):
        mixture.compare(np.array([0.0, math.log(more)]), REAL_CONTRAST)
        first, second = mixture.estimates(0.0)
        assert mixture.best == best
        assert first.x[0] == (500.0, -500.0)[best] == -second.x[0]
        assert first.probability == pytest.approx(probability)
    mixture.compare(np.array([0.0, -20.0]), REAL_CONTRAST)
    assert mixture.best == 0
    assert mixture.after(0.0)[0][0] == 500.0


def test_each_mode_is_weighed_against_the_best() -> None:
    """The first two are mirror images; how far the others differ would be another sum."""
    before = two_modes()
    x, P = np.repeat(before.x[:, 0], 2, 0)[:3], np.repeat(before.P[:, 0], 2, 0)[:3]
    mixture = Mixture(Behaviour((0.0, 0.0), REAL), x, P, np.array([0.0, 0.0, -8.0]), {})
    share = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.5], [1.0, 0.5, 0.0]])
    mixture.compare(
        np.array([0.0, -30.0, 6.0]),
        Contrast(100.0 * np.ones((3, 3)), 100.0 * (1.0 - share), np.zeros((3, 3))),
    )
    np.testing.assert_allclose(mixture.log_probability, [0.0, 0.0, -2.0])


def test_a_receiver_begins_with_what_is_assumed_of_its_errors_once() -> None:
    mixture = two_modes(CAR)
    rows = flight(np.random.default_rng(0), REAL, 0.1).rows[0]
    mixture.admit(rows)
    mixture.admit(rows)
    assert mixture.x.shape == (2, 2, 4 + 4 * 4)
    errors, covariance = mixture.receiver(3)
    np.testing.assert_array_equal(errors, np.zeros(4))
    np.testing.assert_allclose(np.diag(covariance), [9.0**2, 0.3**2, 1.5**2, 1.5**2])
    np.testing.assert_allclose(mixture.receiver(3, to=1)[1], 2.0 * covariance)
    with pytest.raises(EstimationError, match="Receiver 7 has not been heard"):
        mixture.receiver(3, to=7)
