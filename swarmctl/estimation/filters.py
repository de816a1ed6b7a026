"""The filters that can track an emitter, by name: for missions, data sets and studies alike."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

from swarmctl.errors import UsageError
from swarmctl.estimation.integrity.gate import GATE
from swarmctl.estimation.model.prior import Prior
from swarmctl.estimation.track.behaviour import Behaviour
from swarmctl.estimation.track.full_kernel import FullKernel
from swarmctl.estimation.track.kernel import Kernel
from swarmctl.estimation.track.ncrkf_kernel import NcrkfKernel
from swarmctl.estimation.track.track import Track

NewKernel = Callable[[Behaviour], Kernel]
"""Makes a filter for an emitter and receivers that behave in some way."""


class Filters(Mapping[str, NewKernel]):
    """A registry of filters; it does not change. :meth:`adding` gives a larger one.

    Args:
        kernels: What makes each filter, by name.
    """

    def __init__(self, kernels: Mapping[str, NewKernel]) -> None:
        self._kernels = MappingProxyType(dict(kernels))

    def __getitem__(self, name: str) -> NewKernel:
        return self._kernels[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._kernels)

    def __len__(self) -> int:
        return len(self._kernels)

    def adding(self, name: str, kernel: NewKernel) -> Filters:
        """These filters and one more."""
        return Filters({**self._kernels, name: kernel})

    def track(self, name: str, prior: Prior, behaviour: Behaviour, *, gate: float = GATE) -> Track:
        """A new track.

        Args:
            name: The filter's name.
            prior: What is known of the emitter at the first epoch.
            behaviour: How emitter and receivers behave.
            gate: Sigmas beyond which an arrival is set aside.

        Raises:
            UsageError: There is no such filter.
            EstimationError: The prior has the wrong shape, is not finite, or is no covariance.
        """
        if name not in self:
            raise UsageError(f"There is no filter {name!r}; there are {', '.join(self)}.")
        return Track(self[name](behaviour), prior, gate=gate)


def _ekf(behaviour: Behaviour) -> Kernel:
    from swarmctl.estimation.track.ekf_kernel import EkfKernel  # noqa: PLC0415 - loads filterpy

    return EkfKernel(behaviour.process_noise)


FILTERS = Filters(
    {
        "tracker": FullKernel,
        "ncrkf": lambda behaviour: NcrkfKernel(behaviour.process_noise),
        "ekf": _ekf,
    }
)
"""The filters of this package.

``tracker`` carries every mode, manoeuvres and the receivers' errors; ``ncrkf`` is the consistent
non-conservative robust Kalman filter; ``ekf`` is filterpy's extended Kalman filter. The last two
take errors for white and the emitter's motion for steady.
"""
