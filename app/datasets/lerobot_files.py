"""The files of a LeRobot dataset, version 3.0 or 2.1 -> where each episode's rows, images and instruction are.

v3.0 keeps many episodes in a file and says in meta/episodes which rows are whose; v2.1 has a file for each.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets.errors import DamagedError, DatasetError, MissingPackageError

INFO = Path("meta/info.json")
VERSIONS = ("v3.0", "v2.1", "v2.0")
_NUMBERS = ("float16", "float32", "float64", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "bool")


@dataclass(frozen=True)
class Info:
    """What meta/info.json says.

    Attributes:
        features: by name, with dtype, shape and names.
    """

    version: str
    fps: float
    features: Mapping[str, Mapping[str, Any]]
    data_path: str
    video_path: str | None
    chunks_size: int

    def named(self, *dtypes: str) -> list[str]:
        """The features of these types."""
        return [name for name, item in self.features.items() if item["dtype"] in dtypes]

    @property
    def numeric(self) -> list[str]:
        """The features that are numbers in every frame."""
        return self.named(*_NUMBERS)


@dataclass(frozen=True)
class Place:
    """Where an episode is.

    Attributes:
        first_row: in the data file; None in v2.1, whose files hold one episode each.
        row: of meta/episodes, where v3.0 says in which video file an episode begins when.
    """

    index: int
    length: int
    instruction: str | None
    data_file: Path
    first_row: int | None
    row: Mapping[str, Any]


def read_info(root: Path) -> Info:
    """The dataset's description.

    Raises:
        DatasetError: if it is damaged or of another version.
    """
    try:
        document = json.loads((root / INFO).read_text())
        info = Info(
            document["codebase_version"],
            float(document["fps"]),
            document["features"],
            document["data_path"],
            document.get("video_path"),
            int(document.get("chunks_size", 1000)),
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DatasetError(f"{root / INFO}: cannot be read: {error!r}") from error
    if info.version not in VERSIONS:
        raise DatasetError(f"{root / INFO}: version {info.version}, can be read: {', '.join(VERSIONS)}")
    return info


def read_places(root: Path, info: Info) -> list[Place]:
    """Every episode of the dataset.

    Raises:
        DatasetError, DamagedError: if the lists of episodes and tasks cannot be read.
    """
    return _places_3(root, info) if info.version == "v3.0" else _places_2(root, info)


def read_table(path: Path, columns: Iterable[str] | None = None) -> Any:  # noqa: ANN401
    """A parquet file as a pyarrow Table.

    Raises:
        DamagedError: naming the file.
    """
    arrow, parquet = require_arrow()
    try:
        return parquet.read_table(path, columns=None if columns is None else list(columns))
    except (OSError, arrow.ArrowException) as error:
        raise DamagedError(path, f"cannot be read: {str(error)[:200]}") from error


def numbers_of(table: Any, name: str) -> np.ndarray[Any, Any]:  # noqa: ANN401
    """The column as (T,) or (T, k) numbers, in the precision that it was written in."""
    arrow, _ = require_arrow()
    column = table.column(name).combine_chunks()
    if not arrow.types.is_nested(column.type):
        values: np.ndarray[Any, Any] = column.to_numpy(zero_copy_only=False)
        return values
    flat = column.flatten()
    if arrow.types.is_nested(flat.type):
        return np.asarray(column.to_pylist())
    numbers: np.ndarray[Any, Any] = flat.to_numpy(zero_copy_only=False).reshape(len(column), -1)
    return numbers


def _places_3(root: Path, info: Info) -> list[Place]:
    files = sorted((root / "meta/episodes").glob("*/*.parquet"))
    if not files:
        raise DatasetError(f"{root / 'meta/episodes'}: has no parquet files")
    rows = [row for path in files for row in read_table(path, _columns_3(path)).to_pylist()]
    starts: dict[Path, int] = {}
    places = []
    for row in sorted(rows, key=lambda item: int(item["episode_index"])):
        chunk, number = row["data/chunk_index"], row["data/file_index"]
        path = root / info.data_path.format(chunk_index=chunk, file_index=number)
        start = starts.setdefault(path, row["dataset_from_index"])
        tasks = row["tasks"] or [None]
        first_row = row["dataset_from_index"] - start
        places.append(Place(row["episode_index"], row["length"], tasks[0], path, first_row, row))
    return places


def _columns_3(path: Path) -> list[str]:
    _, parquet = require_arrow()
    names = parquet.read_schema(path).names
    return [name for name in names if not name.startswith("stats/")]


def _places_2(root: Path, info: Info) -> list[Place]:
    places = []
    for row in _json_lines(root / "meta/episodes.jsonl"):
        index = row["episode_index"]
        path = root / info.data_path.format(episode_chunk=index // info.chunks_size, episode_index=index)
        tasks = row.get("tasks") or [None]
        places.append(Place(index, row["length"], tasks[0], path, None, row))
    return places


def _json_lines(path: Path) -> list[dict[str, Any]]:
    try:
        return [json.loads(line) for line in path.read_text().splitlines() if line.strip()]
    except (OSError, ValueError) as error:
        raise DatasetError(f"{path}: cannot be read: {error}") from error


def require_arrow() -> tuple[Any, Any]:
    """The modules pyarrow and pyarrow.parquet; raises MissingPackageError."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise MissingPackageError("LeRobot datasets", "pyarrow") from error
    return pyarrow, parquet
