"""What a filter must be able to do for the epoch loop of a track to run it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from swarmctl.estimation.estimate import Counts, Estimate, Limits
from swarmctl.estimation.integrity.gate import Screened
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.rows import Rows
from swarmctl.units import Array


class Residual(NamedTuple):
    """Measured less predicted range differences by one mode.

    Attributes:
        nu: (K,), m.
        S: Covariance of nu, (K, K), m².
    """

    nu: Array
    S: Array


class Kernel(Protocol):
    """A filter, as :class:`~swarmctl.estimation.track.track.Track` runs it.

    The track calls :meth:`begin`, then for the rows of every epoch :meth:`collect` and, unless
    that keeps them, :meth:`innovate` and :meth:`update` of the same rows.

    Attributes:
        epoch_s: Epoch of the newest rows, s; minus infinity before the first.
        process_noise: Spectral density of the emitter's acceleration per axis, (d,), m²/s³.
    """

    epoch_s: float
    process_noise: Array

    @property
    def has_estimate(self) -> bool:
        """Whether there is an estimate."""

    @property
    def is_resolved(self) -> bool:
        """Whether there is one estimate and no alternative to it."""

    def begin(self, prior: Prior) -> None:
        """Forget everything, and begin from a prior that holds at the next epoch."""

    def collect(self, rows: Rows) -> Counts | None:
        """Keep the rows of an epoch for later, if one epoch alone says too little yet.

        Returns:
            What became of the rows collected so far, none of it counted before; None if these
            rows are not kept and are to be used at once.
        """

    def coast(self, epoch_s: float) -> None:
        """Let time pass up to an epoch without a measurement."""

    def innovate(self, rows: Rows) -> Sequence[Residual]:
        """Predict to the rows' epoch and compare: one residual per mode, most probable first.

        Raises:
            EstimationError: The filter cannot take such rows.
        """

    def tells_echoes(self, S: Array, rows: Rows) -> bool:
        """Whether a residual of covariance S, (K, K), m², is fit to be screened and judged."""

    def update(self, rows: Rows, screened: Screened, mode: int) -> None:
        """Use the rows that :meth:`innovate` was given.

        Args:
            rows: All rows, those set aside included.
            screened: Which of them are kept.
            mode: Place of the mode that screened them, among the residuals.

        Raises:
            EstimationError: The rows' numbers have no finite result.
        """

    def estimates(self) -> list[Estimate]:
        """What is known at :attr:`epoch_s`, the most probable first; empty if nothing is."""

    def predict_to(self, epoch_s: float) -> Estimate:
        """The most probable mode at an epoch; there must be an estimate."""

    def mixture_to(self, epoch_s: float) -> Estimate:
        """As :meth:`predict_to`, with the covariance of all modes together about that mean."""

    def limits(self) -> Limits:
        """What limits the accuracy now; there must be an estimate."""

    def relative(self, receiver: int, to: int) -> tuple[Array, Array]:
        """Errors of a receiver less those of another, and their covariance, SI.

        Raises:
            EstimationError: One of the two has not been heard.
        """
