"""Monte Carlo studies of estimators and formations: the truth and the estimators in one room.

The only room that knows both. ``swarmctl study`` runs the studies
(``docs/how-to/study-a-filter.md``). The public names are those in ``__all__``, and the module
``paper_index`` is public as a whole. A name is imported when it is first asked for, because
scipy and the simulator are slow to load.

Studies
    ===================== =====================================================================
    ``table1``            the paper's Figs. 2-9, with the bound it did not draw
    ``consistency``       filters in white noise: error against the bound, NEES, with intervals
    ``track_consistency`` the live track in noise that is not white
    ``track_cases``       the experiments of that study, and what each is held to
    ``track_runs``        chunks of its runs
    ``track_health``      how soon the track says that its feed has gone wrong
    ``appendix_b``        does the NCRKF's information converge to the OKF's?
    ``formation``         whole missions: which formation finds the emitter soonest?
    ``transitions``       does the swarm keep its limits while its formation changes?
    ===================== =====================================================================

What is compared
    ====================== ====================================================================
    ``registry``           filters and formations by name; a researcher adds his own
    ``batch_filter``       what a filter is given and gives
    ``filters``            the filters of this system and of the paper
    ``ekf_update``         the (iterated) extended Kalman filter's update, in a batch of runs
    ``filterpy_filter``    filterpy's extended Kalman filter
    ``filter_coordinates`` coordinates in which a filter may follow the emitter
    ``paper_filters``      the paper's filter steps as printed
    ``paper_information``  the information matrices of its Appendices A and B
    ``paper_index``        its "amount of target information" of a formation
    ====================== ====================================================================

What is flown
    ============== ============================================================================
    ``engagement`` the engagement of Table 1: who is where, and what is measured
    ``starts``     what is drawn before a run begins: the prior, the truth
    ``receivers``  clocks, navigation errors, coloured errors and echoes, drawn
    ``campaign``   runs x formations x filters, in chunks
    ``executors``  where chunks are flown: this process, several, or a dask cluster
    ``tally``      sums over the runs, and the statistics made of them
    ============== ============================================================================

Pictures
    ``plots`` draws the studies, ``design_plot`` a formation. Both load matplotlib.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from swarmctl.study.appendix_b import run_information
    from swarmctl.study.batch_filter import (
        BatchEstimate,
        BatchFilter,
        Belief,
        RelativePrior,
        Scan,
        Truth,
    )
    from swarmctl.study.campaign import Campaign, run_campaign
    from swarmctl.study.consistency import run_consistency
    from swarmctl.study.executors import executing
    from swarmctl.study.filterpy_filter import filterpy_ekf
    from swarmctl.study.filters import ekf, iterated_ekf, ncrkf, okf
    from swarmctl.study.formation import run_formation
    from swarmctl.study.registry import Registry, standard_registry
    from swarmctl.study.starts import Anywhere, DrawnEstimate, DrawnTruth, RangeIgnorant
    from swarmctl.study.table1 import run_table1
    from swarmctl.study.track_consistency import run_track_consistency
    from swarmctl.study.track_health import run_track_health
    from swarmctl.study.transitions import run_transitions

__all__ = [
    "Anywhere",
    "BatchEstimate",
    "BatchFilter",
    "Belief",
    "Campaign",
    "DrawnEstimate",
    "DrawnTruth",
    "RangeIgnorant",
    "Registry",
    "RelativePrior",
    "Scan",
    "Truth",
    "ekf",
    "executing",
    "filterpy_ekf",
    "iterated_ekf",
    "ncrkf",
    "okf",
    "run_campaign",
    "run_consistency",
    "run_formation",
    "run_information",
    "run_table1",
    "run_track_consistency",
    "run_track_health",
    "run_transitions",
    "standard_registry",
]

_HOMES = {
    "appendix_b": ("run_information",),
    "batch_filter": (
        "BatchEstimate",
        "BatchFilter",
        "Belief",
        "RelativePrior",
        "Scan",
        "Truth",
    ),
    "campaign": (
        "Campaign",
        "run_campaign",
    ),
    "consistency": ("run_consistency",),
    "executors": ("executing",),
    "filterpy_filter": ("filterpy_ekf",),
    "filters": (
        "ekf",
        "iterated_ekf",
        "ncrkf",
        "okf",
    ),
    "formation": ("run_formation",),
    "registry": (
        "Registry",
        "standard_registry",
    ),
    "starts": (
        "Anywhere",
        "DrawnEstimate",
        "DrawnTruth",
        "RangeIgnorant",
    ),
    "table1": ("run_table1",),
    "track_consistency": ("run_track_consistency",),
    "track_health": ("run_track_health",),
    "transitions": ("run_transitions",),
}
"""The module of this package that each public name comes from."""


if not TYPE_CHECKING:  # a type checker would take it for a module with any attribute

    def __getattr__(name: str) -> object:
        for module, names in _HOMES.items():
            if name in names:
                value = getattr(import_module(f"{__name__}.{module}"), name)
                globals()[name] = value
                return value
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
