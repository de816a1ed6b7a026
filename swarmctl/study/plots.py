"""Pictures of the studies. Import this only to draw: matplotlib is slow to load.

Figs. 2-9 carry the paper's numbers; ``nees.png`` is what it did not show.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import cycle
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swarmctl.study.appendix_b import InformationStudy
from swarmctl.study.registry import JUDGED
from swarmctl.study.table1 import Table1
from swarmctl.study.tally import Tally

_DPI = 110
_BOUND = "#22272e"
_COLOURS = ("#0072b2", "#c1121f", "#e08700", "#8b949e", "#009e73", "#cc5a94", "#5b6ee1")
_DASHES = ("-", "--", "-.", ":")

_QUANTITIES = (("x", "m"), ("y", "m"), ("x", "m/s"), ("y", "m/s"))
_POSITION, _VELOCITY = (0, 1), (2, 3)


def draw_table1(table: Table1, out: Path) -> list[Path]:
    """Draw Figs. 2-9 and the NEES into a folder.

    Returns:
        The files written.
    """
    figures = {
        "fig2_information.png": _information(table),
        "fig3_scenario.png": _scenario(table),
        "fig4_position_error_mean.png": _means(table, "position", _POSITION),
        "fig5_position_error_std.png": _deviations(table, "position", _POSITION),
        "fig6_velocity_error_mean.png": _means(table, "velocity", _VELOCITY),
        "fig7_velocity_error_std.png": _deviations(table, "velocity", _VELOCITY),
        "fig8_position_nrmse.png": _nrmse(table, "position", 0),
        "fig9_velocity_nrmse.png": _nrmse(table, "velocity", 1),
        "nees.png": _nees(table),
    }
    paths = []
    for name, figure in figures.items():
        path = out / name
        figure.savefig(path, dpi=_DPI)
        paths.append(path)
    return paths


def draw_information(studies: dict[str, InformationStudy], out: Path) -> Path:
    """Draw how the NCRKF's information converges to the OKF's, Eq. (51), into a folder.

    Returns:
        The file written.
    """
    figure, every = _grid(1, len(studies))
    for axes, (name, study) in zip(every, studies.items(), strict=True):
        line = study.scaled
        axes.loglog(study.epochs, line.predicted, color=_BOUND, ls="--", label="predicted")
        axes.loglog(study.epochs, line.true_weight, "o", ms=4, label="R of true values")
        axes.loglog(study.epochs, line.measured_weight, "x", ms=5, label="R of measured values")
        axes.axhline(line.floor, color=_BOUND, ls=":", label="limit of the latter")
        axes.set(title=name, xlabel="epochs k", ylabel="relative difference")
        axes.legend()
    figure.suptitle("Eq. (51): information of the NCRKF, averaged over k epochs, less the OKF's")
    path = out / "information.png"
    figure.savefig(path, dpi=_DPI)
    return path


def _information(table: Table1) -> Figure:
    figure, (left, right) = _grid(1, 2)
    epochs = table.campaign.engagement.epochs_s
    for name, scene in table.scenes.items():
        left.plot(epochs, scene.paper_index, label=name)
        right.plot(epochs, scene.fisher_index, label=name)
    left.set_title("the paper's index, Eq. (16)")
    right.set_title("Fisher information of the range differences")
    for axes in (left, right):
        axes.set(xlabel="time (s)", ylabel="determinant, one epoch (1/m⁴)")
        axes.legend()
    left.set_ylim(bottom=0.0)
    right.set_yscale("log")
    figure.suptitle("Fig. 2  Amount of target information")
    return figure


def _scenario(table: Table1) -> Figure:
    figure, every = _grid(len(table.scenes), 1, width=9.0, height=2.6)
    for axes, (name, scene) in zip(every, table.scenes.items(), strict=True):
        for j in range(scene.companions.shape[1]):
            axes.plot(*scene.companions[:, j].T, color="#8b949e", lw=0.8)
        axes.plot(*scene.reference.T, color="#0072b2", label="reference UAV")
        axes.plot(*scene.emitter.T, color="#c1121f", label="emitter")
        for k in range(0, len(scene.reference), 200):
            axes.plot(*scene.companions[k].T, "^", color="#22272e", ms=4)
            axes.plot(*scene.reference[k], "o", color="#0072b2", ms=4)
        axes.set(title=name, xlabel="x (m)", ylabel="y (m)", aspect="equal")
        axes.legend(loc="upper right")
    figure.suptitle("Fig. 3  Engagement scenario (markers every 4 s)")
    return figure


def _means(table: Table1, what: str, rows: tuple[int, int]) -> Figure:
    def draw(axes: Axes, tally: Tally, row: int, colour: str, name: str) -> None:
        axes.plot(epochs, tally.mean_error[:, row], color=colour, label=name, lw=_width(name))

    epochs = table.campaign.engagement.epochs_s
    number = 4 if rows == _POSITION else 6
    return _rows_by_formation(table, f"Fig. {number}  Mean of the {what} error", rows, draw)


def _deviations(table: Table1, what: str, rows: tuple[int, int]) -> Figure:
    def draw(axes: Axes, tally: Tally, row: int, colour: str, name: str) -> None:
        deviation = tally.standard_deviation[:, row]
        axes.semilogy(epochs, deviation, color=colour, label=name, lw=_width(name))

    epochs = table.campaign.engagement.epochs_s
    number = 5 if rows == _POSITION else 7
    title = f"Fig. {number}  Standard deviation of the {what} error, and the Cramér-Rao bound"
    return _rows_by_formation(table, title, rows, draw, bounds=True)


def _rows_by_formation(
    table: Table1,
    title: str,
    rows: tuple[int, int],
    draw: Callable[[Axes, Tally, int, str, str], None],
    *,
    bounds: bool = False,
) -> Figure:
    """A row of panels per axis, a column per formation, a curve per filter."""
    figure, every = _grid(2, len(table.results))
    epochs = table.campaign.engagement.epochs_s
    for column, (name, result) in enumerate(table.results.items()):
        for line, row in enumerate(rows):
            axes = every[line * len(table.results) + column]
            for colour, (label, tally) in zip(
                cycle(_COLOURS), result.tallies.items(), strict=False
            ):
                draw(axes, tally, row, colour, label)
            if bounds:
                for label, bound, dash in (
                    ("bound, CA model", result.ca_bound, "--"),
                    ("bound, CV model", result.cv_bound, ":"),
                ):
                    deviation = bound.standard_deviation[:, row]
                    axes.semilogy(epochs, deviation, color=_BOUND, ls=dash, lw=1.6, label=label)
            axis, unit = _QUANTITIES[row]
            axes.set(title=f"{name}, {axis}", xlabel="time (s)", ylabel=unit)
    every[0].legend(fontsize=7)
    figure.suptitle(title)
    return figure


def _nrmse(table: Table1, what: str, column: int) -> Figure:
    figure, every = _grid(1, len(table.campaign.filters), width=3.6)
    epochs = table.campaign.engagement.epochs_s
    for axes, candidate in zip(every, table.campaign.filters, strict=True):
        for dash, formation in zip(cycle(_DASHES), table.results, strict=False):
            values = table.nrmse(formation, candidate)[:, column]
            axes.plot(epochs, values, ls=dash, label=formation)
        axes.set(title=candidate, xlabel="time (s)")
        axes.set_ylim(bottom=0.0)
    every[0].set_ylabel("NRMSE, Eq. (36) corrected")
    every[0].legend()
    figure.suptitle(f"Fig. {8 + column}  NRMSE of the {what}")
    return figure


def _nees(table: Table1) -> Figure:
    figure, every = _grid(1, len(table.results))
    epochs = table.campaign.engagement.epochs_s
    for axes, (name, result) in zip(every, table.results.items(), strict=True):
        for colour, (label, tally) in zip(cycle(_COLOURS), result.tallies.items(), strict=False):
            axes.semilogy(epochs, tally.mean_nees, color=colour, label=label, lw=_width(label))
        axes.axhline(2.0, color=_BOUND, ls="--", label="2: honest error bars")
        axes.set(title=name, xlabel="time (s)", ylabel="mean position NEES")
        axes.legend(fontsize=7)
    figure.suptitle("Do the filters know how good they are?")
    return figure


def _width(candidate: str) -> float:
    # A broad line under the strong baseline's, which covers it where they agree.
    return 2.8 if candidate == JUDGED else 1.1


def _grid(
    rows: int, columns: int, width: float = 5.2, height: float = 3.9
) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(width * columns, height * rows), layout="constrained")
    every: list[Axes] = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for axes in every:
        axes.grid(alpha=0.3)
    return figure, every
