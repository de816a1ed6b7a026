"""swarmctl: a MAVLink swarm mission controller that finds a radio emitter by TDOA.

The names in ``__all__`` are the public interface, for scripts such as
:mod:`missions.find_beacon`: ``import swarmctl`` and take them from there. Every other module is
internal and may change with any version. A name is imported when it is first asked for, so that
``import swarmctl`` itself costs nothing.

Flying
    ``fly``, ``simulated``, ``fly_in_memory``, ``load_mission``, ``Mission``, ``FlightSummary``,
    ``MissionResult``.
Estimating
    ``FILTERS`` makes a ``Track`` of one emitter from a ``Prior`` and a ``Behaviour``, with its
    ``ReceiverErrors``; ``Rows`` go in, an ``Estimate`` comes out.
Formations
    ``DESIGNS``, ``Requirements``, ``Noise``, ``objective_named``.
Errors
    ``SwarmError`` and its subclasses, drawn in :mod:`swarmctl.errors`.

The rest of this page is the convention sheet that every room of the package keeps to.

Units
    SI units and radians inside; degrees, 1e7-degrees, milliseconds and the like exist only
    at the edges (the mission file, ``link/codec``, the console). A name carries its unit where
    a reader could doubt it: ``_m``, ``_mps``, ``_s``, ``_rad``, ``_hz``.

Frames
    ``_enu``: east, north, up in metres in the tangent plane at the mission origin
    (:class:`swarmctl.frames.LocalFrame`). Altitudes named ``alt_amsl_m`` are above mean sea
    level, on the wire and in the mission file; no vehicle's home-relative frame is ever used.
    The geoid is taken as the WGS-84 ellipsoid on both sides of the wire.

Angles
    The line-of-sight (LOS) angle lambda is measured from East, counter-clockwise. A formation
    angle theta is measured from the LOS, counter-clockwise, as in the paper.

Time
    ``now`` and every name ending in ``received_s``: monotonic seconds of the controller's
    clock, used for deadlines. ``epoch_utc_s``: seconds of UTC (float64, resolution 0.24 us),
    used for measurements. Both are passed in; nothing in the core reads a clock.

Randomness
    Generators are passed in (:class:`numpy.random.Generator`), never global.

Symbols
    UAV 0 of the paper is the *reference*, UAVs 1..N its *companions*. A range difference
    (RD) is ``r_j = D_j - D_0``: range emitter-companion minus range emitter-reference.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from swarmctl.errors import (
        EstimationError,
        FeedError,
        FormationError,
        LinkError,
        MissionFileError,
        SimulationError,
        SwarmError,
        UsageError,
    )
    from swarmctl.estimation.estimate import Estimate
    from swarmctl.estimation.filters import FILTERS
    from swarmctl.estimation.model.prior import Prior
    from swarmctl.estimation.model.receiver_errors import ReceiverErrors
    from swarmctl.estimation.model.rows import Rows
    from swarmctl.estimation.track.behaviour import Behaviour
    from swarmctl.estimation.track.track import Track
    from swarmctl.formation.design_report import objective_named
    from swarmctl.formation.designs import DESIGNS
    from swarmctl.formation.requirements import Noise, Requirements
    from swarmctl.mission.mission_file import Mission
    from swarmctl.mission.mission_file_loading import load_mission
    from swarmctl.ops.in_memory import fly_in_memory
    from swarmctl.ops.live import AbandonedError, fly
    from swarmctl.ops.simulation import simulated
    from swarmctl.recorder.summary import FlightSummary
    from swarmctl.results import MissionResult

__version__ = "0.2.0"

__all__ = [
    "DESIGNS",
    "FILTERS",
    "AbandonedError",
    "Behaviour",
    "Estimate",
    "EstimationError",
    "FeedError",
    "FlightSummary",
    "FormationError",
    "LinkError",
    "Mission",
    "MissionFileError",
    "MissionResult",
    "Noise",
    "Prior",
    "ReceiverErrors",
    "Requirements",
    "Rows",
    "SimulationError",
    "SwarmError",
    "Track",
    "UsageError",
    "fly",
    "fly_in_memory",
    "load_mission",
    "objective_named",
    "simulated",
]

_HOMES = {
    "swarmctl.errors": (
        "EstimationError",
        "FeedError",
        "FormationError",
        "LinkError",
        "MissionFileError",
        "SimulationError",
        "SwarmError",
        "UsageError",
    ),
    "swarmctl.estimation.estimate": ("Estimate",),
    "swarmctl.estimation.filters": ("FILTERS",),
    "swarmctl.estimation.model.prior": ("Prior",),
    "swarmctl.estimation.model.receiver_errors": ("ReceiverErrors",),
    "swarmctl.estimation.model.rows": ("Rows",),
    "swarmctl.estimation.track.behaviour": ("Behaviour",),
    "swarmctl.estimation.track.track": ("Track",),
    "swarmctl.formation.designs": ("DESIGNS",),
    "swarmctl.formation.design_report": ("objective_named",),
    "swarmctl.formation.requirements": ("Noise", "Requirements"),
    "swarmctl.mission.mission_file": ("Mission",),
    "swarmctl.mission.mission_file_loading": ("load_mission",),
    "swarmctl.ops.in_memory": ("fly_in_memory",),
    "swarmctl.ops.live": ("AbandonedError", "fly"),
    "swarmctl.ops.simulation": ("simulated",),
    "swarmctl.recorder.summary": ("FlightSummary",),
    "swarmctl.results": ("MissionResult",),
}
"""The module that each public name comes from."""


if not TYPE_CHECKING:  # a type checker would take it for a module with any attribute

    def __getattr__(name: str) -> object:
        for module, names in _HOMES.items():
            if name in names:
                value = getattr(import_module(module), name)
                globals()[name] = value
                return value
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
