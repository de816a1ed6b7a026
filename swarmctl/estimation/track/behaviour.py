"""How the emitter and the receivers are taken to behave: what every filter is told."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import as_finite
from swarmctl.estimation.model.receiver_errors import Layout, ReceiverErrors
from swarmctl.estimation.track.manoeuvre import Manoeuvre
from swarmctl.units import Array


class Behaviour:
    """The motion model of the emitter and the error model of the receivers.

    Attributes:
        process_noise: Spectral density of the emitter's acceleration per axis, (d,), m²/s³.
        errors: The receivers' error model besides white noise.
        manoeuvre: How the emitter may change its mind; None if it does not.

    Args:
        process_noise: As above, 2 or 3 numbers >= 0.
        errors: As above.
        manoeuvre: As above.

    Raises:
        EstimationError: The process noise is something else.
    """

    def __init__(
        self,
        process_noise: Sequence[float],
        errors: ReceiverErrors | None = None,
        manoeuvre: Manoeuvre | None = None,
    ) -> None:
        self.process_noise = as_finite("process_noise", process_noise, None)
        if self.d not in {2, 3} or not (self.process_noise >= 0.0).all():
            raise EstimationError(
                f"process_noise must be 2 or 3 numbers >= 0, not {list(process_noise)}."
            )
        self.errors = ReceiverErrors() if errors is None else errors
        self.manoeuvre = manoeuvre

    @property
    def d(self) -> int:
        """Axes."""
        return self.process_noise.size

    @property
    def layout(self) -> Layout:
        """Places of a receiver's states."""
        return self.errors.layout(self.d)

    @property
    def process_noises(self) -> Array:
        """Process noise of each model of motion, (models, d), m²/s³."""
        if self.manoeuvre is None:
            return self.process_noise[None]
        return np.stack([self.process_noise, self.process_noise + self.manoeuvre.psd(self.d)])
