"""Detects the format of a dataset and opens it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from app.datasets import archive, mcap_log, rlbench, robomimic
from app.datasets.bounds import DatasetError
from app.datasets.lerobot import reader as lerobot
from app.datasets.options import ImportOptions
from app.datasets.parcel import Dataset


@dataclass(frozen=True)
class Format:
    """A format that can be imported.

    Attributes:
        looks_like: whether a file or folder may have this format; it reads as little as possible.
    """

    looks_like: Callable[[Path], bool]
    open: Callable[[Path, ImportOptions], Dataset]


FORMATS: dict[str, Format] = {
    "archive": Format(archive.looks_like, archive.open_archive),
    "lerobot": Format(lerobot.looks_like, lerobot.open_lerobot),
    "robomimic": Format(robomimic.looks_like, robomimic.open_robomimic),
    "mcap": Format(mcap_log.looks_like, mcap_log.open_mcap),
    "rlbench": Format(rlbench.looks_like, rlbench.open_rlbench),
}


def open_dataset(path: Path, options: ImportOptions, name: str | None = None) -> Dataset:
    """Return the dataset at `path`, of the named or detected format; raises DatasetError if there is none."""
    if not path.exists():
        raise DatasetError(f"{path} does not exist")
    if name is not None:
        dataset = FORMATS[name].open(path, options)
    elif (found := next((item for item in FORMATS.values() if item.looks_like(path)), None)) is not None:
        dataset = found.open(path, options)
    else:
        raise DatasetError(f"{path} is of no known format ({', '.join(FORMATS)}): see docs/datasets.md")
    if not dataset.entries and not dataset.damaged:
        raise DatasetError(f"{path}: no episodes of {dataset.format} in it")
    return dataset
