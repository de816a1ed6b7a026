"""What every function of this room asks of its arguments."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from swarmctl.errors import EstimationError
from swarmctl.units import Array


def as_finite(name: str, value: ArrayLike, *tail: int | None) -> Array:
    """``value`` as a float array, checked.

    Args:
        name: The argument's name, for the message.
        value: Anything numpy can make a float array of.
        *tail: Lengths of the last axes; None for any. More axes may lead.

    Raises:
        EstimationError: It is not numeric, an axis has another length, or an element is not
            finite.
    """
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise EstimationError(f"{name} must be an array of numbers, not {value!r}.") from None
    require_shape(name, array, *tail)
    if not np.isfinite(array).all():
        raise EstimationError(f"{name} must be finite; it is {array.tolist()}.")
    return array


def require_shape(name: str, array: Array, *tail: int | None) -> None:
    """Refuse an array whose last axes do not have the lengths in ``tail`` (None: any).

    Raises:
        EstimationError: The shape is another.
    """
    shape = array.shape[max(array.ndim - len(tail), 0) :]
    if len(shape) < len(tail) or any(
        want not in (None, have) for want, have in zip(tail, shape, strict=True)
    ):
        wanted = ", ".join("any" if length is None else str(length) for length in tail)
        raise EstimationError(f"{name} must have shape (..., {wanted}), not {array.shape}.")


def as_covariance(name: str, value: ArrayLike, *tail: int | None) -> Array:
    """``value`` as an array of symmetric, positive definite matrices, checked.

    Raises:
        EstimationError: As :func:`as_finite`; or it is not symmetric to 1e-9 of its scale, or
            not positive definite.
    """
    array = as_finite(name, value, *tail)
    scale = np.sqrt(np.abs(np.linalg.diagonal(array)))
    scale = scale[..., :, None] * scale[..., None, :]
    if (np.abs(array - array.mT) > 1e-9 * scale).any():
        raise EstimationError(f"{name} must be symmetric.")
    try:
        np.linalg.cholesky(array)
    except np.linalg.LinAlgError:
        raise EstimationError(f"{name} must be positive definite.") from None
    return array


def as_not_negative(name: str, value: float) -> float:
    """``value`` as a finite float >= 0.

    Raises:
        EstimationError: It is not.
    """
    if not 0.0 <= value < np.inf:
        raise EstimationError(f"{name} must be a finite number >= 0, not {value!r}.")
    return float(value)
