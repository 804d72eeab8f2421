"""Reads LeRobot datasets, version 3.0: meta/episodes lists where the rows and videos of each episode are.

A dataset exported by this project contains its scenes, for which LeRobot has no place (`SCENES`). Other datasets need a
mapping of their columns, unless these are named as in `DEFAULTS`. A camera's first frame is an embedded image or the
start of a video. Parquet files of strangers are read within a budget: a few bytes may stand for any number of rows.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets.bounds import Budget, DamagedError, DatasetError, inside, read_inside
from app.datasets.columns import ColumnEpisode, Columns, FeatureMap, trajectory_of
from app.datasets.options import ImportOptions, as_name
from app.datasets.parcel import Dataset, Entry, Parcel, checked_metadata, rgb_png
from roboprompt_client.types.trajectory import npz_from_trajectory

VERSION = "v3.0"
INFO = Path("meta/info.json")
SCENES = "meta/roboprompt/episode_{:06d}"  # METADATA as it was uploaded, and the image files, byte for byte
METADATA = "metadata.json"
JOINT_VELOCITIES = "observation.joint_velocities"
JOINT_POSITIONS = "observation.joint_positions"
POSITIONS = "observation.end_effector_position"
QUATERNIONS = "observation.end_effector_quaternion_xyzw"
GRIPPER = "observation.gripper_open"
TIMES = "observation.time_s"
GRIPPER_WIDTH = "observation.gripper_width_m"
WRENCHES = "observation.wrench_n_nm"
OBJECT_POSITIONS = "observation.object_positions"
OBJECT_QUATERNIONS = "observation.object_quaternions_xyzw"
DEFAULTS = {
    "joint_velocities": JOINT_VELOCITIES,
    "joint_positions": JOINT_POSITIONS,
    "end_effector_positions": POSITIONS,
    "end_effector_rotations": QUATERNIONS,
    "gripper": GRIPPER,
    "timestamps": TIMES,
}
FILES_IN_MEMORY = 2  # neighboring episodes share a file of up to 100 MB
# FFmpeg detects containers by content, and some refer to other files or addresses: those are not allowed.
VIDEO_OPTIONS = {"format_whitelist": "mov,matroska,avi", "protocol_whitelist": "file"}
RGB_BYTES = 3
NEAR_S = 0.5  # tolerance for the time of a picture, in frame durations
ROWS_AT_ONCE = 4096
FEW_ROWS = 16  # of images
MAX_DESCRIPTION_BYTES = 100_000_000  # of a file's schema and row groups, and as many of these
_LARGEST_NUMBER_BYTES = 8
_FIELD = re.compile(r"\{(?P<name>\w+)(?::0?(?P<width>\d))?(?P<decimal>d?)\}")
_NUMBERS = ("float16", "float32", "float64", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "bool")


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


@dataclass(frozen=True)
class Place:
    """The location of an episode."""

    index: int
    length: int
    instruction: str | None
    data_file: Path
    first_row: int  # in the data file
    row: Mapping[str, Any]  # of meta/episodes, which has the start of an episode in its video file


def looks_like(path: Path) -> bool:
    """Return whether the folder has the description of a LeRobot dataset."""
    return (path / INFO).exists()


def open_lerobot(root: Path, options: ImportOptions) -> Dataset:
    """Return the episodes; raises DatasetError for an unreadable list or an invalid mapping."""
    root = root.resolve()
    budget = Budget(root, options.max_unpacked_bytes)
    info = _info(root, budget)
    found = {part: name for part, name in DEFAULTS.items() if name in info.features}
    mapping = FeatureMap(gripper_open_above=0.5).changed(found).changed(options.features)

    @lru_cache(FILES_IN_MEMORY)
    def table(path: Path) -> Any:  # noqa: ANN401
        return read_table(path, info.named(*_NUMBERS), Budget(path, options.max_unpacked_bytes))

    try:
        places = _places(info, budget)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise DatasetError(f"{root}: its list of episodes is not as it should be: {error!r}") from error
    entries = (
        Entry(f"episode_{place.index:06d}", partial(_read, info, place, table, mapping, options)) for place in places
    )
    return Dataset(f"LeRobot {VERSION}", tuple(entries))


def _info(root: Path, budget: Budget) -> Info:
    """Return the dataset's description; raises DatasetError if it is damaged or of another version."""
    try:
        document = json.loads(read_inside(root, INFO, budget))
        version, video_path = document["codebase_version"], document.get("video_path")
        info = Info(
            root,
            float(document["fps"]),
            {str(name): dict(item) for name, item in document["features"].items()},
            str(document["data_path"]),
            None if video_path is None else str(video_path),
        )
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise DatasetError(f"{root / INFO}: cannot be read: {error!r}") from error
    if version != VERSION:
        raise DatasetError(f"{root / INFO}: version {version}, can be read: {VERSION}")
    if not info.fps > 0 or any("dtype" not in item for item in info.features.values()):
        raise DatasetError(f"{root / INFO}: fps or the dtype of a feature is none")
    return info


def _places(info: Info, budget: Budget) -> list[Place]:
    """Return every episode; raises DatasetError if their list names files elsewhere."""
    root = info.root
    files = sorted(inside(root, path) for path in (root / "meta/episodes").glob("*/*.parquet"))
    if not files:
        raise DatasetError(f"{root / 'meta/episodes'}: has no parquet files")
    rows: list[dict[str, Any]] = []
    for path in files:
        columns = [name for name in column_names(path) if not name.startswith("stats/")]
        rows += read_table(path, columns, budget).to_pylist()
    starts: dict[Path, int] = {}
    places = []
    for row in sorted(rows, key=lambda item: int(item["episode_index"])):
        numbers = {"chunk_index": row["data/chunk_index"], "file_index": row["data/file_index"]}
        path = _path_of(root, info.data_path, **numbers)
        start = starts.setdefault(path, row["dataset_from_index"])
        tasks = row["tasks"] or [None]
        first_row = row["dataset_from_index"] - start
        places.append(Place(row["episode_index"], row["length"], tasks[0], path, first_row, row))
    return places


def _path_of(root: Path, template: str, **values: object) -> Path:
    """Return the file of a template such as ``data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet``.

    Raises:
        DatasetError: if the template has other fields than `values`.
        DamagedError: if the path leads out of the dataset.
    """

    def filled(match: re.Match[str]) -> str:
        value = values[match["name"]]
        return f"{int(str(value)):0{match['width'] or 0}d}" if match["decimal"] else str(value)

    try:
        path = _FIELD.sub(filled, template)
    except (KeyError, ValueError) as error:
        raise DatasetError(f"{root / INFO}: {template!r:.200} has other places than {', '.join(values)}") from error
    return inside(root, path)


def _read(
    info: Info, place: Place, table_of: Callable[[Path], Any], mapping: FeatureMap, options: ImportOptions
) -> Parcel:
    budget = Budget(f"{info.root}: episode {place.index}", options.max_unpacked_bytes)
    table = table_of(place.data_file).slice(place.first_row, place.length)
    columns = {name: numbers_of(table, name) for name in info.named(*_NUMBERS)}
    if (rows := table.num_rows) != place.length:
        raise DamagedError(place.data_file, f"has {rows} rows of episode {place.index}, expected {place.length}")
    scene = info.root / SCENES.format(int(place.index))
    if scene.exists():
        return _exported(info.root, scene, columns, mapping, options, budget)
    return ColumnEpisode(
        name=f"episode_{place.index:06d}",
        source=f"LeRobot {VERSION}",
        task=as_name(info.root.name),
        instruction=place.instruction,
        columns=columns,
        frequency_hz=info.fps,
        image=partial(first_image, info, place, budget),
        image_columns=info.named("image", "video"),
    ).parcel(mapping, options)


def _exported(
    root: Path, scene: Path, columns: Columns, mapping: FeatureMap, options: ImportOptions, budget: Budget
) -> Parcel:
    """Return an episode that this project exported, as it was uploaded."""
    try:
        metadata = checked_metadata(scene / METADATA, json.loads(read_inside(root, scene / METADATA, budget)))
    except ValueError as error:
        raise DamagedError(scene / METADATA, f"is not JSON: {error}") from error
    names = sorted(item.name for item in scene.iterdir() if item.name != METADATA)
    images = {name: read_inside(root, scene / name, budget) for name in names}
    if JOINT_VELOCITIES not in columns:
        columns = {**columns, JOINT_VELOCITIES: np.zeros((len(columns[POSITIONS]), 0))}
    tracked = _tracked(columns, [item["name"] for item in metadata["objects"]])
    mapping = mapping.changed({"objects": tracked, "joint_velocities": JOINT_VELOCITIES})
    trajectory = replace(
        trajectory_of(columns, mapping, metadata["control_frequency_hz"]),
        gripper_width_m=columns.get(GRIPPER_WIDTH),
        wrenches_n_nm=columns.get(WRENCHES),
    )
    return Parcel({**metadata, **options.given}, {"trajectory": npz_from_trajectory(trajectory), **images})


def _tracked(columns: Columns, names: list[str]) -> list[dict[str, str]]:
    """Return the mapping of tracked objects, whose poses are side by side in two columns."""
    if OBJECT_POSITIONS not in columns:
        return []
    parts = {"position": (OBJECT_POSITIONS, 3)}
    if OBJECT_QUATERNIONS in columns:
        parts["rotation"] = (OBJECT_QUATERNIONS, 4)
    return [
        {"name": name, **{part: f"{column}[{size * k}:{size * (k + 1)}]" for part, (column, size) in parts.items()}}
        for k, name in enumerate(names)
    ]


def first_image(info: Info, place: Place, budget: Budget, feature: str) -> bytes:
    """Return the episode's encoded first image; raises DamagedError."""
    if feature not in info.features:
        raise DamagedError(info.root, f"has no images {feature}")
    if info.features[feature]["dtype"] != "image":
        return _first_picture(info, place, feature, budget)
    value = read_value(place.data_file, feature, place.first_row, budget)
    image: Mapping[str, Any] = value if isinstance(value, dict) else {}
    if image.get("bytes"):
        return bytes(image["bytes"])
    if image.get("path"):
        return read_inside(info.root, str(image["path"]), budget)
    raise DamagedError(place.data_file, f"{feature} has no image in row {place.first_row}")


def _first_picture(info: Info, place: Place, feature: str, budget: Budget) -> bytes:
    """Return the first picture of an episode's video as a PNG."""
    import av  # of an extra

    path, start_s = _video(info, place, feature)
    try:
        with av.open(str(path), container_options=VIDEO_OPTIONS) as container:
            stream = container.streams.video[0]
            budget.take(stream.width * stream.height * RGB_BYTES, path)
            if start_s > 0 and stream.time_base is not None:
                container.seek(int(start_s / stream.time_base), stream=stream)
            for picture in container.decode(stream):
                if picture.time is not None and picture.time >= start_s - NEAR_S / info.fps:
                    return rgb_png(np.asarray(picture.to_ndarray(format="rgb24"), np.uint8))
    except (OSError, ValueError, IndexError) as error:  # av's own errors are among both
        raise DamagedError(path, f"cannot be decoded: {error}") from error
    raise DamagedError(path, f"ends before {start_s:.3f} s")


def _video(info: Info, place: Place, feature: str) -> tuple[Path, float]:
    """Return the video file, and when in it the episode begins, s."""
    if info.video_path is None:
        raise DamagedError(info.root / INFO, f"names no video_path for {feature}")
    try:
        numbers = {f"{name}_index": int(place.row[f"videos/{feature}/{name}_index"]) for name in ("chunk", "file")}
        start_s = float(place.row[f"videos/{feature}/from_timestamp"])
    except (KeyError, TypeError, ValueError) as error:
        raise DamagedError(info.root / "meta/episodes", f"does not say where {feature} is: {error!r}") from error
    return _path_of(info.root, info.video_path, video_key=feature, **numbers), start_s


def read_table(path: Path, columns: Sequence[str] | None, budget: Budget) -> Any:  # noqa: ANN401
    """Return columns of a file (None: all) as a pyarrow Table; raises DamagedError, also beyond the budget."""
    with _opened(path) as file:
        schema = file.schema_arrow
        names = schema.names if columns is None else list(columns)
        if absent := set(names) - set(schema.names):
            raise DamagedError(path, f"has no column {sorted(absent)[0]}")
        fields = [schema.field(name) for name in names]
        _check(path, file.metadata, set(names), budget)
        batches = []
        for batch in file.iter_batches(ROWS_AT_ONCE, columns=names):
            budget.take(batch.nbytes, path)
            batches.append(batch)
        arrow, _ = arrow_and_parquet()
        return arrow.Table.from_batches(batches, schema=arrow.schema(fields)).select(names)


def read_value(path: Path, column: str, row: int, budget: Budget) -> Any:  # noqa: ANN401
    """Return the value of one row, reading few others; raises DamagedError, also for a row that does not exist."""
    with _opened(path) as file:
        for group in range(file.num_row_groups):
            num_rows = file.metadata.row_group(group).num_rows
            if row < num_rows:
                for batch in file.iter_batches(FEW_ROWS, row_groups=[group], columns=[column]):
                    if row < batch.num_rows:
                        budget.take(batch.slice(row, 1).nbytes, path)
                        return batch.column(0)[row].as_py()
                    row -= batch.num_rows
            row -= num_rows
    raise DamagedError(path, f"has no such row of {column}")


def column_names(path: Path) -> list[str]:
    """Return the names of a file's columns; raises DamagedError."""
    with _opened(path) as file:
        return list(file.schema_arrow.names)


def numbers_of(table: Any, name: str) -> np.ndarray[Any, Any]:  # noqa: ANN401
    """Return the column as (T,) or (T, k) numbers in the stored precision."""
    arrow, _ = arrow_and_parquet()
    column = table.column(name).combine_chunks()
    if not arrow.types.is_nested(column.type):
        values: np.ndarray[Any, Any] = column.to_numpy(zero_copy_only=False)
        return values
    flat = column.flatten()
    if arrow.types.is_nested(flat.type):
        return np.asarray(column.to_pylist())
    numbers: np.ndarray[Any, Any] = flat.to_numpy(zero_copy_only=False).reshape(len(column), -1)
    return numbers


def arrow_and_parquet() -> tuple[Any, Any]:
    """Return the modules pyarrow and pyarrow.parquet, of an extra."""
    import pyarrow
    from pyarrow import parquet

    return pyarrow, parquet


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    arrow, parquet = arrow_and_parquet()
    if path.exists() and not path.is_file():
        raise DamagedError(path, "is not a regular file")
    limits = {"thrift_string_size_limit": MAX_DESCRIPTION_BYTES, "thrift_container_size_limit": MAX_DESCRIPTION_BYTES}
    try:
        with parquet.ParquetFile(path, **limits) as file:
            yield file
    except (OSError, arrow.ArrowException) as error:
        raise DamagedError(path, f"cannot be read: {str(error)[:200]}") from error


def _check(path: Path, metadata: Any, names: set[str], budget: Budget) -> None:  # noqa: ANN401
    """Refuse a file that is too large by its own metadata."""
    num_bytes = 0
    for group in map(metadata.row_group, range(metadata.num_row_groups)):
        if group.num_rows < 0:
            raise DamagedError(path, f"has a row group of {group.num_rows} rows")
        for column in map(group.column, range(group.num_columns)):
            if _is_of(column.path_in_schema, names):
                num_bytes += max(column.num_values * _LARGEST_NUMBER_BYTES, column.total_uncompressed_size)
    if num_bytes > budget.left_bytes:
        budget.take(num_bytes, path)


def _is_of(path: str, names: set[str]) -> bool:
    """Return whether a leaf such as ``observation.images.element`` belongs to one of the columns."""
    return path in names or any(path.startswith(f"{name}.") for name in names)
