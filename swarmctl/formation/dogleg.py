"""Dog-legs: whether the reference UAV should fly at an angle to the line of sight for a while.

Flying straight at the emitter brings the swarm near, and information grows steeply as the range
falls. Flying across the line of sight (LOS) turns it, which triangulates the range and parts it
from the velocity, but comes no nearer. Which of the two is worth more depends on how well the
formation sees the range by itself, on what is known already and on how soon it is to be known.

So both are predicted: the posterior Cramer-Rao bound (:mod:`swarmctl.estimation.bounds.pcrb`)

    P <- F P F^T + Q,        P <- (P^-1 + dt f H^T C^-1 H)^-1

from the estimate's covariance now, along each course: a leg at a constant angle to the LOS, then
straight to the orbit and round it, the formation turning with the LOS. At a constant angle a the
path is a logarithmic spiral about the emitter, in polar coordinates (r, phi)

    r = r_0 - v t cos a,        phi = phi_0 - tan a ln(r_0 / r).

Courses are compared at the time at which the straight flight would have located the emitter as
well as is wanted: a course that is ahead then gets there sooner. At the latest that is when the
straight flight from where the approach began would have been all through, or, later than that,
when it arrives from here. Were the orbit counted anew each time, it would always be best to fly
across now and straight later.

The prediction is that of a filter linearised at the estimate: true if the LOS's direction and
range are known to a fraction. While the range's 1-sigma is of the order of the range itself the
predicted metres mean little, but all courses are in error alike and only their ratio counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swarmctl.errors import FormationError
from swarmctl.estimation.model.motion import process_noise, transition
from swarmctl.estimation.model.range_difference import jacobian
from swarmctl.formation.information import noise_covariance
from swarmctl.formation.requirements import Noise
from swarmctl.units import Array

ANGLES_RAD = tuple(math.radians(a) for a in (-20, 20, -40, 40, -60, 60, -90, 90))
"""Courses tried, from the LOS counter-clockwise."""
LEG_SHARES = (0.1, 0.2, 0.4)
"""Lengths of the leg tried, as shares of the time the straight approach takes."""
EPOCHS = 30
"""Steps of the prediction, short ones first."""
WORTH = 0.9
"""A course is taken up if it leaves less than this share of the RMS error of the one flown."""
EVERY_S = 5.0
"""How often courses are compared, s."""
LEAST_APPROACH_S = 20.0
"""With less of the approach left than this a dog-leg is not worth the turn, s."""


@dataclass(frozen=True)
class Terms:
    """What stays the same for a whole flight.

    Attributes:
        noise: Noise of the range differences.
        rate_hz: Epochs of range differences a second; their errors are white.
        acceleration_psd: Spectral density of the emitter's acceleration per axis, m²/s³.
        cruise_mps: Speed of the reference UAV on its way, m/s.
        wanted_m: RMS position error that is wanted, m.
        observe_s: How long the orbit is flown, s.
        fence_m: Greatest distance of the reference UAV from the origin on a dog-leg, m.
    """

    noise: Noise
    rate_hz: float
    acceleration_psd: float
    cruise_mps: float
    wanted_m: float
    observe_s: float
    fence_m: float


class Situation(NamedTuple):
    """What is known at one instant. East and north, m and m/s; the geofence's centre is the origin.

    Attributes:
        reference: Position of the reference UAV, (2,).
        emitter: Estimated position and velocity, (4,).
        covariance: Covariance of the estimate, (4, 4), positive definite.
        offsets: Slots of the companions from the reference UAV, (N, 2).
        radius_m: Radius of the orbit.
        orbit_mps: Speed of the reference UAV on it.
    """

    reference: Array
    emitter: Array
    covariance: Array
    offsets: Array
    radius_m: float
    orbit_mps: float


class Prediction(NamedTuple):
    """What a set of courses leads to.

    Attributes:
        times_s: From now, (K,), s.
        path: Positions of the reference UAV, (..., K, 2), m.
        rms_m: RMS of the position error by the bound, (..., K), m.
    """

    times_s: Array
    path: Array
    rms_m: Array


def predict(
    terms: Terms, now: Situation, angles_rad: Array, legs_s: Array, horizon_s: float
) -> Prediction:
    """Predict the estimate along courses: a leg each, then straight to the orbit and round it.

    The flight is as :func:`~swarmctl.formation.guidance.approach_and_orbit` has it, about an
    emitter that keeps the estimated velocity. The emitter's height is neglected.

    Args:
        terms: What stays the same.
        now: What is known.
        angles_rad: Angles of the legs from the LOS, counter-clockwise, (...), rad.
        legs_s: How long each is flown, (...), s.
        horizon_s: How far ahead to look, s.

    Raises:
        FormationError: The reference UAV is on the orbit already or inside it, or a leg leads
            inside it.
    """
    speed, radius = terms.cruise_mps, now.radius_m
    east, north = now.reference - now.emitter[:2]
    start = math.hypot(east, north)
    turns = start - speed * legs_s * np.cos(angles_rad)
    if not (start > radius and np.all(turns >= radius)):
        raise FormationError(
            f"A dog-leg needs its way to the orbit of {radius:g} m; it starts {start:g} m from"
            " the emitter."
        )
    angle, leg, turn = angles_rad[..., None], legs_s[..., None], turns[..., None]
    times = horizon_s * (np.arange(1, EPOCHS + 1) / EPOCHS) ** 1.5
    on_leg = np.minimum(times, leg)
    after = np.maximum(times - leg, 0.0)
    ranges = np.where(
        times < leg,
        start - speed * on_leg * np.cos(angle),
        np.maximum(turn - speed * after, radius),
    )
    # The spiral's phi - phi_0 = -v t sin a (mean of 1/r), which also holds across the LOS.
    closed = speed * on_leg * np.cos(angle) / start
    flat = np.abs(closed) < 1e-9
    mean = np.where(flat, 1.0, -np.log1p(-closed) / np.where(flat, 1.0, closed)) / start
    orbiting = np.maximum(after - (turn - radius) / speed, 0.0)
    phi = (
        math.atan2(north, east)
        - speed * on_leg * np.sin(angle) * mean
        + now.orbit_mps / radius * orbiting
    )
    out = np.stack((np.cos(phi), np.sin(phi)), axis=-1)
    emitter = now.emitter[:2] + times[:, None] * now.emitter[2:]
    return Prediction(
        times, emitter + ranges[..., None] * out, _rms(terms, now, times, ranges, out)
    )


def _rms(terms: Terms, now: Situation, times: Array, ranges: Array, out: Array) -> Array:
    """RMS position error after each epoch, (..., K), m."""
    # Slots in the frame of the LOS, x towards the emitter, as they are drawn now.
    x = now.emitter[:2] - now.reference
    x = x / math.hypot(*x)
    slots = now.offsets @ np.array([[x[0], -x[1]], [x[1], x[0]]])
    ahead = np.stack((ranges, np.zeros_like(ranges)), axis=-1)
    H = jacobian(ahead, np.zeros(2), slots)
    weight = np.linalg.inv(noise_covariance(len(slots), terms.noise))
    axes = np.stack((-out, np.stack((out[..., 1], -out[..., 0]), axis=-1)), axis=-1)
    steps = np.diff(times, prepend=0.0)
    rate = (terms.rate_hz * steps)[:, None, None]
    information = rate * (axes @ (H.mT @ (weight @ H)) @ axes.mT)

    P = np.broadcast_to(now.covariance, (*ranges.shape[:-1], 4, 4))
    psd = np.full(2, terms.acceleration_psd)
    rms = np.empty(ranges.shape)
    for k, step in enumerate(steps.tolist()):
        F = transition(step, 2)
        P = F @ P @ F.T + process_noise(step, psd)
        # By Woodbury's identity; the information of a single range difference has no inverse.
        J = information[..., k, :, :]
        columns = P[..., :2]
        P = P - columns @ np.linalg.solve(np.eye(2) + J @ columns[..., :2, :], J) @ columns.mT
        P = 0.5 * (P + P.mT)
        rms[..., k] = np.sqrt(P[..., 0, 0] + P[..., 1, 1])
    return rms


class DogLegs:
    """Chooses the course of the approach, with hysteresis.

    Args:
        terms: What stays the same.

    Attributes:
        course_rad: The course flown, from the LOS counter-clockwise; 0 is straight.
    """

    def __init__(self, terms: Terms) -> None:
        self._terms = terms
        self._wait_s = 0.0
        self._left_s = math.nan
        self.course_rad = 0.0

    def follow(self, now: Situation, dt: float) -> float:
        """The course to fly now; compared anew every ``EVERY_S``.

        Args:
            now: What is known.
            dt: Control period, s.
        """
        self._wait_s -= dt
        self._left_s -= dt
        if self._wait_s <= 0.0:
            self._wait_s = EVERY_S
            self.course_rad = self._choose(now)
        return self.course_rad

    def _choose(self, now: Situation) -> float:
        terms = self._terms
        distance = math.dist(now.reference, now.emitter[:2])
        approach_s = (distance - now.radius_m) / terms.cruise_mps
        if approach_s < LEAST_APPROACH_S:
            return 0.0
        if math.isnan(self._left_s):
            self._left_s = approach_s + terms.observe_s
        angles = np.repeat([0.0, *ANGLES_RAD], len(LEG_SHARES))
        legs = np.tile(approach_s * np.array(LEG_SHARES), 1 + len(ANGLES_RAD))
        predicted = predict(terms, now, angles, legs, max(self._left_s, approach_s))
        straight = predicted.rms_m[0]
        wanted = straight <= terms.wanted_m
        at = int(np.argmax(wanted)) if wanted.any() else -1
        left = predicted.rms_m[:, at] / straight[at]
        left[self._outside(predicted.path, legs, predicted.times_s)] = math.inf
        flown = float(left[angles == self.course_rad].min())
        # Back to straight as soon as that is no worse.
        if flown >= 1.0:
            self.course_rad, flown = 0.0, 1.0
        best = float(left.min())
        if best >= WORTH * flown:
            return self.course_rad
        return float(angles[np.argmin(left)])

    def _outside(self, path: Array, legs: Array, times: Array) -> NDArray[np.bool_]:
        """Which legs leave the fence, (...)."""
        beyond = np.hypot(path[..., 0], path[..., 1]) > self._terms.fence_m
        return np.asarray((beyond & (times < legs[..., None])).any(axis=-1))


def turned(
    velocity: tuple[float, float], drift: tuple[float, float], course_rad: float
) -> tuple[float, float]:
    """The velocity of the reference UAV on a dog-leg, m/s.

    Args:
        velocity: That of the straight approach.
        drift: The part of it that is the emitter's own.
        course_rad: Angle of the course from the LOS, counter-clockwise, rad.
    """
    east, north = velocity[0] - drift[0], velocity[1] - drift[1]
    c, s = math.cos(course_rad), math.sin(course_rad)
    return (drift[0] + c * east - s * north, drift[1] + s * east + c * north)
