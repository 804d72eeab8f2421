"""Which columns of a recording are what: a table of named arrays -> Trajectory and objects.

As JSON, e.g. for DROID in LeRobot's format; a column may be cut, `observation.state[0:3]`:

    {"joint_positions": "observation.state.joint_position",
     "end_effector_positions": "observation.state.cartesian_position[0:3]",
     "end_effector_rotations": "observation.state.cartesian_position[3:6]", "rotation_format": "euler_xyz",
     "gripper": "action.gripper_position", "gripper_open_below": 0.5,
     "objects": [{"name": "cube", "position": "observation.cube_pos", "rotation": "observation.cube_quat"}],
     "cameras": [{"name": "front", "rgb": "observation.images.front", "depth": "observation.depth.front",
                  "intrinsics": {"fx": 600, "fy": 600, "cx": 320, "cy": 240}, "camera_to_world": [[1, 0, 0, 0], ...]}]}
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from scipy.spatial.transform import Rotation

from app.datasets.errors import DatasetError
from app.datasets.recording import ObjectEntry
from app.pipeline.episode import Array, Trajectory
from app.pipeline.errors import InvalidInputError
from app.pipeline.metadata import camera_from_json

Columns = Mapping[str, np.ndarray[Any, Any]]
RotationFormat = Literal["quaternion_xyzw", "quaternion_wxyz", "euler_xyz", "rotation_vector"]
ROTATION_FORMATS: tuple[RotationFormat, ...] = get_args(RotationFormat)
_SELECTOR = re.compile(r"(?P<column>.*?)(?:\[(?P<start>-?\d+)(?P<cut>:(?P<stop>-?\d*))?\])?")


@dataclass(frozen=True)
class TrackedObject:
    """An object whose pose the recording has in every frame."""

    name: str
    position: str
    rotation: str | None = None


@dataclass(frozen=True)
class MappedCamera:
    """A calibrated camera and the columns of its images.

    Attributes:
        calibration: as an upload's metadata has it: name, intrinsics, camera_to_world, depth_scale.
    """

    calibration: Mapping[str, Any]
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

    def changed(self, wishes: Mapping[str, Any]) -> "FeatureMap":
        """With those parts replaced that `wishes`, a JSON document, names.

        Raises:
            DatasetError: for a part that does not exist.
        """
        known = [item.name for item in fields(self)]
        if unknown := set(wishes) - set(known):
            raise DatasetError(f"mapping: {sorted(unknown)[0]!r} is none of {', '.join(known)}")
        values = dict(wishes)
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


def read_wishes(path: Path | None, pairs: tuple[str, ...]) -> dict[str, Any]:
    """What the user says of the mapping: the JSON file's document, and over it pairs `part=column`.

    Raises:
        DatasetError: naming the file or the pair.
    """
    wishes: dict[str, Any] = {}
    if path is not None:
        try:
            wishes.update(json.loads(path.read_text()))
        except (OSError, ValueError, TypeError) as error:
            raise DatasetError(f"{path}: {error}") from error
    for pair in pairs:
        part, equals, column = pair.partition("=")
        if not equals:
            raise DatasetError(f"--feature {pair!r}: write part=column, e.g. gripper=action[6]")
        wishes[part] = float(column) if part.startswith("gripper_open") else column
    return wishes


def trajectory_of(columns: Columns, mapping: FeatureMap, frequency_hz: float) -> Trajectory:
    """The trajectory of one episode.

    Joint velocities that were not recorded are central differences of the joint positions.

    Raises:
        InvalidInputError: naming the part that is missing and the columns that there are.
    """
    positions = _optional(columns, mapping.joint_positions)
    times_s = _optional(columns, mapping.timestamps)
    velocities = _optional(columns, mapping.joint_velocities)
    if velocities is None:
        if positions is None:
            raise _missing("joint_velocities", "neither velocities nor joint_positions to derive them from", columns)
        velocities = _rates(positions, times_s, frequency_hz)
    rotations = _required(columns, mapping.end_effector_rotations, "end_effector_rotations")
    return Trajectory(
        joint_velocities_rad_s=velocities,
        positions_m=_required(columns, mapping.end_effector_positions, "end_effector_positions"),
        quaternions_xyzw=quaternions_xyzw(rotations, mapping.rotation_format),
        gripper_open=_gripper(columns, mapping),
        timestamps_s=times_s,
        joint_positions_rad=positions,
        **_tracks(columns, mapping),
    )


def objects_of(trajectory: Trajectory, mapping: FeatureMap) -> tuple[ObjectEntry, ...]:
    """The tracked objects with their poses at the first frame."""
    poses = trajectory.objects_at(0, [item.name for item in mapping.objects]) if mapping.objects else ()
    return tuple(
        ObjectEntry(
            pose.name,
            tuple(pose.position_m.tolist()),
            None if pose.quaternion_xyzw is None else tuple(pose.quaternion_xyzw.tolist()),
        )
        for pose in poses
    )


def quaternions_xyzw(rotations: Array, form: RotationFormat) -> Array:
    """Rotations (T, 3 or 4) of any format as (T, 4) quaternions; quaternions keep every bit."""
    size = 4 if form.startswith("quaternion") else 3
    if rotations.ndim != 2 or rotations.shape[1] != size:
        raise InvalidInputError("end_effector_rotations", f"has shape {rotations.shape}", f"(T, {size}) for {form}")
    if form == "quaternion_xyzw":
        return rotations
    if form == "quaternion_wxyz":
        return rotations[:, [1, 2, 3, 0]]
    make = Rotation.from_rotvec if form == "rotation_vector" else lambda angles: Rotation.from_euler("xyz", angles)
    found: Array = make(rotations.copy()).as_quat()  # scipy takes no read-only array, as those of pyarrow are
    return found


def selected(columns: Columns, selector: str) -> Array:
    """The column, or the part of it that the selector cuts out, as (T,) or (T, k).

    Raises:
        InvalidInputError: naming the columns that there are.
    """
    match = _SELECTOR.fullmatch(selector)
    if match is None or match["column"] not in columns:
        raise InvalidInputError(selector, "is no column of the recording", ", ".join(columns))
    column = np.asarray(columns[match["column"]], dtype=np.float64)
    if match["start"] is None:
        return column
    start = int(match["start"])
    if column.ndim != 2 or not -column.shape[1] <= start < column.shape[1]:
        raise InvalidInputError(selector, f"cuts a column of shape {column.shape}", "a place within the column")
    if match["cut"] is None:
        single: Array = column[:, start]
        return single
    return column[:, start : int(match["stop"]) if match["stop"] else None]


def _tracks(columns: Columns, mapping: FeatureMap) -> dict[str, Array]:
    if not mapping.objects:
        return {}
    tracks = {"object_positions_m": np.stack([selected(columns, item.position) for item in mapping.objects], axis=1)}
    turned = [item.rotation for item in mapping.objects if item.rotation is not None]
    if len(turned) == len(mapping.objects):
        rotations = [quaternions_xyzw(selected(columns, name), mapping.rotation_format) for name in turned]
        tracks["object_quaternions_xyzw"] = np.stack(rotations, axis=1)
    return tracks


def _gripper(columns: Columns, mapping: FeatureMap) -> np.ndarray[Any, np.dtype[np.bool_]]:
    values = _required(columns, mapping.gripper, "gripper")
    values = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
    above, below = mapping.gripper_open_above, mapping.gripper_open_below
    if above is not None and below is None:
        return np.greater(values, above)
    if below is not None and above is None:
        return np.less(values, below)
    raise InvalidInputError("mapping", "says not when the gripper is open", "one of gripper_open_above and _below")


def _rates(positions: Array, times_s: Array | None, frequency_hz: float) -> Array:
    if len(positions) < 2:
        return np.zeros_like(positions)
    rates: Array = np.gradient(positions, 1 / frequency_hz if times_s is None else times_s, axis=0)
    return rates


def _optional(columns: Columns, selector: str | None) -> Array | None:
    return None if selector is None else selected(columns, selector)


def _required(columns: Columns, selector: str | None, part: str) -> Array:
    if selector is None:
        raise _missing(part, "the mapping names no column", columns)
    return selected(columns, selector)


def _missing(part: str, why: str, columns: Columns) -> InvalidInputError:
    return InvalidInputError(part, why, f"--feature {part}=COLUMN, one of {', '.join(columns)}")


def _camera(value: Mapping[str, Any]) -> MappedCamera:
    calibration = {name: item for name, item in value.items() if name not in ("rgb", "depth")}
    camera_from_json(calibration)
    return MappedCamera(calibration, value.get("rgb"), value.get("depth"))
