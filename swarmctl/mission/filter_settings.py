"""What a mission file says of the emitter and the receivers, in the estimator's terms."""

from __future__ import annotations

import math

import numpy as np

from swarmctl.estimation.filters import FILTERS, Filters
from swarmctl.estimation.model.prior import Prior, sector
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.estimation.track.manoeuvre import Manoeuvre
from swarmctl.estimation.track.track import Track
from swarmctl.mission.mission_file import Mission
from swarmctl.units import SPEED_OF_LIGHT_MPS, Vector

M_PER_NS = 1e-9 * SPEED_OF_LIGHT_MPS
VERTICAL_SPEED_SIGMA_MPS = 0.001
"""The emitter floats or stands: what moves it vertically in the mission's frame is the sea, which
curves away below it by 0.4 mm in a metre of drift at 2.5 km."""


def expected_enu(mission: Mission) -> Vector:
    """Where the emitter is expected before any measurement, ENU, m."""
    east, north, up, *_ = emitter_prior(mission).mean.tolist()
    return (east, north, up)


def emitter_prior(mission: Mission) -> Prior:
    """The mission's prior on the emitter's position and velocity, ENU, SI."""
    emitter = mission.emitter
    prior = _about_a_place(mission) if emitter.sector is None else _in_a_sector(mission)
    prior.covariance[5, 5] = VERTICAL_SPEED_SIGMA_MPS**2
    return prior


def _about_a_place(mission: Mission) -> Prior:
    emitter = mission.emitter
    if emitter.lat_deg is None or emitter.lon_deg is None or emitter.sigma_m is None:
        raise ValueError("A prior about a place has lat_deg, lon_deg and sigma_m.")
    mean = np.zeros(6)
    mean[:3] = mission.frame.to_enu(
        math.radians(emitter.lat_deg), math.radians(emitter.lon_deg), emitter.alt_amsl_m
    )
    level, height, speed = emitter.sigma_m, emitter.altitude_sigma_m, emitter.speed_sigma_mps
    return Prior(mean, np.diag([level, level, height, speed, speed, speed]) ** 2)


def _in_a_sector(mission: Mission) -> Prior:
    emitter = mission.emitter
    if emitter.sector is None:
        raise ValueError("There is no sector.")
    where = emitter.sector
    # The surface curves away: what of that the middle's height misses is part of the spread.
    near, far = (
        mission.frame.up_at(range_m, 0.0, emitter.alt_amsl_m)
        for range_m in (where.nearest_m, where.farthest_m)
    )
    return sector(
        np.zeros(2),
        math.radians(90.0 - where.bearing_deg),
        math.radians(0.5 * where.width_deg),
        where.nearest_m,
        where.farthest_m,
        emitter.speed_sigma_mps,
        (0.5 * (near + far), math.hypot(emitter.altitude_sigma_m, 0.5 * (near - far))),
    )


def process_noise(mission: Mission) -> tuple[float, float, float]:
    """Power spectral density of the emitter's acceleration, east, north, up, m²/s³."""
    density = mission.filter.process_noise_mps_per_sqrt_s**2
    return (density, density, 0.0)


def receiver_errors(mission: Mission) -> ReceiverErrors:
    """The error model of the receivers besides white noise."""
    model = mission.filter
    return ReceiverErrors(
        bias_m=M_PER_NS * model.clock_bias_ns,
        drift_mps=M_PER_NS * model.clock_drift_ns_per_s,
        navigation_m=model.navigation_sigma_m,
        navigation_tau_s=model.navigation_tau_s,
        colour_m=model.colour_sigma_m,
        colour_tau_s=model.colour_tau_s,
    )


def new_track(mission: Mission, filters: Filters = FILTERS) -> Track:
    """The track that the mission asks for, begun from its prior.

    Args:
        mission: Its ``filter.kind`` names one of the filters.
        filters: What there is to choose from.
    """
    model = mission.filter
    speed = model.manoeuvre_speed_mps
    behaviour = Behaviour(
        process_noise(mission),
        receiver_errors(mission),
        Manoeuvre(speed, is_level=True) if speed > 0.0 else None,
    )
    return filters.track(model.kind, emitter_prior(mission), behaviour)
