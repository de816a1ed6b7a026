"""What a formation design has to satisfy, and the noise of the range differences."""

from __future__ import annotations

import math
from dataclasses import dataclass

from swarmctl.errors import FormationError


@dataclass(frozen=True)
class Noise:
    """Noise of the range differences.

    Attributes:
        sigma_r_m: 1-sigma of a range difference, m.
        sigma_p_m: 1-sigma of a UAV's measured position per axis, m.
        rho: Share of sigma_r_m² that comes from the reference receiver; equal receivers: 1/2.
    """

    sigma_r_m: float = 0.5
    sigma_p_m: float = 0.5
    rho: float = 0.5

    def __post_init__(self) -> None:
        if not (0.0 < self.sigma_r_m < math.inf and 0.0 <= self.sigma_p_m < math.inf):
            raise FormationError(
                f"sigma_r must be above 0 and sigma_p at least 0, finite; they are"
                f" {self.sigma_r_m:g} and {self.sigma_p_m:g} m."
            )
        if not 0.0 <= self.rho < 1.0:
            raise FormationError(f"rho must be at least 0 and below 1; it is {self.rho:g}.")

    @property
    def rho_eff(self) -> float:
        """Share of a range difference's whole variance that all of them have in common.

        The reference UAV's position error acts like its receiver's timing.
        """
        common = self.rho * self.sigma_r_m**2 + self.sigma_p_m**2
        return common / (self.sigma_r_m**2 + 2.0 * self.sigma_p_m**2)


@dataclass(frozen=True)
class Requirements:
    """What a design has to satisfy.

    Attributes:
        companions: N, at least 1.
        max_slot_distance_m: Greatest distance of a slot from the reference UAV, m.
        separation_m: Least distance between two slots, and of a slot from the reference, m.
        range_m: From the reference UAV to the emitter, m; more than ``max_slot_distance_m``.
        noise: The noise of the range differences.
        ahead: Whether slots on the axis stand ahead of the reference instead of behind it.
        sector_rad: Half width of the sector the line of sight may lie in, rad; only the
            worst-case design looks at it.

    Raises:
        FormationError: A number is out of its range; names it.
    """

    companions: int
    max_slot_distance_m: float
    separation_m: float
    range_m: float
    noise: Noise = Noise()
    ahead: bool = False
    sector_rad: float = math.radians(30.0)

    def __post_init__(self) -> None:
        if self.companions < 1:
            raise FormationError(
                f"A formation needs at least one companion, not {self.companions}."
            )
        if not 0.0 < self.separation_m <= self.max_slot_distance_m < math.inf:
            raise FormationError(
                f"The minimum separation, {self.separation_m:g} m, must be above 0 and not above"
                f" the greatest slot distance, {self.max_slot_distance_m:g} m."
            )
        if not self.max_slot_distance_m < self.range_m < math.inf:
            raise FormationError(
                f"The range to the emitter, {self.range_m:g} m, must be above the"
                f" greatest slot distance, {self.max_slot_distance_m:g} m: the emitter would be"
                " inside the formation."
            )
        if not 0.0 <= self.sector_rad < math.pi / 2.0:
            raise FormationError(
                f"The half sector of the line of sight must be 0 to 90 deg, not"
                f" {math.degrees(self.sector_rad):g}."
            )
