"""Reads RLBench's `low_dim_obs.pkl` safely and without RLBench.

A pickle may call any function by name. This reader replaces RLBench's two classes and the functions with which numpy
rebuilds arrays by its own ones, for numbers only, and refuses every other name.

numpy's own `_reconstruct`, `ndarray`, `dtype.__setstate__` and `scalar` trust the pickle: a forged one makes them
follow arbitrary pointers. Here every size is compared with the number of bytes.
"""

import io
import math
import pickle
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets.bounds import Budget, DamagedError, read_inside

_NUMBER = re.compile(r"[<>=|]?(b1|[iu][1248]|f[248])")
_BYTE_ORDERS = ("<", ">", "=", "|")
MAX_DIMENSIONS = 8


class DtypeStandIn:
    """Replaces `numpy.dtype`, for numbers; raises pickle.UnpicklingError for any other type."""

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
        """Return the array of these bytes; raises pickle.UnpicklingError if data and shape do not match."""
        if not isinstance(shape, tuple) or len(shape) > MAX_DIMENSIONS:
            raise pickle.UnpicklingError("it has an array without a shape")
        if not all(isinstance(size, int) and size >= 0 for size in shape) or order not in ("C", "F"):
            raise pickle.UnpicklingError(f"it has an array of shape {shape!r:.80}")
        if not isinstance(data, bytes | bytearray) or len(data) != math.prod(shape) * self._dtype.itemsize:
            raise pickle.UnpicklingError(f"it has an array of shape {shape!r:.80} with other bytes than that takes")
        # A copy, because the rest of the pickle may change a bytearray.
        return np.frombuffer(bytes(data), self._dtype).reshape(shape, order=order)


class ArrayStandIn:
    """Replaces `numpy.ndarray`, so that the rest of the pickle cannot reach the array."""

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
    """Replaces calls of `numpy.ndarray`, which pickles name but do not call: it could turn bytes into objects."""
    raise pickle.UnpicklingError("it calls numpy.ndarray, which no pickle of numpy's does")


def from_buffer(data: object, dtype: object, shape: object, order: object) -> ArrayStandIn:
    """`numpy._core.numeric._frombuffer`: how protocol 5 writes arrays."""
    if not isinstance(dtype, DtypeStandIn):
        raise pickle.UnpicklingError("it has an array without a type")
    array = ArrayStandIn()
    array.value = dtype.array(data, shape, order)
    return array


def scalar(dtype: object, data: object) -> bool | int | float:
    """`numpy._core.multiarray.scalar`, as an immutable number of Python."""
    if not isinstance(dtype, DtypeStandIn):
        raise pickle.UnpicklingError("it has a number without a type")
    number: bool | int | float = dtype.array(data, (), "C").item()
    return number


def plain(value: Any, depth: int = 4) -> Any:  # noqa: ANN401
    """Return `value` with stand-ins replaced by arrays, within dictionaries and lists down to `depth`."""
    if isinstance(value, ArrayStandIn):
        return value.value
    if depth and isinstance(value, dict):
        return {key: plain(item, depth - 1) for key, item in value.items()}
    if depth and isinstance(value, list | tuple):
        return [plain(item, depth - 1) for item in value]
    return value


class Record:
    """The attributes of an RLBench object."""

    def __init__(self, attributes: dict[str, Any]) -> None:
        self._attributes = attributes

    def get(self, name: str) -> Any:  # noqa: ANN401
        return plain(self._attributes.get(name))


def load_demo(root: Path, path: Path, budget: Budget) -> list[Record]:
    """Return the observations, at least one, of a recorded `rlbench.demo.Demo` in a file below `root`.

    Raises:
        DamagedError: naming the file, if it is unreadable, not a demonstration, or empty.
    """
    demo = _load(root, path, budget)
    observations = vars(demo).get("_observations") if isinstance(demo, _Instance) else demo
    if not isinstance(observations, list) or not all(isinstance(item, _Instance) for item in observations):
        raise DamagedError(path, "is not a recorded RLBench demonstration")
    if not observations:
        raise DamagedError(path, "has no observations")
    return [Record(dict(vars(item))) for item in observations]


def load_descriptions(root: Path, path: Path, budget: Budget) -> list[str]:
    """Return the phrasings of an instruction in `variation_descriptions.pkl`; raises DamagedError."""
    value = _load(root, path, budget)
    if not isinstance(value, list) or not value or not all(isinstance(item, str) for item in value):
        raise DamagedError(path, "is not a list of instructions")
    return value


def load_number(root: Path, path: Path, budget: Budget) -> int:
    """Return the number in `variation_number.pkl`; raises DamagedError."""
    value = _load(root, path, budget)
    if not isinstance(value, int):
        raise DamagedError(path, "is not a number")
    return value


def _load(root: Path, path: Path, budget: Budget) -> Any:  # noqa: ANN401
    data = read_inside(root, path, budget)
    try:
        return _Unpickler(io.BytesIO(data)).load()
    except Exception as error:  # a damaged pickle may raise anything
        raise DamagedError(path, f"cannot be read: {str(error) or type(error).__name__}") from error


def _latin1(text: str, encoding: str) -> bytes:
    """Decode bytes of older protocols; other encodings would look up codecs."""
    if encoding != "latin1":
        raise pickle.UnpicklingError(f"encoding {encoding!r} is not allowed")
    return text.encode("latin1")


class _Sealed(type):
    """Metaclass of classes that a pickle can name; it must not change them for the next file."""

    def __setattr__(cls, name: str, value: object) -> None:
        raise pickle.UnpicklingError(f"it sets {name!r} of a class")


class _Instance(metaclass=_Sealed):
    """An RLBench object while a pickle is read."""


_ALLOWED: dict[tuple[str, str], Callable[..., Any]] = {
    ("rlbench.demo", "Demo"): _Instance,
    ("rlbench.backend.observation", "Observation"): _Instance,
    ("numpy", "ndarray"): ndarray,
    ("numpy", "dtype"): lambda *arguments: DtypeStandIn(*arguments),
    ("_codecs", "encode"): _latin1,
    # The name that numpy 1 and numpy 2 write.
    **{(f"{package}.multiarray", "_reconstruct"): reconstruct for package in ("numpy.core", "numpy._core")},
    **{(f"{package}.multiarray", "scalar"): scalar for package in ("numpy.core", "numpy._core")},
    **{(f"{package}.numeric", "_frombuffer"): from_buffer for package in ("numpy.core", "numpy._core")},
}


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:  # noqa: ANN401
        """Return an allowed name, wrapped anew, because a pickle may set attributes of it."""
        if (found := _ALLOWED.get((module, name))) is None:
            raise pickle.UnpicklingError(f"it names {module}.{name}, which no RLBench demonstration needs")
        return found if found is _Instance else _wrapped(found)


def _wrapped(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *arguments: function(*arguments)
