"""What a made-up flight's receivers are off, and what a made-up track makes of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal

import numpy as np

from swarmctl import decisions, events
from swarmctl.events import Record
from swarmctl.units import Vector
from tests.recorder import flight as made_up

RECEIVERS = (made_up.REFERENCE, *made_up.FOLLOWERS)
CLOCKS = {1: (2.0, 0.01), 2: (-3.0, 0.05), 3: (1.0, -0.03), 4: (6.0, 0.0)}
"""Bias at mission time 0, m, and drift, m/s, by receiver."""
BEGIN_S, END_S = 40.0, 270.0


def clock(sysid: int, t: float) -> float:
    bias, drift = CLOCKS[sysid]
    return bias + drift * t


def navigation(sysid: int, t: float) -> Vector:
    return (
        0.8 * math.sin(0.02 * t + sysid),
        0.6 * math.cos(0.03 * t + 2.0 * sysid),
        0.1 * sysid,
    )


def truth(sysid: int, t: float) -> events.ReceiverTruth:
    return events.ReceiverTruth(
        received_s=t + 0.02,
        epoch_utc_s=made_up.UTC_S + t,
        receiver=sysid,
        clock_m=clock(sysid, t),
        drift_mps=CLOCKS[sysid][1],
        navigation_enu=navigation(sysid, t),
    )


def estimate(
    sysid: int, t: float, error: Vector = (0.0, 0.0, 0.0), *, relative_to: int = 1
) -> decisions.ReceiverEstimate:
    """The truth plus some sigmas of clock, east and north; the sigmas shrink."""
    sigma = 0.5 + 4.0 * math.exp(-(t - BEGIN_S) / 30.0)
    near = 0.3 + 0.4 * math.exp(-(t - BEGIN_S) / 60.0)
    (e, n, u), (e0, n0, u0) = navigation(sysid, t), navigation(relative_to, t)
    return decisions.ReceiverEstimate(
        at_s=t + 0.2,
        epoch_utc_s=made_up.UTC_S + t,
        receiver=sysid,
        relative_to=relative_to,
        clock_m=clock(sysid, t) - clock(relative_to, t) + sigma * error[0],
        clock_sigma_m=sigma,
        drift_mps=CLOCKS[sysid][1] - CLOCKS[relative_to][1],
        drift_sigma_mps=0.01,
        navigation_enu=(e - e0 + near * error[1], n - n0 + 1.5 * near * error[2], u - u0),
        navigation_sigma_enu=(near, 1.5 * near, near),
    )


def records() -> Iterator[Record]:
    """Once a second, truth of all receivers all the time and estimates while there is a track."""
    random = np.random.default_rng(8)
    errors = {sysid: np.zeros(3) for sysid in RECEIVERS}
    for t in range(round(made_up.END_S)):
        for sysid in RECEIVERS:
            yield truth(sysid, float(t))
        if not BEGIN_S <= t < END_S:
            continue
        for sysid in RECEIVERS:
            errors[sysid] = 0.95 * errors[sysid] + 0.31 * random.standard_normal(3)
            e0, e1, e2 = errors[sysid].tolist()
            yield estimate(sysid, float(t), (e0, e1, e2))


def health(
    t: float, status: Literal["initialising", "tracking", "degraded", "diverged"]
) -> decisions.HealthChanged:
    return decisions.HealthChanged(at_s=t, status=status, cause=None, detail="-")


def whole_flight() -> list[Record]:
    """The made-up flight with its receivers, in the order of time."""
    told = [
        health(31.0, "initialising"),
        health(42.0, "tracking"),
        health(120.0, "degraded"),
        health(140.0, "diverged"),
        health(150.0, "tracking"),
        health(200.0, "degraded"),
        health(215.0, "tracking"),
    ]
    every = [*made_up.records(), *records(), *told]
    return sorted(every, key=lambda r: getattr(r, "received_s", getattr(r, "at_s", 0.0)))
