"""The paper's simulation, Table 1 and Figs. 2-9, with the bound and the NEES it leaves out."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from swarmctl.estimation.model.range_difference import (
    effective_relative_covariance,
    jacobian,
    range_differences,
)
from swarmctl.study import paper_filters
from swarmctl.study.campaign import Campaign, FormationResult, run_campaign
from swarmctl.study.engagement import Engagement, fly
from swarmctl.study.registry import Registry
from swarmctl.study.starts import DrawnEstimate
from swarmctl.study.tally import Tally
from swarmctl.units import Array

TIMES_S = (1.0, 4.0, 8.0, 12.0, 16.0)
"""Rows of the summary, s."""

AXES = ("x", "y", "vx", "vy")


@dataclass(frozen=True)
class Scene:
    """The true flight of one formation, and how much information it gives.

    Attributes:
        emitter: (K, 2), m.
        reference: (K, 2), m.
        companions: (K, N, 2), m.
        paper_index: Determinant of the paper's information, Eq. (16) with the factor 16 it
            should have, of one epoch, (K,), 1/m⁴.
        fisher_index: Determinant of the range differences' Fisher information on the
            position, of one epoch, (K,), 1/m⁴.
    """

    emitter: Array
    reference: Array
    companions: Array
    paper_index: Array
    fisher_index: Array


@dataclass(frozen=True)
class Table1:
    """The results of the study.

    Attributes:
        campaign: What was flown.
        results: The statistics of each formation, by name.
        scenes: The true flight of each formation, by name.
    """

    campaign: Campaign
    results: dict[str, FormationResult]
    scenes: dict[str, Scene]

    def nrmse(self, formation: str, candidate: str) -> Array:
        """Eq. (36), corrected: sqrt(mean |error|²) / D, of position and velocity, (K, 2).

        D is the larger of the formations' standard deviations of the error, at each epoch.
        """
        tally = self.results[formation].tallies[candidate]
        others = [result.tallies[candidate] for result in self.results.values()]
        columns = []
        for axes, rmse in ((slice(0, 2), tally.rmse), (slice(2, 4), tally.velocity_rmse)):
            deviations = [np.sqrt((t.standard_deviation[:, axes] ** 2).sum(1)) for t in others]
            columns.append(rmse / np.max(deviations, axis=0))
        return np.stack(columns, axis=-1)


def run_table1(
    registry: Registry,
    *,
    runs: int = 200,
    seed: int = 0,
    rho: float = 0.0,
    executor: Executor | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> Table1:
    """Fly Table 1 with every registered filter and formation.

    Args:
        registry: The filters and formations to compare.
        runs: Runs of each formation; the paper has 200.
        seed: The seed of all draws.
        rho: Share of the RD variance from the reference receiver; the paper's noise is
            independent, 0.
        executor: Where the runs are flown; None for this process.
        on_progress: Is told how many runs are done, and of how many.

    Raises:
        UsageError: runs is below 2 or the seed negative.
        EstimationError: A filter failed, or rho is not in [0, 1).
    """
    engagement = Engagement(rho=rho)
    formations = registry.formations()
    scenes = {name: _scene(engagement, slots) for name, slots in formations.items()}
    campaign = Campaign(
        DrawnEstimate(),
        registry.filters((0.0, 0.0)),
        formations,
        runs,
        seed,
        engagement=engagement,
        slow=registry.slow,
    )
    return Table1(campaign, run_campaign(campaign, executor, on_progress), scenes)


def _scene(engagement: Engagement, formation: Array) -> Scene:
    moments = list(fly(engagement, formation, engagement.emitter))
    emitter = np.array([moment.emitter[:2] for moment in moments])
    reference = np.array([moment.reference for moment in moments])
    companions = np.array([moment.companions for moment in moments])
    baselines = companions - reference[:, None, :]

    rd = range_differences(emitter, reference, companions)
    Cr = engagement.rd_covariance(len(formation))
    R = paper_filters.uncertainty(baselines, rd, np.diag(Cr), engagement.sigma_p_m).R
    of_paper = 4.0 * baselines.mT @ (baselines / R[..., None])

    J = jacobian(emitter, reference, companions)
    C = effective_relative_covariance(Cr, engagement.sigma_p_m, emitter - reference, baselines)
    fisher = J.mT @ np.linalg.solve(C, J)
    return Scene(emitter, reference, companions, np.linalg.det(of_paper), np.linalg.det(fisher))


def write_table1(table: Table1, out: Path) -> None:
    """Write ``table1.json`` (a summary) and ``table1.csv`` (every epoch) into a folder."""
    summary = {
        "runs": table.campaign.runs,
        "seed": table.campaign.seed,
        "rho": table.campaign.engagement.rho,
        "rows": list(_summary(table)),
    }
    document = msgspec.json.format(msgspec.json.encode(summary), indent=1)
    (out / "table1.json").write_bytes(document + b"\n")
    with (out / "table1.csv").open("w", newline="") as file:
        rows = _epochs(table)
        writer = csv.DictWriter(file, list(first := next(rows)))
        writer.writeheader()
        writer.writerow(first)
        writer.writerows(rows)


def _summary(table: Table1) -> Iterator[dict[str, object]]:
    period = table.campaign.engagement.period_s
    for formation, candidate, result, tally in _tallies(table):
        nrmse = table.nrmse(formation, candidate)
        at = []
        for time_s in TIMES_S:
            k = round(time_s / period)
            low, high = tally.nees_interval[k]
            at.append(
                {
                    "time_s": time_s,
                    "rmse_m": float(tally.rmse[k]),
                    "velocity_rmse_mps": float(tally.velocity_rmse[k]),
                    "bound_ca_m": float(result.ca_bound.rmse[k]),
                    "bound_cv_m": float(result.cv_bound.rmse[k]),
                    "nrmse_position": float(nrmse[k, 0]),
                    "nrmse_velocity": float(nrmse[k, 1]),
                    "nees": float(tally.mean_nees[k]),
                    "nees_95": [float(low), float(high)],
                    "inside_95": float(tally.coverage[k]),
                    "lost": int(tally.lost[k]),
                }
            )
        yield {"formation": formation, "filter": candidate, "at": at}


def _epochs(table: Table1) -> Iterator[dict[str, object]]:
    for formation, candidate, result, tally in _tallies(table):
        nrmse = table.nrmse(formation, candidate)
        mean, deviation, claimed = tally.mean_error, tally.standard_deviation, tally.claimed
        ca, cv = result.ca_bound.standard_deviation, result.cv_bound.standard_deviation
        for k, time_s in enumerate(table.campaign.engagement.epochs_s):
            row: dict[str, object] = {
                "formation": formation,
                "filter": candidate,
                "time_s": f"{time_s:.2f}",
            }
            for name, values in (
                ("mean_error", mean),
                ("std", deviation),
                ("claimed_std", claimed),
                ("bound_ca_std", ca),
                ("bound_cv_std", cv),
            ):
                row |= {f"{name}_{axis}": f"{values[k, i]:.6g}" for i, axis in enumerate(AXES)}
            row["nrmse_position"], row["nrmse_velocity"] = (f"{v:.6g}" for v in nrmse[k])
            row["nees"] = f"{tally.mean_nees[k]:.6g}"
            yield row


def _tallies(table: Table1) -> Iterator[tuple[str, str, FormationResult, Tally]]:
    for formation, result in table.results.items():
        for candidate, tally in result.tallies.items():
            yield formation, candidate, result, tally
