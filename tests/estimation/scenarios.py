"""The engagements the filter is judged on, and a Monte Carlo flight through them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from swarmctl.estimation.bounds.pcrb import CramerRaoBound
from swarmctl.estimation.kernels import ncrkf
from swarmctl.estimation.model import motion
from swarmctl.estimation.model.motion import ConstantVelocity
from swarmctl.estimation.model.range_difference import range_differences
from swarmctl.units import Array


class Engagement(NamedTuple):
    """True motion; time is the first axis, trials may follow."""

    epochs_s: Array  # (K,)
    emitter: Array  # (K, ..., 2d): position and velocity
    reference: Array  # (K, ..., d)
    companions: Array  # (K, ..., N, d)


class Record(NamedTuple):
    """What a flight leaves behind at the epochs asked for; trials on the second axis."""

    error: Array  # (R, runs, 2d)
    covariance: Array  # (R, runs, 2d, 2d)
    bound: Array  # (R, ..., 2d, 2d)
    nis: Array  # (R, runs)
    guarded: int

    def rmse_to_bound(self) -> Array:
        """RMSE of the horizontal position over the root of the bound's trace, (R,)."""
        squared = (self.error[..., :2] ** 2).sum(-1).mean(-1)
        trace = np.linalg.trace(self.bound[..., :2, :2])
        ratio: Array = np.sqrt(squared / trace.reshape(len(trace), -1).mean(-1))
        return ratio


def formation(
    reference: Array, los_rad: Array | float, angles_rad: list[float], d_m: float
) -> Array:
    """Companions (..., N, 2) around the reference, at angles from the line of sight."""
    direction = np.asarray(los_rad)[..., None] + np.array(angles_rad)
    companions: Array = reference[..., None, :] + d_m * np.stack(
        [np.cos(direction), np.sin(direction)], axis=-1
    )
    return companions


def table_1() -> Engagement:
    """The paper's Table 1 with formation (29), guided as in docs/explanation: 16 s at 50 Hz.

    Pure proportional navigation with gain 3; the formation turns with the true line of sight.
    """
    period, speed, gain = 0.02, 270.0, 3.0
    emitter = np.array([0.0, 0.0])
    velocity = 20.0 * np.array([math.cos(math.radians(135)), math.sin(math.radians(135))])
    reference = np.array([-5000.0, 0.0])
    heading = math.radians(30)
    epochs, emitters, references, companions = [], [], [], []
    for k in range(801):
        line = emitter - reference
        los = math.atan2(line[1], line[0])
        epochs.append(k * period)
        emitters.append(np.concatenate([emitter, velocity]))
        references.append(reference)
        companions.append(formation(reference, los, [-math.pi / 2, 0.0, math.pi / 2], 300.0))
        closing = velocity - speed * np.array([math.cos(heading), math.sin(heading)])
        los_rate = (line[0] * closing[1] - line[1] * closing[0]) / (line @ line)
        heading += gain * los_rate * period
        reference = reference + period * speed * np.array([math.cos(heading), math.sin(heading)])
        emitter = emitter + period * velocity
    return Engagement(*(np.array(a) for a in (epochs, emitters, references, companions)))


def search_flight(
    rng: np.random.Generator,
    start: Array,
    psd: Array,
    *,
    duration_s: float,
    d_m: float = 285.0,
    range_m: float = 2500.0,
    altitudes_m: tuple[float, ...] = (60.0, 75.0, 90.0, 105.0),
    angles_rad: tuple[float, ...] = (math.pi / 2, -math.pi / 2, math.pi),
) -> Engagement:
    """The real system's flight: approach at 10 m/s to 430 m, then orbit; 10 Hz, 3-D.

    Args:
        rng: Drives the emitter's random walk.
        start: Emitter's true state at the start, (runs, 6); the swarm starts west of the
            origin.
        psd: Density of the emitter's random acceleration, (3,).
        duration_s: Length.
        d_m: Distance of the companions from the reference.
        range_m: Distance of the reference from the origin at the start.
        altitudes_m: Of the reference and the companions, above the emitter's mean height.
        angles_rad: Of the companions from the true line of sight.
    """
    period, speed, standoff = 0.1, 10.0, 430.0
    root = np.linalg.cholesky(motion.process_noise(period, psd) + 1e-18 * np.eye(6))
    F = motion.transition(period, 3)
    state = start
    runs = len(start)
    reference = np.tile([-range_m, 0.0, altitudes_m[0]], (runs, 1))
    epochs, emitters, references, companions = [], [], [], []
    for k in range(1, round(duration_s / period) + 1):
        state = state @ F.T + rng.standard_normal((runs, 6)) @ root.T
        line = state[:, :2] - reference[:, :2]
        distance = np.linalg.norm(line, axis=-1)
        ahead = line / distance[:, None]
        closing = np.clip(0.5 * (distance - standoff), -3.0, speed)
        around = np.sqrt(speed**2 - closing**2) * (distance < 1.2 * standoff)
        across = np.stack([ahead[:, 1], -ahead[:, 0]], axis=-1)
        reference = reference.copy()
        reference[:, :2] += period * (ahead * closing[:, None] + across * around[:, None])
        line = state[:, :2] - reference[:, :2]
        flat = formation(
            reference[:, :2], np.arctan2(line[:, 1], line[:, 0]), list(angles_rad), d_m
        )
        height = np.broadcast_to(np.array(altitudes_m[1:])[:, None], (*flat.shape[:-1], 1))
        epochs.append(k * period)
        emitters.append(state)
        references.append(reference)
        companions.append(np.concatenate([flat, height], axis=-1))
    return Engagement(*(np.array(a) for a in (epochs, emitters, references, companions)))


def fly(
    engagement: Engagement,
    x: Array,
    P: Array,
    *,
    psd: Array,
    rd_covariance: Array,
    sigma_p: float,
    rng: np.random.Generator,
    record: list[int],
) -> Record:
    """Filter a whole batch of trials with white noise and note the epochs ``record``.

    ``x`` (runs, 2d) and ``P`` (2d, 2d) are the prior at the epoch before the first used one;
    epoch 0 of the engagement is used only to measure time from.
    """
    runs, n = x.shape
    d = n // 2
    bound = CramerRaoBound(P, ConstantVelocity(psd.tolist()))
    P = np.broadcast_to(P, (runs, n, n))
    root = np.linalg.cholesky(rd_covariance)
    rows: list[tuple[Array, Array, Array, Array]] = []
    guarded = 0
    epochs, emitters, references, companions = engagement
    for k in range(1, len(epochs)):
        dt = float(epochs[k] - epochs[k - 1])
        x, P = motion.predict(x, P, dt, psd)
        bound.predict(dt)
        e, p_0, p = emitters[k][..., :d], references[k], companions[k]
        bound.update(e, p_0, p, rd_covariance, sigma_p)
        rd = range_differences(e, p_0, p)
        rd = rd + rng.standard_normal((runs, p.shape[-2])) @ root.T
        measured_0 = p_0 + sigma_p * rng.standard_normal((runs, d))
        measured = p + sigma_p * rng.standard_normal((runs, *p.shape[-2:]))
        x, P, nis, fired = ncrkf.update(x, P, measured_0, measured, rd, rd_covariance, sigma_p)
        guarded += int(fired.sum())
        if k in record:
            rows.append((x - emitters[k], P, bound.covariance, nis))
    error, covariance, bounds, nis = (np.stack(column) for column in zip(*rows, strict=True))
    return Record(error, covariance, bounds, nis, guarded)
