"""The formats that can be imported, and which of them a file or folder has."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from app.datasets import archive, lerobot, rlbench, robomimic
from app.datasets.bounds import DatasetError
from app.datasets.options import ImportOptions
from app.datasets.parcel import Dataset


class Format(NamedTuple):
    """How a format is recognized, reading as little as possible, and opened."""

    looks_like: Callable[[Path], bool]
    open: Callable[[Path, ImportOptions], Dataset]


FORMATS = {
    "archive": Format(archive.looks_like, archive.open_archive),
    "lerobot": Format(lerobot.looks_like, lerobot.open_lerobot),
    "robomimic": Format(robomimic.looks_like, robomimic.open_robomimic),
    "rlbench": Format(rlbench.looks_like, rlbench.open_rlbench),
}


def open_dataset(path: Path, options: ImportOptions) -> Dataset:
    """Return the dataset at `path`, of the detected format; raises DatasetError if there is none."""
    if not path.exists():
        raise DatasetError(f"{path} does not exist")
    found = next((item for item in FORMATS.values() if item.looks_like(path)), None)
    if found is None:
        raise DatasetError(f"{path} is of no known format ({', '.join(FORMATS)}): see docs/datasets.md")
    dataset = found.open(path, options)
    if not dataset.entries and not dataset.damaged:
        raise DatasetError(f"{path}: no episodes of {dataset.format} in it")
    return dataset
