"""Converts a table of named arrays into a trajectory, objects and a Parcel, by a mapping of its columns.

The mapping is JSON, for example for DROID in LeRobot's format; columns may be sliced:

    {"joint_positions": "observation.state.joint_position",
     "end_effector_positions": "observation.state.cartesian_position[0:3]",
     "end_effector_rotations": "observation.state.cartesian_position[3:6]", "rotation_format": "euler_xyz",
     "gripper": "observation.state.gripper_position", "gripper_open_below": 0.25,
     "objects": [{"name": "cube", "position": "observation.cube_pos", "rotation": "observation.cube_quat"}],
     "cameras": [{"name": "front", "rgb": "observation.images.front", "depth": "observation.depth.front",
                  "intrinsics": {"fx": 600, "fy": 600, "cx": 320, "cy": 240}, "camera_to_world": [[1, 0, 0, 0], ...]}]}
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, get_args

import numpy as np

from app.datasets.bounds import DatasetError
from app.datasets.options import ImportOptions
from app.datasets.parcel import ObjectEntry, Parcel
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, camera_from_json
from roboprompt_client.types.trajectory import Trajectory

Columns = Mapping[str, np.ndarray[Any, Any]]
RotationFormat = Literal["quaternion_xyzw", "quaternion_wxyz", "euler_xyz", "rotation_vector"]
STILL, STILL_SHARE = 0.005, 0.2  # a gripper's column that varies by less has neither opened nor closed
_SELECTOR = re.compile(r"(?P<column>.*?)(?:\[(?P<start>-?\d+)(?P<cut>:(?P<stop>-?\d*))?\])?")


@dataclass(frozen=True)
class TrackedObject:
    """The columns of an object whose pose is recorded in every frame."""

    name: str
    position: str
    rotation: str | None = None


@dataclass(frozen=True)
class MappedCamera:
    """A calibrated camera and the columns of its images."""

    camera: Camera
    rgb: str | None = None
    depth: str | None = None


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
    cameras: tuple[MappedCamera, ...] = ()

    def __post_init__(self) -> None:
        if self.rotation_format not in (valid := get_args(RotationFormat)):
            raise InvalidInputError("mapping.rotation_format", f"is {self.rotation_format!r}", ", ".join(valid))

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


def _camera(value: Mapping[str, Any]) -> MappedCamera:
    calibration = {name: item for name, item in value.items() if name not in ("rgb", "depth")}
    return MappedCamera(camera_from_json(calibration), value.get("rgb"), value.get("depth"))


@dataclass(frozen=True, eq=False)
class ColumnEpisode:
    """An episode that a dataset keeps as a table.

    Attributes:
        name: of the episode in its dataset.
        source: the format, stored with the episode.
        task, instruction: of the dataset; options override them.
        image: returns the encoded first image of a column; raises DamagedError.
        image_columns: all columns with images.
    """

    name: str
    source: str
    task: str
    instruction: str | None
    columns: Columns
    frequency_hz: float
    image: Callable[[str], bytes]
    image_columns: Sequence[str] = ()

    def parcel(self, mapping: FeatureMap, options: ImportOptions) -> Parcel:
        """Return the episode as it is uploaded; raises InvalidInputError for a missing or invalid part."""
        if (text := options.instruction or self.instruction) is None:
            raise InvalidInputError("instruction", "the dataset names none", "--instruction 'what the robot does'")
        trajectory = trajectory_of(self.columns, mapping, self.frequency_hz)
        images = {
            f"{kind}_{item.camera.name}": self.image(column)
            for item in mapping.cameras
            for kind, column in (("rgb", item.rgb), ("depth", item.depth))
            if column is not None
        }
        return Parcel.of(
            task=options.task or self.task,
            instruction=text,
            trajectory=trajectory,
            control_frequency_hz=self.frequency_hz,
            objects=objects_of(trajectory, mapping) or options.objects.of(self.name),
            cameras=[item.camera for item in mapping.cameras],
            images=images,
            extra={"source": self.source, "episode": self.name},
            notes=tuple(self._lacking(mapping)),
        )

    def _lacking(self, mapping: FeatureMap) -> Iterator[str]:
        """Yield what an upload could have and the mapping does not find."""
        if mapping.joint_velocities is None:
            yield "joint velocities: derived from joint positions"
        used = {column for item in mapping.cameras for column in (item.rgb, item.depth)}
        if unused := [column for column in self.image_columns if column not in used]:
            yield f"calibration of {', '.join(unused)}: images are left out"


def trajectory_of(columns: Columns, mapping: FeatureMap, frequency_hz: float) -> Trajectory:
    """Return the trajectory of an episode; missing joint velocities are derived from positions.

    Raises:
        InvalidInputError: naming the missing part and the existing columns.
    """

    def column(part: str) -> Array | None:
        selector = getattr(mapping, part)
        return None if selector is None else selected(columns, selector)

    def required(part: str, why: str = "the mapping names no column") -> Array:
        if (found := column(part)) is None:
            raise InvalidInputError(part, why, f"a mapping of {part} to one of {', '.join(columns)}")
        return found

    positions, times_s, velocities = column("joint_positions"), column("timestamps"), column("joint_velocities")
    if velocities is None and positions is None:
        required("joint_velocities", "neither velocities nor joint_positions to derive them from")
    if velocities is None:
        assert positions is not None
        steps_s = 1 / frequency_hz if times_s is None else times_s
        velocities = np.zeros_like(positions) if len(positions) < 2 else np.gradient(positions, steps_s, axis=0)
    return Trajectory(
        joint_velocities_rad_s=velocities,
        positions_m=required("end_effector_positions"),
        quaternions_xyzw=quaternions_xyzw(required("end_effector_rotations"), mapping.rotation_format),
        gripper_open=_is_open(required("gripper"), mapping),
        timestamps_s=times_s,
        joint_positions_rad=positions,
        **_tracks(columns, mapping),
    )


def objects_of(trajectory: Trajectory, mapping: FeatureMap) -> tuple[ObjectEntry, ...]:
    """Return the tracked objects with their poses in the first frame."""
    poses = trajectory.objects_at(0, [item.name for item in mapping.objects]) if mapping.objects else ()
    turns = (None if pose.quaternion_xyzw is None else tuple(pose.quaternion_xyzw.tolist()) for pose in poses)
    return tuple(
        ObjectEntry(pose.name, tuple(pose.position_m.tolist()), turn) for pose, turn in zip(poses, turns, strict=True)
    )


def quaternions_xyzw(rotations: Array, form: RotationFormat) -> Array:
    """Convert rotations (T, 3 or 4) of any format to quaternions (T, 4); quaternions keep every bit."""
    size = 4 if form.startswith("quaternion") else 3
    if rotations.ndim != 2 or rotations.shape[1] != size:
        raise InvalidInputError("end_effector_rotations", f"has shape {rotations.shape}", f"(T, {size}) for {form}")
    if size == 4:
        return rotations if form == "quaternion_xyzw" else rotations[:, [1, 2, 3, 0]]
    from scipy.spatial.transform import Rotation  # takes half of a process's start and is rarely needed

    given = rotations.copy()  # scipy takes no read-only arrays, and pyarrow's are
    turns = Rotation.from_rotvec(given) if form == "rotation_vector" else Rotation.from_euler("xyz", given)
    found: Array = turns.as_quat()
    return found


def selected(columns: Columns, selector: str) -> Array:
    """Return the column or a slice of it, (T,) or (T, k); raises InvalidInputError naming the columns."""
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


def _is_open(values: Array, mapping: FeatureMap) -> np.ndarray[Any, np.dtype[np.bool_]]:
    values = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
    above, below = mapping.gripper_open_above, mapping.gripper_open_below
    if above is not None and below is None:
        is_open = np.greater(values, above)
    elif below is not None and above is None:
        is_open = np.less(values, below)
    else:
        remedy = "one of gripper_open_above and _below"
        raise InvalidInputError("mapping", "says not when the gripper is open", remedy)
    varies = float(np.ptp(values)) > max(STILL, STILL_SHARE * float(np.abs(values).max()))
    if varies and is_open.all() == is_open.any():
        message = f"is {values.min():.4g} to {values.max():.4g}, by which the gripper neither opens nor closes"
        raise InvalidInputError(str(mapping.gripper), message, "gripper_open_above or _below between these values")
    return is_open
