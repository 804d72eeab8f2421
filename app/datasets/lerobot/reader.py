"""Reads LeRobot datasets, version 3.0.

A dataset exported by this project contains its scenes (`meta/roboprompt`). Other datasets need a mapping of their
columns, unless these are named as in `DEFAULTS`. A camera's first frame is an embedded image or the start of a video.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets.bounds import Budget, DamagedError, read_inside
from app.datasets.columns import ColumnEpisode, Columns, trajectory_of
from app.datasets.lerobot.files import INFO, VERSION, Info, Place, read_info, read_places, read_scene
from app.datasets.lerobot.tables import numbers_of, read_table, read_value
from app.datasets.lerobot.video import first_picture
from app.datasets.options import FeatureMap, ImportOptions, as_name
from app.datasets.parcel import Dataset, Entry, Parcel
from roboprompt_client.types.trajectory import npz_from_trajectory

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


def first_image(info: Info, place: Place, budget: Budget, feature: str) -> bytes:
    """Return the episode's encoded first image; raises DamagedError, or MissingPackageError for videos without av."""
    if feature not in info.features:
        raise DamagedError(info.root, f"has no images {feature}")
    if info.features[feature]["dtype"] == "image":
        return _embedded(info.root, place, feature, budget)
    return first_picture(info, place, feature, budget)


def _embedded(root: Path, place: Place, feature: str, budget: Budget) -> bytes:
    value = read_value(place.data_file, feature, place.first_row, budget)
    image: Mapping[str, Any] = value if isinstance(value, dict) else {}
    if image.get("bytes"):
        return bytes(image["bytes"])
    if image.get("path"):
        return read_inside(root, str(image["path"]), budget)
    raise DamagedError(place.data_file, f"{feature} has no image in row {place.first_row}")


def looks_like(path: Path) -> bool:
    """Return whether the folder has the description of a LeRobot dataset."""
    return (path / INFO).exists()


def open_lerobot(root: Path, options: ImportOptions) -> Dataset:
    """Return the episodes; raises DatasetError for an unreadable list or an invalid mapping."""
    root = root.resolve()
    budget = Budget(root, options.max_unpacked_bytes)
    info = read_info(root, budget)
    found = {part: name for part, name in DEFAULTS.items() if name in info.features}
    mapping = FeatureMap(gripper_open_above=0.5).changed(found).changed(options.features)

    @lru_cache(FILES_IN_MEMORY)
    def table(path: Path) -> Any:  # noqa: ANN401
        return read_table(path, info.numeric, Budget(path, options.max_unpacked_bytes))

    entries = (
        Entry(f"episode_{place.index:06d}", partial(_read, info, place, table, mapping, options))
        for place in read_places(info, budget)
    )
    return Dataset(f"LeRobot {VERSION}", tuple(entries))


def _read(
    info: Info, place: Place, table_of: Callable[[Path], Any], mapping: FeatureMap, options: ImportOptions
) -> Parcel:
    budget = Budget(f"{info.root}: episode {place.index}", options.max_unpacked_bytes)
    table = table_of(place.data_file).slice(place.first_row, place.length)
    columns = {name: numbers_of(table, name) for name in info.numeric}
    if (rows := table.num_rows) != place.length:
        raise DamagedError(place.data_file, f"has {rows} rows of episode {place.index}, expected {place.length}")
    if (scene := read_scene(info.root, place.index, budget)) is not None:
        return _exported(*scene, columns, mapping, options)
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
    metadata: dict[str, Any], images: dict[str, bytes], columns: Columns, mapping: FeatureMap, options: ImportOptions
) -> Parcel:
    """Return an episode that this project exported, as it was uploaded."""
    tracked = _tracked(columns, [item["name"] for item in metadata["objects"]])
    if JOINT_VELOCITIES not in columns:
        columns = {**columns, JOINT_VELOCITIES: np.zeros((len(columns[POSITIONS]), 0))}
    mapping = mapping.changed({"objects": tracked, "joint_velocities": JOINT_VELOCITIES})
    trajectory = replace(
        trajectory_of(columns, mapping, metadata["control_frequency_hz"]),
        gripper_width_m=columns.get(GRIPPER_WIDTH),
        wrenches_n_nm=columns.get(WRENCHES),
    )
    files = {"trajectory": npz_from_trajectory(trajectory), **images}
    return Parcel({**metadata, **options.given}, files)


def _tracked(columns: Columns, names: list[str]) -> list[dict[str, str]]:
    """Return the mapping of tracked objects, whose poses are side by side in two columns."""
    if OBJECT_POSITIONS not in columns:
        return []
    turned = OBJECT_QUATERNIONS in columns
    return [
        {
            "name": name,
            "position": f"{OBJECT_POSITIONS}[{3 * k}:{3 * k + 3}]",
            **({"rotation": f"{OBJECT_QUATERNIONS}[{4 * k}:{4 * k + 4}]"} if turned else {}),
        }
        for k, name in enumerate(names)
    ]
