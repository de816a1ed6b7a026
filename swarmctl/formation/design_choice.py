"""Designs for every range and for an unsure line of sight, chosen in flight.

The best formation depends on the range (its ends lean forward as the emitter comes near) and on
how well the line of sight (LOS) is known. One is chosen with hysteresis, so that an estimate that
wavers does not move the swarm.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from swarmctl.formation.information import slots_in_los_frame
from swarmctl.units import Array

STEP = 1.25
"""Ratio of the range of one page to that of the page before."""
_HYSTERESIS = 0.3
"""Share of a step by which the range must pass the middle between two pages."""
UNSURE_RAD, SURE_RAD = math.radians(15.0), math.radians(10.0)
"""1-sigma of the LOS above which the worst-case design is flown, and below which no more."""


def least_range(design: Array, stand_off_m: float) -> float:
    """How near the reference UAV may come to the emitter with every slot outside the stand-off, m.

    Args:
        design: (N, 2) of (theta rad, horizontal distance m).
        stand_off_m: Nearest a slot may come to the emitter, m.
    """
    along, cross = np.moveaxis(slots_in_los_frame(design), -1, 0)
    return float((along + np.sqrt(np.maximum(stand_off_m**2 - cross**2, 0.0))).max())


class DesignChoice:
    """A flight's designs. Page i is for the range ``first_m`` x STEP^i.

    Args:
        make: Makes the design for a range, m. Called for every page now: a flight has no time.
        make_unsure: Makes the design for a range while the LOS is not known well. That takes
            long and depends little on the range: it is called once, when first needed, for the
            greatest range.
        first_m: The least range a design may be made for, m.
        farthest_m: The greatest range the flight begins at, m.
        nearest_m: Nearest the reference UAV means to come to the emitter, m.
        stand_off_m: Nearest a slot may come to the emitter, m. Pages for short ranges that lean
            too far forward to keep it on the orbit are passed over.

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
        self._pages = [make(first_m * STEP**page) for page in range(count)]
        self._page = count - 1
        self._make_unsure = make_unsure
        self._unsure_page: Array | None = None
        self._unsure = False
        orbit = self._orbit_of(self._pages[-1])
        too_far_forward = [
            page for page, design in enumerate(self._pages) if self._orbit_of(design) > orbit
        ]
        self._least = max(too_far_forward, default=-1) + 1

    @property
    def orbit_m(self) -> float:
        """Nearest the reference UAV may come to the emitter with the designs flown now, m.

        ``nearest_m``, or farther off if all of them have slots too far ahead of it.
        """
        return self._orbit_of(self._unsure_design if self._unsure else self._pages[-1])

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
        here = min(max(here, 0.0), len(self._pages) - 1.0)
        if abs(here - self._page) > 0.5 + _HYSTERESIS:
            self._page = round(here)
        return self._unsure_design if self._unsure else self._pages[max(self._page, self._least)]

    @property
    def _unsure_design(self) -> Array:
        if self._unsure_page is None:
            farthest_m = self._first_m * STEP ** (len(self._pages) - 1)
            self._unsure_page = self._make_unsure(farthest_m)
        return self._unsure_page

    def _orbit_of(self, design: Array) -> float:
        return max(self._nearest_m, least_range(design, self._stand_off_m))
