"""Which columns of a recording are what, as the user or the format says.

As JSON, e.g. for DROID in LeRobot's format; a column may be cut, `observation.state[0:3]`:

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

from app.datasets.bounds import DatasetError
from roboprompt_client.camera import camera_from_json
from roboprompt_client.errors import InvalidInputError

RotationFormat = Literal["quaternion_xyzw", "quaternion_wxyz", "euler_xyz", "rotation_vector"]
ROTATION_FORMATS: tuple[RotationFormat, ...] = get_args(RotationFormat)


@dataclass(frozen=True)
class TrackedObject:
    """An object whose pose the recording has in every frame."""

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
        """The camera's."""
        return str(self.calibration["name"])


@dataclass(frozen=True)
class FeatureMap:
    """Where a trajectory's parts stand; None where the recording has none.

    Attributes:
        rotation_format: of every rotation; Euler angles in radians, extrinsic.
        gripper: the measured width rather than the command, which comes before the fingers have done it.
        gripper_open_above, gripper_open_below: the gripper is open where its column is above, or below; one of them.
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
        """With those parts replaced that a JSON document names; raises DatasetError for a part that does not exist."""
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
    """The document of the user's JSON file, and over it pairs `part=column`; raises DatasetError naming either."""
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
