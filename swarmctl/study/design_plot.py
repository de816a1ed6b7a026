"""The picture of a formation. Import this only to draw: matplotlib is slow to load."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swarmctl.formation.design_report import DesignReport
from swarmctl.formation.information import fisher
from swarmctl.formation.requirements import Requirements
from swarmctl.study.paper_index import exact_independent
from swarmctl.units import Array

_STEPS = 121
"""Angles per axis of the maps."""


def draw_design(report: DesignReport, requirements: Requirements, path: Path) -> None:
    """Draw a design's slots and, like the paper's Fig. 2, information against two angles.

    The first two companions go round the reference UAV at d_max, the others stay in their
    slots: on the left what the paper's L_p says of it, Eq. (16), on the right the Fisher
    information of the range differences.

    Args:
        report: The design.
        requirements: What it was made for.
        path: A PNG, or another format matplotlib knows by its suffix.

    Raises:
        OSError: The file cannot be written.
        ValueError: The suffix is none matplotlib knows.
    """
    figure = Figure(figsize=(14.5, 4.6), layout="constrained")
    slots, paper, true = figure.subplots(1, 3)
    _slots(slots, report, requirements)
    angles = np.linspace(-math.pi, math.pi, _STEPS)
    if len(report.design) >= 2:
        designs = np.broadcast_to(report.design, (_STEPS, _STEPS, *report.design.shape)).copy()
        designs[:, :, :2, 1] = requirements.max_slot_distance_m
        designs[:, :, 0, 0], designs[:, :, 1, 0] = np.meshgrid(angles, angles)
        index = exact_independent(designs, requirements.range_m, requirements.noise)
        information = np.linalg.det(fisher(designs, requirements.range_m, requirements.noise))
        _map(paper, angles, index, report.design, "the paper's L_p, Eq. (16)")
        _map(true, angles, information, report.design, "Fisher information, determinant")
    else:
        for axes in (paper, true):
            axes.set_axis_off()
    figure.savefig(path, dpi=110)


def _slots(axes: Axes, report: DesignReport, requirements: Requirements) -> None:
    axes.plot(*_circle(requirements.max_slot_distance_m), color="#8b949e", lw=0.8, label="d_max")
    axes.plot(0.0, 0.0, "o", color="#22272e", label="reference UAV")
    axes.plot(*report.slots_m.T, "^", color="#0072b2", ms=8, label="companions")
    for j, (along, cross) in enumerate(report.slots_m.tolist(), start=1):
        axes.annotate(str(j), (along, cross), textcoords="offset points", xytext=(6, 5))
    d = requirements.max_slot_distance_m
    axes.annotate(
        "emitter", (1.35 * d, 0.0), (0.55 * d, 0.0), arrowprops={"arrowstyle": "->"}, va="center"
    )
    axes.set(
        title=f"{report.name}, N = {len(report.design)}",
        xlabel="along the line of sight (m)",
        ylabel="across (m)",
        aspect="equal",
        xlim=(-1.25 * d, 1.45 * d),
        ylim=(-1.25 * d, 1.25 * d),
    )
    axes.grid(alpha=0.3)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3, fontsize=8)


def _map(axes: Axes, angles: Array, values: Array, design: Array, title: str) -> None:
    degrees = np.degrees(angles)
    greatest = values.max()
    shown = axes.contourf(degrees, degrees, values / greatest, levels=20, cmap="viridis")
    theta = np.degrees((design[:2, 0] + math.pi) % (2.0 * math.pi) - math.pi)
    axes.plot(theta[0], theta[1], "w*", ms=13, mec="k", label="this design")
    axes.set(
        title=f"{title} (greatest {greatest:.2g} 1/m⁴)",
        xlabel="theta of companion 1 (deg)",
        ylabel="theta of companion 2 (deg)",
        xticks=range(-180, 181, 90),
        yticks=range(-180, 181, 90),
    )
    axes.legend(loc="lower left", fontsize=8)
    axes.figure.colorbar(shown, ax=axes, label="of the greatest")


def _circle(radius: float) -> tuple[Array, Array]:
    turn = np.linspace(0.0, 2.0 * math.pi, 181)
    return radius * np.cos(turn), radius * np.sin(turn)
