"""What is known of the emitter, and what became of the measurements: the types others are given."""

from __future__ import annotations

from typing import NamedTuple

from swarmctl.units import Array


class Measured(NamedTuple):
    """The range differences (RDs) that one update was given, one entry per companion.

    Attributes:
        epoch_s: Their epoch, s.
        reference: Id of the receiver that all are differenced against.
        receivers: Ids of the companions.
        sigma_m: White 1-sigma of each RD, m.
        rho: Share of each variance that comes from the reference receiver, [0, 1).
    """

    epoch_s: float
    reference: int
    receivers: tuple[int, ...]
    sigma_m: tuple[float, ...]
    rho: tuple[float, ...]


class Estimate(NamedTuple):
    """The emitter's state at an epoch, and what the last update made it from.

    Attributes:
        epoch_s: Epoch of the state, s.
        x: Position (m) and velocity (m/s), (2d,).
        P: Their covariance, (2d, 2d), SI.
        probability: Probability that the emitter is here and not at one of the alternatives.
        manoeuvre: Probability that the emitter is manoeuvring.
        nis: Normalised innovation squared of the last update: chi-squared with ``rd_count``
            degrees of freedom if the filter is consistent.
        rd_count: RDs of the last update that were not set aside.
        measured: What the last update was given; None where that is not known.
    """

    epoch_s: float
    x: Array
    P: Array
    probability: float = 1.0
    manoeuvre: float = 0.0
    nis: float = 0.0
    rd_count: int = 0
    measured: Measured | None = None


class Limits(NamedTuple):
    """How much of the position's variance would go if something were known, as shares of it.

    Attributes:
        clock: If the clocks' biases and drifts were known.
        navigation: If the receivers' positions were.
        colour: If the coloured errors were.
    """

    clock: float
    navigation: float
    colour: float


class Counts(NamedTuple):
    """What became of the range differences.

    Attributes:
        used: Range differences used.
        aside: Range differences set aside as echoes.
        repeated: Range differences left out as copies of earlier ones.
        dropped: Range differences and arrival times that never reached the track.
    """

    used: int = 0
    aside: int = 0
    repeated: int = 0
    dropped: int = 0
