"""What lies in an HDF5 file itself: links, storage and virtual datasets may also lead to any other file."""

import math
from typing import Any

import numpy as np

from app.datasets.errors import DamagedError, MissingPackageError
from app.datasets.limits import Budget

MAX_LINKS = 8  # of soft links one after the other: they may lead in a circle


def open_file(path: object) -> Any:  # noqa: ANN401
    """The file, as h5py opens it; raises MissingPackageError, OSError."""
    return _h5py().File(path, "r")


def child(group: Any, name: str, links_left: int = MAX_LINKS) -> Any:  # noqa: ANN401
    """The member of a group.

    Raises:
        DamagedError: if it is a link to another file.
        KeyError: if there is none.
    """
    h5py = _h5py()
    where = f"{group.file.filename}: {group.name.rstrip('/')}/{name}"
    if not isinstance(group, h5py.Group):
        raise DamagedError(group.file.filename, f"{group.name} is no group")
    if (link := group.get(name, getlink=True)) is None:
        raise KeyError(f"{where} is missing")
    if isinstance(link, h5py.HardLink):
        return _own(group[name], where)
    if not isinstance(link, h5py.SoftLink) or not links_left:
        raise DamagedError(where, "is a link to another file, or in a circle: copy what it shows into this file")
    found = group.file if link.path.startswith("/") else group
    for part in filter(None, link.path.split("/")):
        found = child(found, part, links_left - 1)
    return found


def members(group: Any) -> dict[str, Any]:  # noqa: ANN401
    """Every member of a group by its name.

    Raises:
        DamagedError: if one is a link to another file.
    """
    return {name: child(group, name) for name in group}


def numbers(dataset: Any, budget: Budget, *, first: bool = False) -> np.ndarray[Any, Any]:  # noqa: ANN401
    """The dataset's numbers, or only those of its first frame, if the budget allows them.

    Raises:
        DamagedError: if they are too many.
    """
    shape = dataset.shape[1:] if first else dataset.shape
    stored = shape if dataset.chunks is None else dataset.chunks  # a chunk is unpacked as a whole
    num_bytes = max(math.prod(shape), math.prod(stored)) * dataset.dtype.itemsize
    budget.take(num_bytes, f"{dataset.file.filename}: {dataset.name}")
    found: np.ndarray[Any, Any] = dataset[0] if first else dataset[()]
    return found


def _own(item: Any, where: str) -> Any:  # noqa: ANN401
    """`item`, if its bytes are in this file."""
    if isinstance(item, _h5py().Dataset) and (item.external or item.is_virtual):
        raise DamagedError(where, "takes its numbers from another file: copy them into this one")
    return item


def _h5py() -> Any:  # noqa: ANN401
    try:
        import h5py
    except ImportError as error:
        raise MissingPackageError("HDF5 files", "h5py") from error
    return h5py
