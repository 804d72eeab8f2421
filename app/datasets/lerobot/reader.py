"""LeRobot datasets, versions 3.0, 2.1 and 2.0 -> Parcels.

A dataset that this project exported carries its scenes with it (`meta/roboprompt`) and needs nothing else. Of others
the mapping says what their columns are; a column that is named like one of `DEFAULTS` needs no mapping. An episode's
first frame of a camera is an embedded image, or the first picture of a video.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from app.datasets.bounds import Budget, DamagedError, MissingPackageError, read_inside
from app.datasets.columns import Columns, parcel_of, trajectory_of
from app.datasets.lerobot.files import INFO, Info, Place, path_of, read_info, read_places, read_scene
from app.datasets.lerobot.parquet import numbers_of, read_table, read_value
from app.datasets.options import FeatureMap, ImportOptions, as_name
from app.datasets.parcel import Dataset, Entry, Parcel, rgb_png
from roboprompt_client.types.trajectory_npz import npz_from_trajectory

# FFmpeg tells a container by its content, and some name other files or addresses to play: those are left out.
VIDEO_OPTIONS = {"format_whitelist": "mov,matroska,avi", "protocol_whitelist": "file"}
RGB_BYTES = 3
NEAR_S = 0.5  # of a frame's duration: the picture that is shown at a time begins within it
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


def first_image(root: Path, info: Info, place: Place, budget: Budget, feature: str) -> bytes:
    """The encoded first image of the episode; raises DamagedError, or MissingPackageError for a video without av."""
    if feature not in info.features:
        raise DamagedError(root, f"has no images {feature}")
    if info.features[feature]["dtype"] == "image":
        return _embedded(root, place, feature, budget)
    path, start_s = _video(root, info, place, feature)
    return _first_picture(path, start_s, info.fps, budget)


def _embedded(root: Path, place: Place, feature: str, budget: Budget) -> bytes:
    value = read_value(place.data_file, feature, place.first_row or 0, budget)
    image: Mapping[str, Any] = value if isinstance(value, dict) else {}
    if image.get("bytes"):
        return bytes(image["bytes"])
    if image.get("path"):
        return read_inside(root, str(image["path"]), budget)
    raise DamagedError(place.data_file, f"{feature} has no image in row {place.first_row or 0}")


def _video(root: Path, info: Info, place: Place, feature: str) -> tuple[Path, float]:
    """The video file, and when in it the episode begins, s."""
    if info.video_path is None:
        raise DamagedError(root / "meta/info.json", f"names no video_path for {feature}")
    if info.version == "v3.0":
        numbers = {f"{name}_index": place.row[f"videos/{feature}/{name}_index"] for name in ("chunk", "file")}
        path = path_of(root, info.video_path, video_key=feature, **numbers)
        return path, float(place.row[f"videos/{feature}/from_timestamp"])
    chunk = place.index // info.chunks_size
    return path_of(root, info.video_path, video_key=feature, episode_chunk=chunk, episode_index=place.index), 0.0


def _first_picture(path: Path, start_s: float, fps: float, budget: Budget) -> bytes:
    try:
        import av
    except ImportError as error:
        raise MissingPackageError("videos of LeRobot datasets", "av") from error
    try:
        with av.open(str(path), container_options=VIDEO_OPTIONS) as container:
            stream = container.streams.video[0]
            budget.take(stream.width * stream.height * RGB_BYTES, path)
            if start_s > 0 and stream.time_base is not None:
                container.seek(int(start_s / stream.time_base), stream=stream)
            for picture in container.decode(stream):
                if picture.time is not None and picture.time >= start_s - NEAR_S / fps:
                    return rgb_png(np.asarray(picture.to_ndarray(format="rgb24"), np.uint8))
    except (OSError, ValueError, IndexError) as error:  # av's own errors are among both
        raise DamagedError(path, f"cannot be decoded: {error}") from error
    raise DamagedError(path, f"ends before {start_s:.3f} s")


def looks_like(path: Path) -> bool:
    """Whether the folder says that it is a LeRobot dataset."""
    return (path / INFO).exists()


def open_lerobot(root: Path, options: ImportOptions) -> Dataset:
    """The episodes; raises DatasetError if their list cannot be read, or for a mapping of another form."""
    root = root.resolve()
    budget = Budget(root, options.limits)
    info = read_info(root, budget)
    found = {part: name for part, name in DEFAULTS.items() if name in info.features}
    mapping = FeatureMap(gripper_open_above=0.5).changed(found).changed(options.features)

    @lru_cache(FILES_IN_MEMORY)
    def table(path: Path) -> Any:  # noqa: ANN401
        return read_table(path, info.numeric, Budget(path, options.limits))

    entries = (
        Entry(f"episode_{place.index:06d}", partial(_read, root, info, place, table, mapping, options))
        for place in read_places(root, info, budget)
    )
    return Dataset(f"LeRobot {info.version}", tuple(entries))


def _read(
    root: Path, info: Info, place: Place, table_of: Callable[[Path], Any], mapping: FeatureMap, options: ImportOptions
) -> Parcel:
    budget = Budget(f"{root}: episode {place.index}", options.limits)
    table = table_of(place.data_file)
    if place.first_row is not None:
        table = table.slice(place.first_row, place.length)
    columns = {name: numbers_of(table, name) for name in info.numeric}
    if (rows := table.num_rows) != place.length:
        raise DamagedError(place.data_file, f"has {rows} rows of episode {place.index}, expected {place.length}")
    if (scene := read_scene(root, place.index, budget)) is not None:
        return _exported(*scene, columns, mapping, options)
    return parcel_of(
        name=f"episode_{place.index:06d}",
        source=f"LeRobot {info.version}",
        task=as_name(root.name),
        instruction=place.instruction,
        columns=columns,
        frequency_hz=info.fps,
        mapping=mapping,
        options=options,
        image=partial(first_image, root, info, place, budget),
        image_columns=info.named("image", "video"),
    )


def _exported(
    metadata: dict[str, Any], images: dict[str, bytes], columns: Columns, mapping: FeatureMap, options: ImportOptions
) -> Parcel:
    """An episode that this project exported, as it was uploaded once."""
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
    """The mapping of tracked objects: their poses stand one after the other in two columns."""
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
