"""Options of an import: its objects, and a mapping of its columns.

The file of objects has names, mask ids and poses. It is one list for all episodes, or an object with any of `default`,
`variations` and `episodes`, of which the most specific one is used:

    {"default": [{"name": "drawer", "mask_ids": [98]}],
     "variations": {"1": [{"name": "drawer", "mask_ids": [105]}]},
     "episodes": {"episode7": [{"name": "drawer", "position": [0.2, 0.0, 1.1], "quaternion_xyzw": [0, 0, 0, 1]}]}}

RLBench records the poses of a task's objects in `task_low_dim_state`: with `"low_dim_state": 7` the object's pose
(x y z, quaternion xyzw) begins at index 7.

The mapping of columns is JSON, for example for DROID in LeRobot's format; columns may be sliced:

    {"joint_positions": "observation.state.joint_position",
     "end_effector_positions": "observation.state.cartesian_position[0:3]",
     "end_effector_rotations": "observation.state.cartesian_position[3:6]", "rotation_format": "euler_xyz",
     "gripper": "observation.state.gripper_position", "gripper_open_below": 0.25,
     "objects": [{"name": "cube", "position": "observation.cube_pos", "rotation": "observation.cube_quat"}],
     "cameras": [{"name": "front", "rgb": "observation.images.front", "depth": "observation.depth.front",
                  "intrinsics": {"fx": 600, "fy": 600, "cx": 320, "cy": 240}, "camera_to_world": [[1, 0, 0, 0], ...]}]}
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal, get_args

from app.datasets.bounds import MAX_UNPACKED_BYTES, DatasetError
from app.datasets.parcel import ObjectEntry
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import camera_from_json
from roboprompt_client.types.names import NAME_PATTERN

Objects = tuple[ObjectEntry, ...]
_FIELDS = {"name", "position", "quaternion_xyzw", "mask_ids", "low_dim_state"}


@dataclass(frozen=True)
class KnownObjects:
    """The objects of a dataset's scenes."""

    default: Objects = ()
    variations: Mapping[str, Objects] = field(default_factory=dict)
    episodes: Mapping[str, Objects] = field(default_factory=dict)

    def of(self, episode: str, variation: int | None = None) -> Objects:
        """Return the objects of an episode; none if the file has none for it.

        Args:
            episode: its name in the dataset; an entry `episode7` also matches `open_drawer/episodes/episode7`.
        """
        for name in (episode, episode.rpartition("/")[2]):
            if name in self.episodes:
                return self.episodes[name]
        return self.variations.get(str(variation), self.default)


def read_objects(path: Path) -> KnownObjects:
    """Read a file of objects; raises DatasetError naming the file and the fault."""
    try:
        document = json.loads(path.read_text())
        if isinstance(document, list):
            return KnownObjects(_objects(document))
        if unknown := set(document) - {"default", "variations", "episodes"}:
            raise ValueError(f"{sorted(unknown)[0]!r} is none of default, variations, episodes")
        groups = (document.get(kind, {}) for kind in ("variations", "episodes"))
        named = [{name: _objects(items) for name, items in group.items()} for group in groups]
        return KnownObjects(_objects(document.get("default", [])), *named)
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise DatasetError(
            f"{path}: {error}; it must be a list of objects or have default, variations, episodes"
        ) from error


def _objects(items: list[Mapping[str, Any]]) -> Objects:
    return tuple(_object(item) for item in items)


def _object(item: Mapping[str, Any]) -> ObjectEntry:
    if unknown := set(item) - _FIELDS:
        raise ValueError(f"{sorted(unknown)[0]!r} is none of {', '.join(sorted(_FIELDS))}")
    if "name" not in item:
        raise ValueError(f"an object has no name: {dict(item)}")
    position, quaternion = item.get("position"), item.get("quaternion_xyzw")
    return ObjectEntry(
        item["name"],
        None if position is None else tuple(map(float, position)),
        None if quaternion is None else tuple(map(float, quaternion)),
        tuple(map(int, item.get("mask_ids", ()))),
        None if item.get("low_dim_state") is None else int(item["low_dim_state"]),
    )


@dataclass(frozen=True)
class ImportOptions:
    """Options for every episode.

    Attributes:
        task, instruction: override those of the dataset.
        objects: that the dataset does not contain.
        cameras: only these; None for all.
        features: changes of the mapping of columns, as JSON, for formats with columns.
        max_unpacked_bytes: of an episode, or of the list of episodes.
    """

    task: str | None = None
    instruction: str | None = None
    objects: KnownObjects = field(default_factory=KnownObjects)
    cameras: tuple[str, ...] | None = None
    features: Mapping[str, Any] = field(default_factory=dict)
    max_unpacked_bytes: int = MAX_UNPACKED_BYTES

    @property
    def given(self) -> dict[str, str]:
        """The parts of an episode's metadata that the user overrides."""
        said = {"task": self.task, "instruction": self.instruction}
        return {name: value for name, value in said.items() if value is not None}

    def wants(self, camera: str) -> bool:
        return self.cameras is None or camera in self.cameras


def as_name(text: str) -> str:
    """Return `text` with characters that names must not have replaced by underscores; it may still be invalid."""
    allowed = "".join(letter if letter.isascii() and (letter.isalnum() or letter in " _-.") else "_" for letter in text)
    name = allowed.strip(" _-.")[:64].strip(" _-.")
    return name if NAME_PATTERN.fullmatch(name) else text


RotationFormat = Literal["quaternion_xyzw", "quaternion_wxyz", "euler_xyz", "rotation_vector"]
ROTATION_FORMATS: tuple[RotationFormat, ...] = get_args(RotationFormat)


@dataclass(frozen=True)
class TrackedObject:
    """The columns of an object whose pose is recorded in every frame."""

    name: str
    position: str
    rotation: str | None = None


@dataclass(frozen=True)
class MappedCamera:
    """A calibrated camera and the columns of its images."""

    calibration: Mapping[str, Any]  # as an upload's metadata has it: name, intrinsics, camera_to_world, depth_scale
    rgb: str | None = None
    depth: str | None = None

    @property
    def name(self) -> str:
        return str(self.calibration["name"])


@dataclass(frozen=True)
class FeatureMap:
    """The columns of a trajectory's parts; None for parts that were not recorded.

    Attributes:
        rotation_format: of every rotation; Euler angles in radians, extrinsic.
        gripper: better the measured width than the command, which precedes the motion of the fingers.
        gripper_open_above, gripper_open_below: threshold of an open gripper; exactly one of them.
    """

    joint_velocities: str | None = None
    joint_positions: str | None = None
    end_effector_positions: str | None = None
    end_effector_rotations: str | None = None
    rotation_format: RotationFormat = "quaternion_xyzw"
    gripper: str | None = None
    gripper_open_above: float | None = None
    gripper_open_below: float | None = None
    timestamps: str | None = None
    objects: tuple[TrackedObject, ...] = ()
    cameras: tuple[MappedCamera, ...] = field(default=())

    def __post_init__(self) -> None:
        if self.rotation_format not in ROTATION_FORMATS:
            remedy = ", ".join(ROTATION_FORMATS)
            raise InvalidInputError("mapping.rotation_format", f"is {self.rotation_format!r}", remedy)

    def changed(self, changes: Mapping[str, Any]) -> "FeatureMap":
        """Return the mapping with the parts of a JSON document replaced; raises DatasetError for an unknown part."""
        known = [item.name for item in fields(self)]
        if unknown := set(changes) - set(known):
            raise DatasetError(f"mapping: {sorted(unknown)[0]!r} is none of {', '.join(known)}")
        values = dict(changes)
        if any(name.startswith("gripper_open") for name in values):
            values = {"gripper_open_above": None, "gripper_open_below": None, **values}
        try:
            if "objects" in values:
                values["objects"] = tuple(TrackedObject(**item) for item in values["objects"])
            if "cameras" in values:
                values["cameras"] = tuple(map(_camera, values["cameras"]))
            return replace(self, **values)
        except (TypeError, KeyError) as error:
            raise DatasetError(f"mapping: {error}: see docs/datasets.md for the form") from error


def read_changes(path: Path | None, pairs: tuple[str, ...]) -> dict[str, Any]:
    """Return the mapping of a JSON file, overridden by pairs `part=column`; raises DatasetError."""
    changes: dict[str, Any] = {}
    if path is not None:
        try:
            changes.update(json.loads(path.read_text()))
        except (OSError, ValueError, TypeError) as error:
            raise DatasetError(f"{path}: {error}") from error
    for pair in pairs:
        part, equals, column = pair.partition("=")
        if not equals:
            raise DatasetError(f"--feature {pair!r}: write part=column, e.g. gripper=action[6]")
        changes[part] = float(column) if part.startswith("gripper_open") else column
    return changes


def _camera(value: Mapping[str, Any]) -> MappedCamera:
    calibration = {name: item for name, item in value.items() if name not in ("rgb", "depth")}
    camera_from_json(calibration)
    return MappedCamera(calibration, value.get("rgb"), value.get("depth"))
