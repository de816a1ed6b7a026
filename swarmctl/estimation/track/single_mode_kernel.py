"""What filters of one Gaussian and no receiver states share: the NCRKF and the EKF."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np

from swarmctl.estimation.estimate import Counts, Estimate, Limits
from swarmctl.estimation.integrity.gate import Screened
from swarmctl.estimation.kernels import augmented
from swarmctl.estimation.model import motion
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.estimation.model.rows import Rows
from swarmctl.estimation.track.kernel import Residual
from swarmctl.units import Array

_WHITE = ReceiverErrors()


class SingleModeKernel(ABC):
    """A :class:`~swarmctl.estimation.track.kernel.Kernel` of one mean and one covariance.

    It is for receivers with good clocks and white errors, and a prior that is a place: there is
    no search, and nothing but the receivers' positions is taken for known. Rows older than the
    track update the state expressed at their own epoch, which then returns to the track's; the
    process noise of the few seconds between is neglected.

    Attributes:
        epoch_s: Epoch of the newest rows, s; minus infinity before the first.
        process_noise: As given.

    Args:
        process_noise: Spectral density of the emitter's acceleration per axis, (d,), m²/s³.
    """

    def __init__(self, process_noise: Array) -> None:
        self.process_noise = process_noise
        self.epoch_s = -math.inf
        self._layout = _WHITE.layout(process_noise.size)
        self._x: Array = np.zeros(0)
        self._P: Array = np.zeros((0, 0))
        self._predicted: tuple[Array, Array] = self._x, self._P

    @abstractmethod
    def use(self, x: Array, P: Array, rows: Rows, screened: Screened) -> tuple[Array, Array]:
        """Measurement update of a state at the rows' epoch.

        Args:
            x: Predicted state, (2d,).
            P: Its covariance, (2d, 2d).
            rows: All rows.
            screened: Which of them are kept.

        Returns:
            Updated x and P.
        """

    @abstractmethod
    def tells_echoes(self, S: Array, rows: Rows) -> bool:
        """As :meth:`swarmctl.estimation.track.kernel.Kernel.tells_echoes`."""

    @property
    def has_estimate(self) -> bool:
        """Whether there is an estimate: from the first rows on."""
        return self.epoch_s > -math.inf

    @property
    def is_resolved(self) -> bool:
        """Whether there is an estimate: there are no alternatives to it."""
        return self.has_estimate

    def begin(self, prior: Prior) -> None:
        """Forget everything, and begin from a prior at the next epoch."""
        self._x, self._P = prior
        self.epoch_s = -math.inf

    def collect(self, rows: Rows) -> Counts | None:
        """Nothing: every epoch is used at once."""
        return None

    def coast(self, epoch_s: float) -> None:
        """Let time pass up to an epoch without a measurement."""
        if epoch_s > self.epoch_s:
            self._x, self._P = self._at(epoch_s)
            self.epoch_s = epoch_s

    def innovate(self, rows: Rows) -> list[Residual]:
        """As :meth:`swarmctl.estimation.track.kernel.Kernel.innovate`: one residual."""
        x, P = self._predicted = self._at(rows.epoch_s)
        nu, _, S = augmented.innovate(x, P, rows, {}, self._layout)
        return [Residual(nu, S)]

    def update(self, rows: Rows, screened: Screened, mode: int) -> None:
        """As :meth:`swarmctl.estimation.track.kernel.Kernel.update`."""
        x, P = self.use(*self._predicted, rows, screened)
        epoch_s = max(self.epoch_s, rows.epoch_s)
        self._x, self._P = motion.transport(x, P, epoch_s - rows.epoch_s)
        self.epoch_s = epoch_s

    def estimates(self) -> list[Estimate]:
        """What is known at :attr:`epoch_s`; empty before the first rows."""
        return [Estimate(self.epoch_s, self._x, self._P)] if self.has_estimate else []

    def predict_to(self, epoch_s: float) -> Estimate:
        """The estimate at another epoch; an earlier one without process noise."""
        return Estimate(epoch_s, *self._at(epoch_s))

    def mixture_to(self, epoch_s: float) -> Estimate:
        """As :meth:`predict_to`: there is one mode."""
        return self.predict_to(epoch_s)

    def limits(self) -> Limits:
        """Nothing that is modelled but noise."""
        return Limits(0.0, 0.0, 0.0)

    def relative(self, receiver: int, to: int) -> tuple[Array, Array]:
        """No errors of receivers are modelled: (0,) and (0, 0)."""
        return np.zeros(0), np.zeros((0, 0))

    def predicted(self, x: Array, P: Array, dt: float) -> tuple[Array, Array]:
        """Time update by ``dt`` seconds, >= 0."""
        return motion.predict(x, P, dt, self.process_noise)

    def _at(self, epoch_s: float) -> tuple[Array, Array]:
        if not self.has_estimate:
            return self._x, self._P
        dt = epoch_s - self.epoch_s
        if dt < 0.0:
            return motion.transport(self._x, self._P, dt)
        return self.predicted(self._x, self._P, dt)
