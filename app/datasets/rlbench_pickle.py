"""`low_dim_obs.pkl` of RLBench without RLBench, and without the danger of a pickle.

A pickle may call any function that it names. This reader knows the names of RLBench's two classes and of what numpy
needs to rebuild arrays; any other name is refused before it is looked up.
"""

import io
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy._core.multiarray import _reconstruct, scalar

from app.datasets.errors import DamagedError


class Record:
    """Stands for an RLBench object: its attributes, none of its methods."""

    def get(self, name: str) -> Any:  # noqa: ANN401
        """The attribute, or None."""
        return self.__dict__.get(name)


def load_demo(path: Path) -> list[Record]:
    """The observations of a recorded `rlbench.demo.Demo`, at least one.

    Raises:
        DamagedError: naming the file: it cannot be read, names something else than such a demonstration, or is empty.
    """
    demo = _load(path)
    observations = demo.get("_observations") if isinstance(demo, Record) else demo
    if not isinstance(observations, list) or not all(isinstance(item, Record) for item in observations):
        raise DamagedError(path, "is not a recorded RLBench demonstration")
    if not observations:
        raise DamagedError(path, "has no observations")
    return observations


def load_descriptions(path: Path) -> list[str]:
    """The phrasings of an instruction in `variation_descriptions.pkl`.

    Raises:
        DamagedError: naming the file.
    """
    value = _load(path)
    if not isinstance(value, list) or not value or not all(isinstance(item, str) for item in value):
        raise DamagedError(path, "is not a list of instructions")
    return value


def load_number(path: Path) -> int:
    """The number in `variation_number.pkl`.

    Raises:
        DamagedError: naming the file.
    """
    value = _load(path)
    if not isinstance(value, (int, np.integer)):
        raise DamagedError(path, "is not a number")
    return int(value)


def _load(path: Path) -> Any:  # noqa: ANN401
    try:
        return _Unpickler(path.read_bytes()).load()
    except Exception as error:  # a damaged pickle raises whatever its opcodes run into
        raise DamagedError(path, f"cannot be read: {error or type(error).__name__}") from error


def _latin1(text: str, encoding: str) -> bytes:
    """How older protocols write bytes; other encodings would look up codecs."""
    if encoding != "latin1":
        raise pickle.UnpicklingError(f"encoding {encoding!r} is not allowed")
    return text.encode("latin1")


def _frombuffer(buffer: bytes, dtype: np.dtype[Any], shape: tuple[int, ...], order: Literal["C", "F"]) -> Any:  # noqa: ANN401
    """How protocol 5 writes arrays."""
    return np.frombuffer(buffer, dtype).reshape(shape, order=order)


class _Unpickler(pickle.Unpickler):
    def __init__(self, data: bytes) -> None:
        super().__init__(io.BytesIO(data))
        # New for each file, so that a hostile one changes nothing for the next.
        record = type("Record", (Record,), {})
        self._allowed: dict[tuple[str, str], Callable[..., Any]] = {
            ("rlbench.demo", "Demo"): record,
            ("rlbench.backend.observation", "Observation"): record,
            ("numpy", "ndarray"): np.ndarray,
            ("numpy", "dtype"): np.dtype,
            ("_codecs", "encode"): _latin1,
        }
        for package in ("numpy.core", "numpy._core"):  # the name that numpy 1 and numpy 2 write
            self._allowed[f"{package}.multiarray", "_reconstruct"] = _reconstruct
            self._allowed[f"{package}.multiarray", "scalar"] = scalar
            self._allowed[f"{package}.numeric", "_frombuffer"] = _frombuffer

    def find_class(self, module: str, name: str) -> Any:  # noqa: ANN401
        """Only what is allowed, by its name."""
        if (found := self._allowed.get((module, name))) is None:
            raise pickle.UnpicklingError(f"it names {module}.{name}, which no RLBench demonstration needs")
        return found
