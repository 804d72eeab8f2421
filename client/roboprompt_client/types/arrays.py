"""Checks of arrays of numbers, for values that are checked when they are constructed."""

import math

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError

Array = npt.NDArray[np.float64]

MAX_M = 10_000.0  # the largest coordinate in the world frame: no robot is farther away, and arithmetic stays finite
QUATERNION_NORM_TOLERANCE = 1e-3
UNIT_NORM_ROUNDING = 1e-15


def finite_array(name: str, value: npt.ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """Return `value` as a read-only float64 array of `shape` (None: any length) with finite elements.

    Raises:
        InvalidInputError: naming `name`, and the wrong shape or the index of the first element that is not finite.
    """
    try:
        array = np.array(value)
    except ValueError as error:
        raise InvalidInputError(name, "is not an array of numbers", _in_words(shape)) from error
    if array.dtype.kind not in "biuf":  # text and complex numbers would be converted
        raise InvalidInputError(name, f"is not an array of numbers but of {array.dtype}", _in_words(shape))
    array = array.astype(np.float64, copy=False)
    if array.shape != shape and (
        array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=True))
    ):
        raise InvalidInputError(name, f"has shape {array.shape}", _in_words(shape))
    if not np.isfinite(array).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InvalidInputError(name, f"element {list(index)} is {array[index]}", "finite numbers")
    array.flags.writeable = False
    return array


def bounded_array(name: str, value: npt.ArrayLike, shape: tuple[int | None, ...], most: float, unit: str) -> Array:
    """Return what `finite_array` does, with every element between `-most` and `most`.

    Raises:
        InvalidInputError: as `finite_array`; also naming the first element beyond the bound, with the unit.
    """
    array = finite_array(name, value, shape)
    if (beyond := np.abs(array) > most).any():
        index = tuple(int(i) for i in np.argwhere(beyond)[0])
        raise InvalidInputError(name, f"element {list(index)} is {array[index]:g}", f"{-most:g} to {most:g} {unit}")
    return array


def positions_array(name: str, value: npt.ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """Return what `bounded_array` does, for positions in meters."""
    return bounded_array(name, value, shape, MAX_M, "m")


def _in_words(shape: tuple[int | None, ...]) -> str:
    letters = iter("TN")  # a length of its own for each unknown axis
    lengths = ", ".join(next(letters) if length is None else str(length) for length in shape)
    return f"shape ({lengths}{',' if len(shape) == 1 else ''})"


def unit_quaternions(name: str, value: npt.ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """Return quaternions xyzw of unit length: norms within 1e-3 of 1 are normalized, others raise InvalidInputError."""
    quaternions = finite_array(name, value, shape)
    if quaternions.ndim == 1 and abs(math.hypot(*quaternions.tolist()) - 1) <= UNIT_NORM_ROUNDING / 2:
        return quaternions  # the same result as below at a tenth of the time
    with np.errstate(over="ignore"):  # an infinite norm is refused below
        norms = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    deviations = np.abs(norms - 1)
    if (worst := float(deviations.max(initial=0))) > QUATERNION_NORM_TOLERANCE:
        message = f"has a norm that differs from 1 by {worst:.3g}"
        raise InvalidInputError(name, message, "unit quaternions, order x y z w")
    # A quaternion that is already of unit length stays the same bit by bit: dividing could change its last bit.
    unit: Array = np.where(deviations <= UNIT_NORM_ROUNDING, quaternions, quaternions / norms)
    unit.flags.writeable = False
    return unit


def settle(instance: object, **checked: object) -> None:
    """Set checked values of a frozen dataclass while it is constructed."""
    for name, value in checked.items():
        object.__setattr__(instance, name, value)
