"""The paper's Table 1 and its figures: what is flown, Eq. (36), and the files written."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from swarmctl.errors import EstimationError, UsageError
from swarmctl.study import plots
from swarmctl.study.campaign import Campaign, FormationResult
from swarmctl.study.engagement import Engagement
from swarmctl.study.registry import JUDGED, Registry
from swarmctl.study.starts import DrawnEstimate
from swarmctl.study.table1 import TIMES_S, Scene, Table1, run_table1, write_table1
from swarmctl.study.tally import BoundTally, Tally
from swarmctl.units import Array
from tests.study.registries import registry_of

RUNS = 20
FORMATIONS = ("perpendicular", "uniform", "mine")
FILTERS = (JUDGED, "EKF, the paper's")


@pytest.fixture(scope="module")
def table() -> Table1:
    """Two filters, for speed; a formation of one's own, of four companions."""
    registry = registry_of(*FILTERS)
    slots = [(math.radians(angle), 300.0) for angle in (45, 135, 225, 315)]
    registry.register_formation("mine", slots)
    return run_table1(registry, runs=RUNS, seed=1, rho=0.25)


# --- What is flown ---------------------------------------------------------------------


def test_every_registered_filter_and_formation_is_flown(table: Table1) -> None:
    assert tuple(table.results) == tuple(table.scenes) == FORMATIONS
    for result in table.results.values():
        assert tuple(result.tallies) == FILTERS
        assert {tally.runs for tally in result.tallies.values()} == {RUNS}
    assert table.campaign.engagement == Engagement(rho=0.25)
    assert table.campaign.start == DrawnEstimate()
    assert table.campaign.seed == 1


def information(scene: Scene, k: int, rho: float) -> tuple[float, float]:
    """Both indices at an epoch, written out anew; derivatives by central differences."""
    e, p_0, p = scene.emitter[k], scene.reference[k], scene.companions[k]
    m, n, variance = p - p_0, len(p), 0.5**2

    def rd(emitter: Array) -> Array:
        ranges: Array = np.linalg.norm(emitter - p, axis=1) - np.linalg.norm(emitter - p_0)
        return ranges

    # Below Eq. (6): R_j = 2 σ²(2 r² + σ²) + 4 σp²(2 |m|² + 4 σp²) in two axes.
    R = 2 * variance * (2 * rd(e) ** 2 + variance) + 4 * variance * (
        2 * (m**2).sum(1) + 4 * variance
    )
    of_paper = sum(4.0 * np.outer(m[j], m[j]) / R[j] for j in range(n))

    step = np.eye(2) * 0.1
    J = np.stack([(rd(e + h) - rd(e - h)) / 0.2 for h in step], axis=-1)
    u = (e - p) / np.linalg.norm(e - p, axis=1)[:, None]
    C = variance * ((1.0 - rho) * np.eye(n) + rho + np.eye(n) + u @ u.T)
    return float(np.linalg.det(of_paper)), float(np.linalg.det(J.T @ np.linalg.inv(C) @ J))


@pytest.mark.parametrize("formation", FORMATIONS)
def test_the_indices_of_information_are_their_formulas(formation: str, table: Table1) -> None:
    scene = table.scenes[formation]
    for k in (0, 400, 800):
        of_paper, fisher = information(scene, k, 0.25)
        assert scene.paper_index[k] == pytest.approx(of_paper, rel=1e-9)
        # Central differences over 0.1 m of ranges of 300 m and more: (0.1 / 300)² of them.
        assert scene.fisher_index[k] == pytest.approx(fisher, rel=1e-5)


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(UsageError, match="at least 2 runs, not 1"):
        run_table1(Registry(), runs=1)
    with pytest.raises(EstimationError, match="rho must be"):
        run_table1(registry_of(), rho=1.0)


# --- Eq. (36) --------------------------------------------------------------------------


def fabricated(errors: dict[str, Array]) -> Table1:
    """A table of one filter with these errors, (K, runs, 4), by formation."""
    results = {}
    for name, error in errors.items():
        K, runs, _ = error.shape
        tally = Tally.of(error, np.ones_like(error), np.zeros((K, runs)), np.zeros(K))
        bound = BoundTally(1, np.ones((K, 4)))
        results[name] = FormationResult({"mine": tally}, bound, bound)
    formations = {name: np.array([[0.0, 300.0]]) for name in errors}
    return Table1(Campaign(DrawnEstimate(), {}, formations, 2, 0), results, {})


@pytest.mark.parametrize("seed", range(5))
def test_without_a_mean_error_the_worse_formation_has_nrmse_1(seed: int) -> None:
    """And the better one the quotient of their errors; which is worse may change in time."""
    rng = np.random.default_rng(seed)
    errors = {}
    for name in ("one", "other"):
        half = rng.standard_normal((6, 10, 4)) * rng.uniform(1.0, 9.0, (6, 1, 4))
        errors[name] = np.concatenate([half, -half], axis=1)
    table = fabricated(errors)
    both = np.stack([table.nrmse(name, "mine") for name in errors])
    assert both.shape == (2, 6, 2)
    np.testing.assert_allclose(both.max(0), 1.0, rtol=1e-12)
    for column, axes in enumerate((slice(0, 2), slice(2, 4))):
        squares = [(error[..., axes] ** 2).sum((1, 2)) for error in errors.values()]
        quotient = np.sqrt(np.minimum(*squares) / np.maximum(*squares))
        np.testing.assert_allclose(both.min(0)[:, column], quotient, rtol=1e-12)


def test_eq_36_by_hand() -> None:
    """sqrt(mean |error|²) / D: the mean error counts above the line, not below.

    Position errors of one formation (4, 0) and (2, 0): mean square 10, deviation 1. Of the
    other (0, 2) and (0, -2): mean square 4, deviation 2 = D. Velocity: 3 at all times beside
    +-1, so D = 1.
    """
    one, other = np.zeros((1, 2, 4)), np.zeros((1, 2, 4))
    one[0, :, 0], other[0, :, 1] = [4.0, 2.0], [2.0, -2.0]
    one[0, :, 3], other[0, :, 2] = [3.0, 3.0], [1.0, -1.0]
    table = fabricated({"one": one, "other": other})
    np.testing.assert_allclose(table.nrmse("one", "mine"), [[math.sqrt(10.0) / 2.0, 3.0]])
    np.testing.assert_allclose(table.nrmse("other", "mine"), [[1.0, 1.0]])


# --- Files -----------------------------------------------------------------------------


def test_the_summary_says_what_the_tallies_say(table: Table1, tmp_path: Path) -> None:
    write_table1(table, tmp_path)
    summary = json.loads((tmp_path / "table1.json").read_text())
    assert (summary["runs"], summary["seed"], summary["rho"]) == (RUNS, 1, 0.25)
    assert [(row["formation"], row["filter"]) for row in summary["rows"]] == [
        (formation, candidate) for formation in FORMATIONS for candidate in FILTERS
    ]
    for row in summary["rows"]:
        result = table.results[row["formation"]]
        tally = result.tallies[row["filter"]]
        nrmse = table.nrmse(row["formation"], row["filter"])
        assert [at["time_s"] for at in row["at"]] == list(TIMES_S)
        for at, k in zip(row["at"], (50, 200, 400, 600, 800), strict=True):
            assert at == {
                "time_s": k * 0.02,
                "rmse_m": tally.rmse[k],
                "velocity_rmse_mps": tally.velocity_rmse[k],
                "bound_ca_m": result.ca_bound.rmse[k],
                "bound_cv_m": result.cv_bound.rmse[k],
                "nrmse_position": nrmse[k, 0],
                "nrmse_velocity": nrmse[k, 1],
                "nees": tally.mean_nees[k],
                "nees_95": tally.nees_interval[k].tolist(),
                "inside_95": tally.coverage[k],
                "lost": tally.lost[k],
            }


def test_the_csv_has_every_epoch_of_every_curve(table: Table1, tmp_path: Path) -> None:
    """To six digits, so it agrees with the tallies as well as it is written."""
    write_table1(table, tmp_path)
    with (tmp_path / "table1.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    K = 801
    assert len(rows) == len(FORMATIONS) * len(FILTERS) * K
    every = iter(rows)
    for formation in FORMATIONS:
        result = table.results[formation]
        for candidate in FILTERS:
            curve = [next(every) for _ in range(K)]
            assert {(row["formation"], row["filter"]) for row in curve} == {(formation, candidate)}
            tally = result.tallies[candidate]
            nrmse = table.nrmse(formation, candidate)
            expected = {
                "time_s": table.campaign.engagement.epochs_s,
                "nrmse_position": nrmse[:, 0],
                "nrmse_velocity": nrmse[:, 1],
                "nees": tally.mean_nees,
            }
            for name, values in (
                ("mean_error", tally.mean_error),
                ("std", tally.standard_deviation),
                ("claimed_std", tally.claimed),
                ("bound_ca_std", result.ca_bound.standard_deviation),
                ("bound_cv_std", result.cv_bound.standard_deviation),
            ):
                for i, axis in enumerate(("x", "y", "vx", "vy")):
                    expected[f"{name}_{axis}"] = values[:, i]
            assert set(curve[0]) == {"formation", "filter", *expected}
            for name, values in expected.items():
                written = [float(row[name]) for row in curve]
                np.testing.assert_allclose(written, values, rtol=6e-6, atol=1e-12, err_msg=name)


@pytest.fixture(scope="module")
def drawn(
    table: Table1, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[list[Path], list[Figure]]]:
    """Files and the figures in them, coarse, which is quick."""
    out = tmp_path_factory.mktemp("figures")
    saved: list[Figure] = []
    save = Figure.savefig

    def noted(figure: Figure, path: Path, *, dpi: int) -> None:
        saved.append(figure)
        save(figure, path, dpi=dpi / 3)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", noted)
        yield plots.draw_table1(table, out), saved


@pytest.mark.slow
def test_nine_pictures_are_drawn(drawn: tuple[list[Path], list[Figure]]) -> None:
    """Figs. 2-9 and the NEES, none of them blank."""
    paths, _ = drawn
    assert [path.name.split("_")[0] for path in paths] == [
        *(f"fig{number}" for number in range(2, 10)),
        "nees.png",
    ]
    assert sorted(paths[0].parent.iterdir()) == sorted(paths)
    for path in paths:
        picture = imread(path)[..., :3]
        ink = (np.abs(picture - picture[0, 0]).max(-1) > 0.1).mean()
        assert ink > 0.01, path.name


@pytest.mark.slow
def test_a_formation_of_one_s_own_is_in_every_picture(
    drawn: tuple[list[Path], list[Figure]],
) -> None:
    """As a panel, or as a curve in each."""
    _, saved = drawn
    for figure in saved:
        panels = figure.axes
        title = figure.get_suptitle()
        names = [axes.get_title() for axes in panels]
        if title.startswith(("Fig. 2", "Fig. 8", "Fig. 9")):
            legend = panels[0].get_legend()
            assert legend is not None
            assert [text.get_text() for text in legend.get_texts()] == list(FORMATIONS), title
            assert all(len(axes.lines) == len(FORMATIONS) for axes in panels), title
        elif title.startswith(("Fig. 3", "Do the filters")):
            assert names == list(FORMATIONS), title
        else:
            axis_of = {name: [f"{f}, {name}" for f in FORMATIONS] for name in ("x", "y")}
            assert names == axis_of["x"] + axis_of["y"], title


@pytest.mark.slow
def test_the_curves_are_the_tallies(drawn: tuple[list[Path], list[Figure]], table: Table1) -> None:
    """Of each figure one panel: the user's formation; both bounds beside the deviations."""
    _, saved = drawn
    result = table.results["mine"]
    tally = result.tallies[FILTERS[1]]
    by_number = dict(zip([*range(2, 10), "nees"], saved, strict=True))

    def curve(number: int | str, panel: int, line: int) -> Array:
        return np.asarray(by_number[number].axes[panel].lines[line].get_ydata())

    scene = table.scenes["mine"]
    np.testing.assert_array_equal(curve(2, 0, 2), scene.paper_index)
    np.testing.assert_array_equal(curve(2, 1, 2), scene.fisher_index)
    for panel, row in ((2, 0), (5, 1)):  # three columns; the user's is the last
        for mean, deviation, first in ((4, 5, 0), (6, 7, 2)):
            column = row + first
            np.testing.assert_array_equal(curve(mean, panel, 1), tally.mean_error[:, column])
            np.testing.assert_array_equal(
                curve(deviation, panel, 1), tally.standard_deviation[:, column]
            )
            for line, bound in ((2, result.ca_bound), (3, result.cv_bound)):
                np.testing.assert_array_equal(
                    curve(deviation, panel, line), bound.standard_deviation[:, column]
                )
    nrmse = table.nrmse("mine", FILTERS[1])
    np.testing.assert_array_equal(curve(8, 1, 2), nrmse[:, 0])
    np.testing.assert_array_equal(curve(9, 1, 2), nrmse[:, 1])
    np.testing.assert_array_equal(curve("nees", 2, 1), tally.mean_nees)
