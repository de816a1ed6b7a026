"""The predicted accuracy of a formation design, and how the designs compare."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swarmctl.errors import FormationError
from swarmctl.formation.designs import DESIGNS
from swarmctl.formation.information import predicted_accuracy, slots_in_los_frame
from swarmctl.formation.objectives import Objective, approach, determinant, rms, track
from swarmctl.formation.requirements import Requirements
from swarmctl.units import Array


@dataclass(frozen=True)
class DesignReport:
    """One design, judged.

    Attributes:
        name: Name of the design.
        design: (N, 2) of (theta rad, d m).
        slots_m: (N, 2) along and across the line of sight, m.
        sigma_along_m: 1-sigma of an emitter at rest after ``time_s`` at ``rate_hz``, m.
        sigma_cross_m: The same across the line of sight.
        time_s: Duration of the measurements, s.
        rate_hz: Rate of the measurements, 1/s.
        objective_m: The objective's value, m; lower is better.
        compared: Objective of every design over that of ``optimal``, by name; >= 1 but for
            designs that do not fit, which are left out.
        unfit: Why they do not fit, by name.
    """

    name: str
    design: Array
    slots_m: Array
    sigma_along_m: float
    sigma_cross_m: float
    time_s: float
    rate_hz: float
    objective_m: float
    compared: dict[str, float]
    unfit: dict[str, str]


PRIOR = np.diag([400.0, 400.0, 2.0, 2.0]) ** 2
"""Covariance of the emitter's position (m) and velocity (m/s) before a track is predicted."""


def objective_named(
    name: str, requirements: Requirements, *, time_s: float, rate_hz: float, speed_mps: float
) -> Objective:
    """An objective by its name.

    Args:
        name: ``rms``, ``determinant``, or ``track``: a straight approach from the range of the
            requirements, from :data:`PRIOR`.
        requirements: What is asked for.
        time_s: Length of the track, s.
        rate_hz: Rate of its measurements.
        speed_mps: Speed of its approach.

    Raises:
        FormationError: The name is unknown, or the approach reaches the emitter or has no two
            epochs.
    """
    if name == "track":
        flight = approach(requirements.range_m, speed_mps, time_s, rate_hz, PRIOR)
        return track(requirements, flight)
    static = {"rms": rms, "determinant": determinant}
    if name not in static:
        raise FormationError(f"There is no objective {name!r}; there are rms, determinant, track.")
    return static[name](requirements)


def report(
    requirements: Requirements,
    objective: Objective,
    name: str = "optimal",
    *,
    time_s: float = 10.0,
    rate_hz: float = 10.0,
) -> DesignReport:
    """Judge one design, and compare it with the others.

    Args:
        requirements: What is asked for.
        objective: What counts.
        name: Name of the design, in :data:`~swarmctl.formation.designs.DESIGNS`.
        time_s: Duration of the measurements, s, > 0.
        rate_hz: Rate of the measurements, 1/s, > 0.

    Raises:
        FormationError: The design is unknown or does not fit the requirements, or time or rate
            is not positive.
    """
    if name not in DESIGNS:
        raise FormationError(f"There is no design {name!r}; there are {', '.join(DESIGNS)}.")
    design = DESIGNS[name](requirements, objective)
    best = objective(DESIGNS["optimal"](requirements, objective))
    compared, unfit = {}, {}
    for other, make in DESIGNS.items():
        try:
            value = objective(make(requirements, objective))
            compared[other] = float(value / best) if math.isfinite(best) else math.nan
        except FormationError as error:
            unfit[other] = str(error)
    accuracy = predicted_accuracy(
        design, requirements.range_m, requirements.noise, time_s=time_s, rate_hz=rate_hz
    )
    return DesignReport(
        name,
        design,
        slots_in_los_frame(design),
        float(accuracy.along_m),
        float(accuracy.cross_m),
        time_s,
        rate_hz,
        float(objective(design)),
        compared,
        unfit,
    )
