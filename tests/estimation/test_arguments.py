"""What is refused, and how it is named."""

from __future__ import annotations

import numpy as np
import pytest

from swarmctl.errors import EstimationError
from swarmctl.estimation.arguments import as_covariance, as_finite, as_not_negative


def test_leading_axes_are_free_and_the_last_are_checked() -> None:
    assert as_finite("x", np.zeros((5, 2, 3)), 2, None).shape == (5, 2, 3)
    with pytest.raises(
        EstimationError, match=r"x must have shape \(\.\.\., 2, any\), not \(3, 3\)"
    ):
        as_finite("x", np.zeros((3, 3)), 2, None)
    with pytest.raises(EstimationError, match=r"x must have shape \(\.\.\., 3\), not \(\)"):
        as_finite("x", 1.0, 3)


@pytest.mark.parametrize("value", [[1.0, np.nan], [np.inf, 1.0], ["a", "b"]])
def test_what_is_no_finite_number_is_named(value: list[object]) -> None:
    with pytest.raises(EstimationError, match=r"^x must be"):
        as_finite("x", value, 2)  # type: ignore[arg-type]  # text is the point of the test


def test_a_covariance_is_symmetric_and_positive_definite_at_any_scale() -> None:
    tight = np.diag([1e10, 1e-10])
    assert as_covariance("P", tight, 2, 2) is tight
    with pytest.raises(EstimationError, match="P must be symmetric"):
        as_covariance("P", [[1.0, 0.1], [0.1 + 1e-8, 1.0]], 2, 2)
    with pytest.raises(EstimationError, match="P must be positive definite"):
        as_covariance("P", [[1.0, 1.1], [1.1, 1.0]], 2, 2)


@pytest.mark.parametrize("value", [-1e-300, np.nan, np.inf])
def test_a_negative_or_infinite_number_is_refused(value: float) -> None:
    assert as_not_negative("sigma", 0.0) == 0.0
    with pytest.raises(EstimationError, match="sigma must be a finite number >= 0"):
        as_not_negative("sigma", value)
