"""Where the rows and instruction of each episode are in a LeRobot dataset, version 3.0: meta/episodes lists them.

Objects, calibrated cameras and their first images, for which LeRobot has no place, are in additional files:

    meta/roboprompt/episode_000000/metadata.json   as it was uploaded
                                   rgb_front       the image files, byte for byte
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.datasets.bounds import Budget, DamagedError, DatasetError, inside, read_inside
from app.datasets.lerobot.tables import column_names, read_table
from app.datasets.parcel import Parcel, canonical_json, checked_metadata

FOLDER = Path("meta/roboprompt")
METADATA = "metadata.json"
INFO = Path("meta/info.json")
VERSION = "v3.0"
_PLACE = re.compile(r"\{(?P<name>\w+)(?::0?(?P<width>\d))?(?P<decimal>d?)\}")
_NUMBERS = ("float16", "float32", "float64", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "bool")


def read_scene(root: Path, index: int, budget: Budget) -> tuple[dict[str, Any], dict[str, bytes]] | None:
    """Return the episode's metadata and its images by name; None if there are none. Raises DamagedError."""
    folder = _folder(root, index)
    if not folder.exists():
        return None
    path = folder / METADATA
    try:
        metadata = checked_metadata(path, json.loads(read_inside(root, path, budget)))
    except ValueError as error:
        raise DamagedError(path, f"is not JSON: {error}") from error
    names = sorted(item.name for item in folder.iterdir() if item.name != METADATA)
    return metadata, {name: read_inside(root, folder / name, budget) for name in names}


def write_scene(root: Path, index: int, parcel: Parcel) -> None:
    """The inverse of `read_scene`."""
    folder = _folder(root, index)
    folder.mkdir(parents=True)
    (folder / METADATA).write_bytes(canonical_json(parcel.metadata))
    for name, data in parcel.files.items():
        if name != "trajectory":
            (folder / name).write_bytes(data)


def _folder(root: Path, index: int) -> Path:
    return root / FOLDER / f"episode_{int(index):06d}"


@dataclass(frozen=True)
class Info:
    """The contents of meta/info.json of the dataset in the folder `root`."""

    root: Path
    fps: float
    features: Mapping[str, Mapping[str, Any]]  # by name, with dtype, shape and names
    data_path: str
    video_path: str | None

    def named(self, *dtypes: str) -> list[str]:
        return [name for name, item in self.features.items() if item["dtype"] in dtypes]

    @property
    def numeric(self) -> list[str]:
        return self.named(*_NUMBERS)


@dataclass(frozen=True)
class Place:
    """The location of an episode."""

    index: int
    length: int
    instruction: str | None
    data_file: Path
    first_row: int  # in the data file
    row: Mapping[str, Any]  # of meta/episodes, which has the start of an episode in its video file


def read_info(root: Path, budget: Budget) -> Info:
    """Return the dataset's description; raises DatasetError if it is damaged or of another version."""
    try:
        document = json.loads(read_inside(root, INFO, budget))
        info = Info(
            root,
            float(document["fps"]),
            {str(name): dict(item) for name, item in document["features"].items()},
            str(document["data_path"]),
            None if document.get("video_path") is None else str(document["video_path"]),
        )
        version = document["codebase_version"]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise DatasetError(f"{root / INFO}: cannot be read: {error!r}") from error
    if version != VERSION:
        raise DatasetError(f"{root / INFO}: version {version}, can be read: {VERSION}")
    if not info.fps > 0 or any("dtype" not in item for item in info.features.values()):
        raise DatasetError(f"{root / INFO}: fps or the dtype of a feature is none")
    return info


def read_places(info: Info, budget: Budget) -> list[Place]:
    """Return every episode; raises DatasetError if their list is damaged or names files elsewhere."""
    try:
        return _places(info, budget)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise DatasetError(f"{info.root}: its list of episodes is not as it should be: {error!r}") from error


def path_of(root: Path, template: str, **values: object) -> Path:
    """Return the file of a template such as ``data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet``.

    Raises:
        DatasetError: if the template has other fields than `values`.
        DamagedError: if the path leads out of the dataset.
    """

    def filled(match: re.Match[str]) -> str:
        value = values[match["name"]]
        return f"{int(str(value)):0{match['width'] or 0}d}" if match["decimal"] else str(value)

    try:
        path = _PLACE.sub(filled, template)
    except (KeyError, ValueError) as error:
        raise DatasetError(f"{root / INFO}: {template!r:.200} has other places than {', '.join(values)}") from error
    return inside(root, path)


def _places(info: Info, budget: Budget) -> list[Place]:
    root = info.root
    files = sorted(inside(root, path) for path in (root / "meta/episodes").glob("*/*.parquet"))
    if not files:
        raise DatasetError(f"{root / 'meta/episodes'}: has no parquet files")
    rows = []
    for path in files:
        columns = [name for name in column_names(path) if not name.startswith("stats/")]
        rows += read_table(path, columns, budget).to_pylist()
    starts: dict[Path, int] = {}
    places = []
    for row in sorted(rows, key=lambda item: int(item["episode_index"])):
        chunk, number = row["data/chunk_index"], row["data/file_index"]
        path = path_of(root, info.data_path, chunk_index=chunk, file_index=number)
        start = starts.setdefault(path, row["dataset_from_index"])
        tasks = row["tasks"] or [None]
        first_row = row["dataset_from_index"] - start
        places.append(Place(row["episode_index"], row["length"], tasks[0], path, first_row, row))
    return places
