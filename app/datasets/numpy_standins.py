"""What a pickle of numpy's arrays calls, in Python and for numbers only.

numpy's own `_reconstruct`, `ndarray`, `dtype.__setstate__` and `scalar` believe what a pickle says: one that is made up
lets them follow a pointer of its author's choice. Here every size is compared with the bytes that are there.
"""

import math
import pickle
import re
from typing import Any

import numpy as np

_NUMBER = re.compile(r"[<>=|]?(b1|[iu][1248]|f[248])")
_BYTE_ORDERS = ("<", ">", "=", "|")
MAX_DIMENSIONS = 8


class DtypeStandIn:
    """`numpy.dtype` of one kind of number.

    Raises:
        pickle.UnpicklingError: for any other type.
    """

    def __init__(self, spec: object, *_flags: object) -> None:
        if not isinstance(spec, str) or not _NUMBER.fullmatch(spec):
            raise pickle.UnpicklingError(f"it has an array of type {spec!r:.50}, which is no number")
        self._dtype = np.dtype(spec)

    def __setstate__(self, state: object) -> None:
        """`(version, byte order, subtype, names, fields, size, alignment, flags)`; only the byte order matters here."""
        if not isinstance(state, tuple) or len(state) < 5 or state[1] not in _BYTE_ORDERS or any(state[2:5]):
            raise pickle.UnpicklingError("it has an array whose type is not a plain number's")
        self._dtype = self._dtype.newbyteorder(state[1])

    def array(self, data: object, shape: object, order: object) -> np.ndarray[Any, Any]:
        """The array of exactly these bytes.

        Raises:
            pickle.UnpicklingError: if data and shape do not fit.
        """
        if not isinstance(shape, tuple) or len(shape) > MAX_DIMENSIONS:
            raise pickle.UnpicklingError("it has an array without a shape")
        if not all(isinstance(size, int) and size >= 0 for size in shape) or order not in ("C", "F"):
            raise pickle.UnpicklingError(f"it has an array of shape {shape!r:.80}")
        if not isinstance(data, bytes | bytearray) or len(data) != math.prod(shape) * self._dtype.itemsize:
            raise pickle.UnpicklingError(f"it has an array of shape {shape!r:.80} with other bytes than that takes")
        # A copy: the pickle goes on and may change a bytearray that it still holds.
        return np.frombuffer(bytes(data), self._dtype).reshape(shape, order=order)


class ArrayStandIn:
    """`numpy.ndarray` while a pickle is read: no array is in reach of the pickle's further instructions."""

    def __init__(self) -> None:
        self.value: np.ndarray[Any, Any] = np.empty(0)

    def __setstate__(self, state: object) -> None:
        """`(version, shape, dtype, is it in Fortran's order, bytes)`."""
        if not isinstance(state, tuple) or len(state) != 5 or not isinstance(state[2], DtypeStandIn):
            raise pickle.UnpicklingError("it has an array that numpy has not written")
        _, shape, dtype, is_fortran, data = state
        self.value = dtype.array(data, shape, "F" if is_fortran else "C")


def reconstruct(*_arguments: object) -> ArrayStandIn:
    """`numpy._core.multiarray._reconstruct`: an empty array, which the next instruction fills."""
    return ArrayStandIn()


def ndarray(*_arguments: object) -> ArrayStandIn:
    """`numpy.ndarray`, which a pickle names but does not call: it would take any bytes for objects."""
    raise pickle.UnpicklingError("it calls numpy.ndarray, which no pickle of numpy's does")


def from_buffer(data: object, dtype: object, shape: object, order: object) -> ArrayStandIn:
    """`numpy._core.numeric._frombuffer`: how protocol 5 writes arrays."""
    if not isinstance(dtype, DtypeStandIn):
        raise pickle.UnpicklingError("it has an array without a type")
    array = ArrayStandIn()
    array.value = dtype.array(data, shape, order)
    return array


def scalar(dtype: object, data: object) -> bool | int | float:
    """`numpy._core.multiarray.scalar`, as Python's own number: nothing can be done to that."""
    if not isinstance(dtype, DtypeStandIn):
        raise pickle.UnpicklingError("it has a number without a type")
    number: bool | int | float = dtype.array(data, (), "C").item()
    return number


def plain(value: Any, depth: int = 4) -> Any:  # noqa: ANN401
    """`value` with arrays in the place of stand-ins, also within dictionaries and lists down to `depth`."""
    if isinstance(value, ArrayStandIn):
        return value.value
    if depth and isinstance(value, dict):
        return {key: plain(item, depth - 1) for key, item in value.items()}
    if depth and isinstance(value, list | tuple):
        return [plain(item, depth - 1) for item in value]
    return value
