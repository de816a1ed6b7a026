"""Eq. (51) by Monte Carlo: the rate, its constant, the floor, and what it does not say."""

from __future__ import annotations

import functools
import json
import math
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from swarmctl.errors import UsageError
from swarmctl.estimation.model.range_difference import range_differences
from swarmctl.study import paper_filters
from swarmctl.study.appendix_b import (
    Convergence,
    InformationStudy,
    run_information,
    write_information,
)
from swarmctl.study.engagement import Engagement, fly

RUNS = 1000
FIVE_SIGMA = 5.0 * math.sqrt(2.0 / RUNS)
"""On a mean square over the runs: ``Σ λ_i z_i²`` has a relative variance of at most 2."""


def circle(*degrees: float) -> np.ndarray:
    return np.array([[math.radians(angle), 300.0] for angle in degrees])


FORMATIONS = {"perpendicular": circle(-90, 0, 90), "uniform": circle(-120, 0, 120)}
each_formation = pytest.mark.parametrize("name", FORMATIONS)


@functools.cache
def of_table_1(name: str) -> InformationStudy:
    return run_information(runs=RUNS, epochs=300, seed=1, formation=FORMATIONS[name])


@functools.cache
def twenty_times_noisier() -> InformationStudy:
    engagement = Engagement(sigma_r_m=10.0, sigma_p_m=10.0)
    return run_information(
        runs=RUNS,
        epochs=1000,
        seed=2,
        formation=FORMATIONS["perpendicular"],
        engagement=engagement,
    )


def both_norms(study: InformationStudy) -> tuple[Convergence, Convergence]:
    return study.frobenius, study.scaled


@each_formation
def test_with_the_true_weight_the_difference_is_the_predicted_one_at_every_k(name: str) -> None:
    study = of_table_1(name)
    assert study.epochs[0] == 1
    assert study.epochs[-1] == 300
    for found in both_norms(study):
        np.testing.assert_allclose(
            found.predicted, found.predicted[0] / np.sqrt(study.epochs), rtol=1e-12
        )
        ratio = np.square(found.true_weight / found.predicted)
        assert (np.abs(ratio - 1.0) < FIVE_SIGMA).all()


@each_formation
def test_it_falls_as_one_over_the_square_root_of_k(name: str) -> None:
    """Within the standard error of the fitted slope.

    Averages over k and l > k epochs have squared norms correlated by k / l.
    """
    study = of_table_1(name)
    k = study.epochs
    centred = np.log(k) - np.log(k).mean()
    fit = centred / (centred @ centred)
    correlation = np.minimum.outer(k, k) / np.maximum.outer(k, k)
    standard = 0.5 * math.sqrt(2.0 / RUNS * fit @ correlation @ fit)
    assert standard < 0.01
    for found in both_norms(study):
        assert abs(found.slope + 0.5) < 5.0 * standard


@each_formation
def test_at_table_1_s_noise_the_floor_lies_beyond_ten_thousand_epochs(name: str) -> None:
    for found in both_norms(of_table_1(name)):
        assert 0.0 < found.floor < found.predicted[0] / math.sqrt(10_000)


def test_in_the_weak_direction_convergence_starts_far_higher() -> None:
    for name in FORMATIONS:
        study = of_table_1(name)
        assert study.scaled.predicted[0] > 20.0 * study.frobenius.predicted[0]


def test_with_the_measured_weight_it_stops_at_the_floor_the_quadrature_predicts() -> None:
    """The mean square is floor² + (that at k = 1, less floor²) / k, at every k."""
    study = twenty_times_noisier()
    found = study.frobenius
    squares = np.square(found.measured_weight)
    of_one = squares[0] - found.floor**2
    expected = found.floor**2 + of_one / study.epochs
    cross = 10.0 * found.floor * np.sqrt(of_one / (study.epochs * RUNS))
    assert (np.abs(squares - expected) < cross + 2.0 * FIVE_SIGMA * of_one / study.epochs).all()
    # Were there no floor it would be at half that.
    assert found.measured_weight[-1] > found.floor
    assert found.true_weight[-1] < 0.6 * found.floor
    assert found.measured_slope > found.slope + 0.05


@each_formation
def test_the_real_error_is_that_of_the_whole_residual_and_not_what_the_limit_promises(
    name: str,
) -> None:
    """With three companions H is square: the error is H⁻¹ times the mean of v - ΔH s.

    Its covariance is written out here, all terms off the diagonal included.
    """
    study = of_table_1(name)
    engagement = Engagement()
    moment = next(fly(engagement, FORMATIONS[name], engagement.emitter))
    m = moment.companions - moment.reference
    r = range_differences(moment.emitter[:2], moment.reference, moment.companions)
    sight = moment.emitter[:2] - moment.companions
    C, Cr = 0.25 * (np.eye(3) + 1.0), 0.25 * np.eye(3)
    D = np.linalg.norm(sight, axis=1)
    residual = 4.0 * (np.outer(D, D) * Cr + sight @ sight.T * C) + 2.0 * Cr**2 + 4.0 * C**2
    back = np.linalg.inv(paper_filters.rows(m, r))
    mean_square = np.trace((back @ residual @ back.T)[:2, :2])
    R = paper_filters.uncertainty(m, r, np.full(3, 0.25), 0.5).R
    nees = (np.diag(residual) / R).sum()

    assert abs(study.error_m**2 / mean_square - 1.0) < FIVE_SIGMA
    assert abs(study.nees / nees - 1.0) < FIVE_SIGMA
    assert study.nees > 300 * 3
    assert study.error_m > 20.0 * study.claimed_m
    assert study.attainable_m > 15.0 * study.claimed_m


def test_v_takes_the_bias_out_of_the_estimate_it_has_no_part_in_the_information() -> None:
    """At six times the noise V is worth 32 m, ten standard errors of the mean."""
    engagement = Engagement(sigma_r_m=3.0, sigma_p_m=3.0)
    formation = FORMATIONS["perpendicular"]
    study = run_information(
        runs=RUNS, epochs=1000, seed=3, formation=formation, engagement=engagement
    )
    standard = study.error_m / math.sqrt(RUNS * 1000)
    assert 8.0 * standard < 32.0
    assert study.bias_m < 5.0 * standard


def test_a_seed_is_one_result_and_json_holds_all_of_it(tmp_path: Path) -> None:
    texts = []
    for seed in (5, 5, 6):
        study = run_information(runs=3, epochs=40, seed=seed, formation=FORMATIONS["uniform"])
        write_information({"uniform": study}, 7, tmp_path)
        texts.append((tmp_path / "information.json").read_text())
    assert texts[0] == texts[1] != texts[2]
    document = json.loads(texts[2])
    assert (document["seed"], list(document["formations"])) == (7, ["uniform"])
    read = document["formations"]["uniform"]
    assert set(read) == {field.name for field in fields(InformationStudy)}
    assert set(read["scaled"]) == {field.name for field in fields(Convergence)}
    assert read["epochs"] == study.epochs.tolist()
    assert read["scaled"]["measured_weight"] == study.scaled.measured_weight.tolist()
    assert read["nees"] == study.nees


@pytest.mark.parametrize(
    ("runs", "epochs", "formation", "message"),
    [
        (0, 10, circle(-90, 0, 90), "At least 1 run"),
        (1, 1, circle(-90, 0, 90), "At least 1 run"),
        (1, 10, circle(-90, 90), "singular"),
        (1, 10, circle(-90, 90, 90, -90), "singular"),
        (1, 10, np.zeros(3), "A formation must be"),
    ],
)
def test_wrong_arguments_are_named(
    runs: int, epochs: int, formation: np.ndarray, message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        run_information(runs=runs, epochs=epochs, seed=1, formation=formation)
