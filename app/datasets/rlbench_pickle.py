"""`low_dim_obs.pkl` of RLBench without RLBench, and without the danger of a pickle.

A pickle may call any function that it names. This reader knows the names of RLBench's two classes and of what numpy
needs to rebuild arrays, and has an own one for each; any other name is refused before it is looked up.
"""

import io
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.datasets.errors import DamagedError
from app.datasets.inside import read_inside
from app.datasets.limits import Budget
from app.datasets.numpy_standins import DtypeStandIn, from_buffer, ndarray, plain, reconstruct, scalar


class Record:
    """Stands for an RLBench object: its attributes, none of its methods."""

    def __init__(self, attributes: dict[str, Any]) -> None:
        self._attributes = attributes

    def get(self, name: str) -> Any:  # noqa: ANN401
        """The attribute, or None."""
        return plain(self._attributes.get(name))


def load_demo(root: Path, path: Path, budget: Budget) -> list[Record]:
    """The observations of a recorded `rlbench.demo.Demo`, at least one.

    Args:
        root: the file must be below it.

    Raises:
        DamagedError: naming the file: it cannot be read, names something else than such a demonstration, or is empty.
    """
    demo = _load(root, path, budget)
    observations = vars(demo).get("_observations") if isinstance(demo, _Instance) else demo
    if not isinstance(observations, list) or not all(isinstance(item, _Instance) for item in observations):
        raise DamagedError(path, "is not a recorded RLBench demonstration")
    if not observations:
        raise DamagedError(path, "has no observations")
    return [Record(dict(vars(item))) for item in observations]


def load_descriptions(root: Path, path: Path, budget: Budget) -> list[str]:
    """The phrasings of an instruction in `variation_descriptions.pkl`.

    Raises:
        DamagedError: naming the file.
    """
    value = _load(root, path, budget)
    if not isinstance(value, list) or not value or not all(isinstance(item, str) for item in value):
        raise DamagedError(path, "is not a list of instructions")
    return value


def load_number(root: Path, path: Path, budget: Budget) -> int:
    """The number in `variation_number.pkl`.

    Raises:
        DamagedError: naming the file.
    """
    value = _load(root, path, budget)
    if not isinstance(value, int):
        raise DamagedError(path, "is not a number")
    return value


def _load(root: Path, path: Path, budget: Budget) -> Any:  # noqa: ANN401
    data = read_inside(root, path, budget)
    try:
        return _Unpickler(io.BytesIO(data)).load()
    except MemoryError:
        raise
    except Exception as error:  # a damaged pickle raises whatever its opcodes run into
        raise DamagedError(path, f"cannot be read: {str(error) or type(error).__name__}") from error


def _latin1(text: str, encoding: str) -> bytes:
    """How older protocols write bytes; other encodings would look up codecs."""
    if encoding != "latin1":
        raise pickle.UnpicklingError(f"encoding {encoding!r} is not allowed")
    return text.encode("latin1")


class _Sealed(type):
    """Of classes that a pickle can name: it must not change them for the next file."""

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
        """Only what is allowed, by its name, in a wrapper of its own: a pickle may set attributes of what it gets."""
        if (found := _ALLOWED.get((module, name))) is None:
            raise pickle.UnpicklingError(f"it names {module}.{name}, which no RLBench demonstration needs")
        return found if found is _Instance else _wrapped(found)


def _wrapped(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *arguments: function(*arguments)
