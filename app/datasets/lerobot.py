"""LeRobot datasets, versions 3.0, 2.1 and 2.0, without the package `lerobot`.

A dataset that this project exported carries its scenes with it (`meta/roboprompt`) and needs nothing else. Of others
the mapping says what their columns are; a column that is named like one of `DEFAULTS` needs no mapping.
"""

from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from app.datasets.columns import Columns, trajectory_of
from app.datasets.errors import DamagedError
from app.datasets.lerobot_files import INFO, Info, Place, read_info, read_places
from app.datasets.lerobot_images import first_image
from app.datasets.lerobot_scenes import Scene, read_scene
from app.datasets.limits import Budget
from app.datasets.mapped import recording_of
from app.datasets.mapping import FeatureMap
from app.datasets.options import ImportOptions, as_name
from app.datasets.parquet import numbers_of, read_table
from app.datasets.recording import Dataset, Entry, Parcel
from app.pipeline.trajectory_npz import npz_from_trajectory

JOINT_VELOCITIES = "observation.joint_velocities"
JOINT_POSITIONS = "observation.joint_positions"
POSITIONS = "observation.end_effector_position"
QUATERNIONS = "observation.end_effector_quaternion_xyzw"
GRIPPER = "observation.gripper_open"
TIMES = "observation.time_s"
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
FILES_IN_MEMORY = 2  # neighbouring episodes share a file of up to 100 MB


def looks_like(path: Path) -> bool:
    """Whether the folder says that it is a LeRobot dataset."""
    return (path / INFO).exists()


def open_lerobot(root: Path, options: ImportOptions) -> Dataset:
    """The dataset's episodes.

    Raises:
        DatasetError: if its description or its list of episodes cannot be read, or for a mapping of another form.
    """
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
    scene = read_scene(root, place.index, budget)
    name = f"episode_{place.index:06d}"
    if scene is not None:
        return _exported(scene, columns, mapping, options)
    return recording_of(
        name=name,
        source=f"LeRobot {info.version}",
        task=as_name(root.name),
        instruction=place.instruction,
        columns=columns,
        frequency_hz=info.fps,
        mapping=mapping,
        options=options,
        image=partial(first_image, root, info, place, budget),
        image_columns=info.named("image", "video"),
    ).parcel()


def _exported(scene: Scene, columns: Columns, mapping: FeatureMap, options: ImportOptions) -> Parcel:
    """An episode that this project exported, as it was uploaded once."""
    metadata = dict(scene.metadata)
    tracked = _tracked(columns, [item["name"] for item in metadata["objects"]])
    trajectory = trajectory_of(columns, mapping.changed({"objects": tracked}), metadata["control_frequency_hz"])
    given = {"task": options.task, "instruction": options.instruction}
    metadata.update({name: value for name, value in given.items() if value is not None})
    return Parcel(metadata, {"trajectory": npz_from_trajectory(trajectory), **scene.images})


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
