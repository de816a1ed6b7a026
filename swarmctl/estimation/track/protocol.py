"""What tracks one emitter, as those see it who feed it and those who rely on it."""

from __future__ import annotations

from typing import Protocol

from swarmctl.estimation.integrity.health import Verdict
from swarmctl.estimation.kernels.augmented import Rows
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.track.modes import Estimate, Limits
from swarmctl.units import Array


class Track(Protocol):
    """:class:`~swarmctl.estimation.track.track.Estimator` and what can stand in for it.

    Attributes:
        epoch_s: Of the newest rows, s; minus infinity before the first.
        verdict: Health after the newest rows.
        innovation: Whitened innovation of the newest rows that were kept.
        used: Rows used.
        aside: Rows set aside as echoes.
        repeated: Rows left out as copies of earlier ones.
    """

    epoch_s: float
    verdict: Verdict
    innovation: Array
    used: int
    aside: int
    repeated: int

    @property
    def is_resolved(self) -> bool:
        """Whether there is one estimate and no alternative to it."""

    def update(self, rows: Rows) -> bool:
        """Take the rows of an epoch; is there an estimate?"""

    def estimates(self) -> list[Estimate]:
        """What is known at the newest epoch, the most probable first; empty if nothing is."""

    def mixture_to(self, epoch_s: float) -> Estimate:
        """The most probable mode at an epoch, with the covariance of all modes about it."""

    def restart(self, prior: Prior) -> None:
        """Forget everything but the counts, and begin from a prior at the next epoch."""

    def limits(self) -> Limits:
        """What limits the accuracy now."""

    def relative(self, receiver: int, to: int) -> tuple[Array, Array]:
        """Errors of a receiver less those of another, and their covariance."""
