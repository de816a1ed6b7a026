"""The battery of a simulated vehicle: charge, voltage and how fast it empties."""

from __future__ import annotations

CELLS = 3
EMPTY_CELL_V, FULL_CELL_V = 3.5, 4.2
CAPACITY_MAH = 3300.0
ENDURANCE_S = 1800.0
"""A full battery lasts this long with the motors armed, s."""
STANDBY_S = 50.0 * ENDURANCE_S
"""A full battery lasts this long with the motors disarmed, s."""


class Battery:
    """A battery.

    Args:
        charge: Charge at the start, 0..1.

    Attributes:
        charge: Charge left, 0..1.
        full_v: Voltage of the full battery, V.
    """

    __slots__ = ("charge", "full_v")

    def __init__(self, charge: float) -> None:
        self.charge = charge
        self.full_v = CELLS * FULL_CELL_V

    @property
    def voltage_v(self) -> float:
        """Voltage, V: linear in the charge."""
        empty = EMPTY_CELL_V / FULL_CELL_V
        return self.full_v * (empty + (1.0 - empty) * self.charge)

    @property
    def left_mah(self) -> float:
        """Charge left, mAh."""
        return self.charge * CAPACITY_MAH

    @property
    def used_mah(self) -> float:
        """Charge used of a full battery, mAh."""
        return (1.0 - self.charge) * CAPACITY_MAH

    def draw(self, step_s: float, *, armed: bool) -> None:
        """Lose the charge that the vehicle uses in a time step (s)."""
        self.charge = max(0.0, self.charge - step_s / (ENDURANCE_S if armed else STANDBY_S))
