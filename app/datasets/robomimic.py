"""HDF5 files of robomimic and robosuite: `data/demo_N` with observations under `obs` and `actions` beside it.

robosuite moves one arm by end-effector poses and opens the gripper where the action's last number is negative. Objects
are the observations `NAME_pos` with `NAME_quat`; files that only have `object`, a vector of the task's own making, need
a mapping or an objects file. Other layouts of the same kind (LIBERO) are read with a mapping.

Only data within the file are read: links, external storage and virtual datasets of HDF5 may point to any other file.
"""

import json
import math
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets.bounds import Budget, DamagedError, DatasetError
from app.datasets.columns import ColumnEpisode, FeatureMap
from app.datasets.options import ImportOptions, as_name
from app.datasets.parcel import Dataset, Entry, Parcel, depth_png, rgb_png

MAX_LINKS = 8  # soft links in a row: they may form a cycle
SUFFIXES = (".hdf5", ".h5")
CONTROL_FREQUENCY_HZ = 20.0  # robosuite's default, where env_args does not say
DEFAULTS = {
    "joint_velocities": "obs/robot0_joint_vel",
    "joint_positions": "obs/robot0_joint_pos",
    "end_effector_positions": "obs/robot0_eef_pos",
    "end_effector_rotations": "obs/robot0_eef_quat",  # x y z w, robosuite/utils/transform_utils.py
}
GRIPPER = "actions[-1]"
_OBJECT = re.compile(r"obs/(?!robot\d)(?P<name>(?!.*_to_).+)_pos")
_WORD = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


def child(group: Any, name: str, links_left: int = MAX_LINKS) -> Any:  # noqa: ANN401
    """Return a member of a group; raises DamagedError for a link to another file, KeyError for no member."""
    import h5py  # of an extra

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
    """Return the members of a group by name; raises DamagedError if one is a link to another file."""
    return {name: child(group, name) for name in group}


def numbers(dataset: Any, budget: Budget, *, first: bool = False) -> np.ndarray[Any, Any]:  # noqa: ANN401
    """Return the dataset's numbers, or those of its first frame; raises DamagedError beyond the budget."""
    shape = dataset.shape[1:] if first else dataset.shape
    stored = shape if dataset.chunks is None else dataset.chunks  # a chunk is unpacked as a whole
    num_bytes = max(math.prod(shape), math.prod(stored)) * dataset.dtype.itemsize
    budget.take(num_bytes, f"{dataset.file.filename}: {dataset.name}")
    found: np.ndarray[Any, Any] = dataset[0] if first else dataset[()]
    return found


def _own(item: Any, where: str) -> Any:  # noqa: ANN401
    """Return `item`; raises DamagedError if its data are in another file."""
    import h5py

    if isinstance(item, h5py.Dataset) and (item.external or item.is_virtual):
        raise DamagedError(where, "takes its numbers from another file: copy them into this one")
    return item


def looks_like(path: Path) -> bool:
    """Return whether the file name has a suffix of HDF5."""
    return path.is_file() and path.suffix.lower() in SUFFIXES


def open_robomimic(path: Path, options: ImportOptions) -> Dataset:
    """Return the demonstrations in the order of their numbers; raises DatasetError for a file without `data`."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            data = child(file, "data")
            names = sorted(data, key=lambda name: [int(n) for n in re.findall(r"\d+", name)])
            described = dict(json.loads(data.attrs.get("env_args", "{}")))
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
        raise DatasetError(f"{path}: is no robomimic file: {error}") from error
    return Dataset("robomimic", tuple(Entry(name, partial(_read, path, name, described, options)) for name in names))


def _read(path: Path, name: str, described: dict[str, Any], options: ImportOptions) -> Parcel:
    import h5py

    where = f"{path}: data/{name}"
    try:
        with h5py.File(path, "r") as file:
            columns, images = _columns(child(child(file, "data"), name), Budget(where, options.max_unpacked_bytes))
    except (OSError, KeyError, RuntimeError, TypeError) as error:  # RuntimeError: h5py's for damaged chunks
        raise DamagedError(where, f"cannot be read: {error}") from error

    def image(column: str) -> bytes:
        if column not in images:
            raise DamagedError(where, f"has no images {column}; it has {', '.join(images) or 'none'}")
        return _encoded(images[column])

    environment = str(described.get("env_name", path.stem))
    frequency_hz = float(dict(described.get("env_kwargs", {})).get("control_freq", CONTROL_FREQUENCY_HZ))
    return ColumnEpisode(
        name=name,
        source="robomimic",
        task=as_name(_WORD.sub("_", environment).lower()),
        instruction=described.get("lang"),
        columns=columns,
        frequency_hz=frequency_hz,
        image=image,
        image_columns=list(images),
    ).parcel(_mapping(columns, options), options)


def _columns(
    demo: Any,  # noqa: ANN401
    budget: Budget,
) -> tuple[dict[str, np.ndarray[Any, Any]], dict[str, np.ndarray[Any, Any]]]:
    """Return the numbers of all frames, and the images of the first frame, by path."""
    columns, images = {}, {}
    observed = {f"obs/{name}": item for name, item in members(child(demo, "obs")).items()}
    for key, item in {"actions": child(demo, "actions"), **observed}.items():
        if not hasattr(item, "shape") or item.dtype.kind not in "biuf":
            continue  # a group, or texts
        if item.ndim <= 2:
            columns[key] = numbers(item, budget)
        else:
            images[key] = numbers(item, budget, first=True)
    return columns, images


def _mapping(columns: dict[str, np.ndarray[Any, Any]], options: ImportOptions) -> FeatureMap:
    found = {part: column for part, column in DEFAULTS.items() if column in columns}
    names = [match["name"] for column in columns if (match := _OBJECT.fullmatch(column))]
    objects = [
        {
            "name": as_name(name),
            "position": f"obs/{name}_pos",
            "rotation": f"obs/{name}_quat" if f"obs/{name}_quat" in columns else None,
        }
        for name in names
    ]
    defaults = FeatureMap(gripper=GRIPPER, gripper_open_below=0.0).changed({**found, "objects": objects})
    return defaults.changed(options.features)


def _encoded(image: np.ndarray[Any, Any]) -> bytes:
    if image.dtype == np.uint8 and image.ndim == 3 and image.shape[2] == 3:
        return rgb_png(image)
    return depth_png(np.asarray(image.squeeze(), np.float64))[0]
