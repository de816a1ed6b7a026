"""Numbers that no measurement of this system comes near."""

import math

import pytest

from swarmctl.estimation.feed.corrupt_numbers import are_plausible, is_arrival_plausible


@pytest.mark.parametrize("value", [1e6, -1e6, math.inf, -math.inf, math.nan])
def test_one_absurd_number_spoils_all(value: float) -> None:
    assert are_plausible(0.0, 999_999.0, -999_999.0)
    assert not are_plausible(0.0, value, 1.0)
    assert not are_plausible(value)


def test_an_arrival_time_in_its_limits_is_plausible() -> None:
    assert is_arrival_plausible(1_790_000_000, 0.0, 1e-8)
    assert is_arrival_plausible(-(10**11), 0.999_999_999, 1e-8)


@pytest.mark.parametrize(
    ("toa_s", "toa_frac_s", "sigma_s"),
    [
        (10**11 + 1, 0.0, 1e-8),
        (-(10**11) - 1, 0.0, 1e-8),
        (0, 1.0, 1e-8),
        (0, -1e-9, 1e-8),
        (0, math.nan, 1e-8),
        (0, 0.0, 0.0),
        (0, 0.0, -1e-8),
        (0, 0.0, math.nan),
        (0, 0.0, 0.01),  # 3000 km of light
    ],
)
def test_an_arrival_time_with_one_absurd_part_is_not(
    toa_s: int, toa_frac_s: float, sigma_s: float
) -> None:
    assert not is_arrival_plausible(toa_s, toa_frac_s, sigma_s)
