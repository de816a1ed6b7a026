"""Constants of nature and statistics, and the types of numbers that cross rooms.

What two modules need lives here once. Units are SI and radians, as everywhere.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vector = tuple[float, float, float]
"""Three floats: a position or velocity in ENU (m, m/s) or ECEF (m)."""
Vector2 = tuple[float, float]
"""Two floats: the horizontal part of a :data:`Vector`, east and north."""
Array = NDArray[np.floating]
"""An array of float64; numpy's linear algebra is typed no more closely than this."""
Mask = NDArray[np.bool_]
"""An array of truth values."""

SPEED_OF_LIGHT_MPS = 299_792_458.0
"""Speed of light in vacuum, m/s: turns time differences into range differences."""

CHI2_95_2DOF = 5.991464547107979
"""95 % quantile of chi-squared with two degrees of freedom.

Its square root scales the axes of a horizontal 1-sigma ellipse to 95 %.
"""
