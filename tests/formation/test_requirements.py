"""What a formation's requirements and noise accept, and the sentences they refuse with."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest

from swarmctl.errors import FormationError
from swarmctl.formation.requirements import Noise, Requirements

GOOD: dict[str, Any] = {
    "companions": 3,
    "max_slot_distance_m": 300.0,
    "separation_m": 10.0,
    "range_m": 5000.0,
}


@pytest.mark.parametrize(
    ("noise", "expected"),
    [
        (Noise(0.5, 0.0, 0.3), 0.3),  # receivers only: their own share
        (Noise(1e-9, 2.0, 0.0), 0.5),  # positions only: the reference's of two
        (Noise(0.5, 0.5, 0.5), 0.5),
        (Noise(2.0, 1.0, 0.25), (0.25 * 4.0 + 1.0) / (4.0 + 2.0)),
    ],
)
def test_the_common_share_counts_the_reference_s_receiver_and_position(
    noise: Noise, expected: float
) -> None:
    assert noise.rho_eff == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        (
            {"sigma_r_m": 0.0},
            "sigma_r must be above 0 and sigma_p at least 0, finite; they are 0 and 0.5 m.",
        ),
        (
            {"sigma_p_m": -0.1},
            "sigma_r must be above 0 and sigma_p at least 0, finite; they are 0.5 and -0.1 m.",
        ),
        ({"sigma_r_m": math.inf}, "they are inf and 0.5 m."),
        ({"sigma_p_m": math.inf}, "they are 0.5 and inf m."),
        ({"sigma_r_m": math.nan}, "they are nan and 0.5 m."),
        ({"sigma_p_m": math.nan}, "they are 0.5 and nan m."),
        ({"rho": 1.0}, "rho must be at least 0 and below 1; it is 1."),
        ({"rho": -0.1}, "rho must be at least 0 and below 1; it is -0.1."),
        ({"rho": math.nan}, "rho must be at least 0 and below 1; it is nan."),
    ],
)
def test_noise_that_cannot_be_is_refused(changed: dict[str, float], sentence: str) -> None:
    with pytest.raises(FormationError, match=re.escape(sentence) + "$"):
        Noise(**changed)


@pytest.mark.parametrize(
    "changed",
    [
        {"companions": 1},
        {"separation_m": 300.0},
        {"range_m": 300.5},
        {"sector_rad": 0.0},
        {"sector_rad": 1.57},
    ],
)
def test_what_is_just_possible_is_accepted(changed: dict[str, Any]) -> None:
    Requirements(**{**GOOD, **changed})


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"companions": 0}, "A formation needs at least one companion, not 0."),
        (
            {"separation_m": 0.0},
            "The minimum separation, 0 m, must be above 0 and not above the greatest slot"
            " distance, 300 m.",
        ),
        (
            {"separation_m": 301.0},
            "The minimum separation, 301 m, must be above 0 and not above the greatest slot"
            " distance, 300 m.",
        ),
        ({"separation_m": math.nan}, "not above the greatest slot distance, 300 m."),
        ({"max_slot_distance_m": math.nan}, "not above the greatest slot distance, nan m."),
        (
            {"max_slot_distance_m": math.inf, "range_m": math.inf},
            "not above the greatest slot distance, inf m.",
        ),
        (
            {"range_m": 300.0},
            "The range to the emitter, 300 m, must be above the greatest slot distance,"
            " 300 m: the emitter would be inside the formation.",
        ),
        ({"range_m": math.nan}, "the emitter would be inside the formation."),
        ({"range_m": math.inf}, "the emitter would be inside the formation."),
        (
            {"sector_rad": math.pi / 2.0},
            "The half sector of the line of sight must be 0 to 90 deg, not 90.",
        ),
        (
            {"sector_rad": -0.1},
            "The half sector of the line of sight must be 0 to 90 deg, not -5.72958.",
        ),
        ({"sector_rad": math.nan}, "must be 0 to 90 deg, not nan."),
    ],
)
def test_requirements_that_cannot_be_met_are_refused(
    changed: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(FormationError, match=re.escape(sentence) + "$"):
        Requirements(**{**GOOD, **changed})
