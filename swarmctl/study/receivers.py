"""Receivers whose errors are not white: clocks, navigation, coloured errors and echoes.

The errors that :mod:`~swarmctl.estimation.model.receiver_errors` models are drawn here. The
engagement's own noise (:func:`~swarmctl.study.engagement.measure`) is white.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from swarmctl.estimation.model.range_difference import range_differences
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.study.batch_filter import Scan, Truth
from swarmctl.study.engagement import Moment
from swarmctl.units import Array

ECHO_M = (50.0, 300.0)
"""What an echo adds to a range difference: uniform, m."""
_NOTHING_M = 1e6
"""1-sigma of a range difference that tells nothing, m: filters are given such ones in a silence,
because they know nothing but scans."""


@dataclass(frozen=True)
class SimulatedReceivers:
    """The errors of all receivers, which are alike.

    Attributes:
        arrival_m: 1-sigma of the white noise of an arrival, m; a range difference (RD) has
            sqrt(2) of it, half of the variance being the reference's.
        position_m: 1-sigma of the white noise of a reported position per axis, m.
        errors: The errors that are not white.
        echoes: Share of the RDs that are echoes.
    """

    arrival_m: float = 0.5 * math.sqrt(0.5)
    position_m: float = 0.5
    errors: ReceiverErrors = field(default_factory=ReceiverErrors)
    echoes: float = 0.0

    def white_covariance(self, companions: int) -> Array:
        """White part of the covariance of the RDs about those at reported positions, (N, N), m²."""
        variance = self.arrival_m**2 + self.position_m**2
        return variance * (np.eye(companions) + 1.0)

    def all_white(self) -> SimulatedReceivers:
        """White errors of the same total sigmas: what a filter is told that knows no others."""
        errors = self.errors
        return replace(
            self,
            arrival_m=math.hypot(self.arrival_m, errors.bias_m, errors.colour_m),
            position_m=math.hypot(self.position_m, errors.navigation_m),
            errors=ReceiverErrors(),
        )


class Heard(NamedTuple):
    """What the receivers report at one epoch, in some runs.

    Attributes:
        time_s: Time since the start.
        moment: The truth.
        positions: Reported positions, the reference UAV's first, (runs, N + 1, 2), m.
        rd: RDs without echoes, (runs, N), m.
        echo: What echoes add to them, (runs, N), m.
        companions: How many of the N are heard, the first ones.
    """

    time_s: float
    moment: Moment
    positions: Array
    rd: Array
    echo: Array
    companions: int


class Reception:
    """The receivers of some runs, with their errors as they are at the newest epoch.

    Args:
        receivers: Their errors.
        runs: How many runs.
        companions: N.
        of_noise: The generator that drives all errors but echoes.
        of_echoes: The generator that drives echoes, so that a feed without them has the same
            noise.
    """

    def __init__(
        self,
        receivers: SimulatedReceivers,
        runs: int,
        companions: int,
        of_noise: np.random.Generator,
        of_echoes: np.random.Generator,
    ) -> None:
        self._receivers = receivers
        self._rng = of_noise
        self._of_echoes = of_echoes
        self._shape = shape = (runs, companions + 1)
        errors = receivers.errors
        self._bias: Array = errors.bias_m * of_noise.standard_normal(shape)
        self._drift: Array = errors.drift_mps * of_noise.standard_normal(shape)
        self._navigation: Array = errors.navigation_m * of_noise.standard_normal((*shape, 2))
        self._colour: Array = errors.colour_m * of_noise.standard_normal(shape)

    def hear(self, time_s: float, moment: Moment, companions: int | None = None) -> Heard:
        """The next epoch.

        Args:
            time_s: Time since the start.
            moment: The truth then.
            companions: How many are heard; None for all.
        """
        self._advance(moment.dt)
        own, rng, (runs, count) = self._receivers, self._rng, self._shape
        rd = range_differences(moment.emitter[..., :2], moment.reference, moment.companions)
        arrival = self._bias + self._colour + own.arrival_m * rng.standard_normal(self._shape)
        at = np.concatenate([moment.reference[..., None, :], moment.companions], axis=-2)
        noise = own.position_m * rng.standard_normal((runs, count, 2))
        is_echo = self._of_echoes.random((runs, count - 1)) < own.echoes
        echo = self._of_echoes.uniform(*ECHO_M, (runs, count - 1))
        return Heard(
            time_s,
            moment,
            at + self._navigation + noise,
            rd + arrival[:, 1:] - arrival[:, :1],
            np.where(is_echo, echo, 0.0),
            count - 1 if companions is None else companions,
        )

    def _advance(self, dt: float) -> None:
        errors = self._receivers.errors
        self._bias = self._bias + dt * self._drift
        self._navigation = self._walked(
            self._navigation, errors.navigation_m, errors.navigation_tau_s, dt
        )
        self._colour = self._walked(self._colour, errors.colour_m, errors.colour_tau_s, dt)

    def _walked(self, error: Array, sigma: float, tau_s: float, dt: float) -> Array:
        """A first-order Gauss-Markov process, dt later."""
        keep = math.exp(-dt / tau_s)
        fresh = self._rng.standard_normal(error.shape)
        return keep * error + math.sqrt(1.0 - keep * keep) * sigma * fresh


def scan_of(heard: Heard, receivers: SimulatedReceivers) -> Scan:
    """The scan for a filter that knows white noise only, with echoes."""
    told, moment = receivers.all_white(), heard.moment
    count = heard.companions or heard.rd.shape[-1]
    sigma_m = told.arrival_m if heard.companions else _NOTHING_M
    companions = moment.companions[..., :count, :]
    return Scan(
        moment.dt,
        heard.positions[:, 0],
        moment.velocity,
        heard.positions[:, 1 : count + 1],
        (heard.rd + heard.echo)[:, :count],
        sigma_m**2 * (np.eye(count) + 1.0),
        told.position_m,
        Truth(
            companions - moment.reference[..., None, :],
            range_differences(moment.emitter[..., :2], moment.reference, companions),
        ),
    )
