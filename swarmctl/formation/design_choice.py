"""The choice of the design in flight, by the range and by how well the line of sight is known.

The best formation depends on the range (its ends lean forward as the emitter comes near) and on
how well the line of sight (LOS) is known. The choice has hysteresis, so that an estimate that
wavers does not move the swarm.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from swarmctl.formation.information import slots_in_los_frame
from swarmctl.units import Array

STEP = 1.25
"""Ratio of the range of one design to that of the one before."""
_HYSTERESIS = 0.3
"""Share of a step by which the range must pass the middle between two designs."""
UNSURE_RAD, SURE_RAD = math.radians(15.0), math.radians(10.0)
"""The design for an unsure LOS is flown from above the first 1-sigma until below the second."""


def least_range(design: Array, stand_off_m: float) -> float:
    """Nearest range of the reference UAV at which every slot is outside the stand-off, m.

    Args:
        design: (N, 2) of (theta rad, horizontal distance m).
        stand_off_m: Nearest a slot may come to the emitter, m.
    """
    along, cross = np.moveaxis(slots_in_los_frame(design), -1, 0)
    return float((along + np.sqrt(np.maximum(stand_off_m**2 - cross**2, 0.0))).max())


class DesignChoice:
    """The designs of a flight, and the choice among them. Design i is for ``first_m`` x STEP^i.

    Args:
        make: Makes the design for a range, m. It is called for every design at once, because
            there is no time for it in flight.
        make_unsure: Makes the design for a range, m, while the LOS is not known well. It takes
            long and depends little on the range, so it is called once, when first needed, for
            the greatest range.
        first_m: The least range a design may be made for, m.
        farthest_m: The greatest range the flight begins at, m.
        nearest_m: Nearest the reference UAV means to come to the emitter, m.
        stand_off_m: Nearest a slot may come to the emitter, m. Designs for short ranges that
            lean too far forward to keep it on the orbit are not chosen.

    Raises:
        FormationError: No design fits.
    """

    def __init__(
        self,
        make: Callable[[float], Array],
        make_unsure: Callable[[float], Array],
        *,
        first_m: float,
        farthest_m: float,
        nearest_m: float,
        stand_off_m: float,
    ) -> None:
        self._first_m = first_m
        self._nearest_m = nearest_m
        self._stand_off_m = stand_off_m
        count = 1 + max(0, math.ceil(math.log(farthest_m / first_m) / math.log(STEP)))
        self._designs = [make(first_m * STEP**i) for i in range(count)]
        self._chosen = count - 1
        self._make_unsure = make_unsure
        self._unsure_made: Array | None = None
        self._unsure = False
        orbit = self._orbit_of(self._designs[-1])
        too_far_forward = [
            i for i, design in enumerate(self._designs) if self._orbit_of(design) > orbit
        ]
        self._least = max(too_far_forward, default=-1) + 1

    @property
    def orbit_m(self) -> float:
        """Nearest the reference UAV may come to the emitter with the designs flown now, m.

        ``nearest_m``, or farther off if all of them have slots too far ahead of it.
        """
        return self._orbit_of(self._unsure_design if self._unsure else self._designs[-1])

    def choose(self, range_m: float, los_sigma_rad: float) -> Array:
        """The design to fly now.

        Args:
            range_m: Estimated distance from the reference UAV to the emitter, m.
            los_sigma_rad: 1-sigma of the line of sight, rad.

        Returns:
            (N, 2) of (theta rad, d m); the very array of the last call unless the choice changes.

        Raises:
            FormationError: No design fits an unsure LOS.
        """
        self._unsure = los_sigma_rad > (SURE_RAD if self._unsure else UNSURE_RAD)
        here = math.log(max(range_m, 1.0) / self._first_m) / math.log(STEP)
        here = min(max(here, 0.0), len(self._designs) - 1.0)
        if abs(here - self._chosen) > 0.5 + _HYSTERESIS:
            self._chosen = round(here)
        return (
            self._unsure_design if self._unsure else self._designs[max(self._chosen, self._least)]
        )

    @property
    def _unsure_design(self) -> Array:
        if self._unsure_made is None:
            farthest_m = self._first_m * STEP ** (len(self._designs) - 1)
            self._unsure_made = self._make_unsure(farthest_m)
        return self._unsure_made

    def _orbit_of(self, design: Array) -> float:
        return max(self._nearest_m, least_range(design, self._stand_off_m))
