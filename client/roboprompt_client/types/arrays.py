"""Arrays of numbers, checked, and values that are checked when they are constructed."""

import math

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError

Array = npt.NDArray[np.float64]

MAX_M = 10_000.0  # a position in the world frame: no robot is farther, and arithmetic stays finite
QUATERNION_NORM_TOLERANCE = 1e-3
UNIT_NORM_ROUNDING = 1e-15


def finite_array(name: str, value: npt.ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """`value` as a read-only float64 array of `shape` (None: any length), every element finite.

    Raises:
        InvalidInputError: naming `name`, the offending shape or the index of the first element that is not finite.
    """
    try:
        array = np.array(value)
    except ValueError as error:
        raise InvalidInputError(name, "is not an array of numbers", _in_words(shape)) from error
    if array.dtype.kind not in "biuf":  # text and complex numbers would convert, too
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
    """As `finite_array`, every element between `-most` and `most`.

    Raises:
        InvalidInputError: as `finite_array`; also for the first element beyond the bound, which it names with the unit.
    """
    array = finite_array(name, value, shape)
    if (beyond := np.abs(array) > most).any():
        index = tuple(int(i) for i in np.argwhere(beyond)[0])
        raise InvalidInputError(name, f"element {list(index)} is {array[index]:g}", f"{-most:g} to {most:g} {unit}")
    return array


def positions_array(name: str, value: npt.ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """As `bounded_array`, of positions in meters."""
    return bounded_array(name, value, shape, MAX_M, "m")


def _in_words(shape: tuple[int | None, ...]) -> str:
    lengths = ", ".join("T" if n is None else str(n) for n in shape)
    return f"shape ({lengths}{',' if len(shape) == 1 else ''})"


def unit_quaternions(name: str, value: npt.ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """`value` as quaternions xyzw of unit length; a deviation within 1e-3 is normalized away, a larger one refused."""
    quaternions = finite_array(name, value, shape)
    if quaternions.ndim == 1 and abs(math.hypot(*quaternions.tolist()) - 1) <= UNIT_NORM_ROUNDING / 2:
        return quaternions  # as below, at a tenth of the cost for a single one
    with np.errstate(over="ignore"):  # an infinite norm is refused like any other
        norms = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    deviations = np.abs(norms - 1)
    if (worst := float(deviations.max(initial=0))) > QUATERNION_NORM_TOLERANCE:
        message = f"has a norm that differs from 1 by {worst:.3g}"
        raise InvalidInputError(name, message, "unit quaternions, order x y z w")
    # What is a unit quaternion already stays as it is, bit by bit: dividing again would change the last one.
    unit: Array = np.where(deviations <= UNIT_NORM_ROUNDING, quaternions, quaternions / norms)
    unit.flags.writeable = False
    return unit


def settle(instance: object, **checked: object) -> None:
    """Put checked values into a frozen dataclass while it is constructed."""
    for name, value in checked.items():
        object.__setattr__(instance, name, value)
