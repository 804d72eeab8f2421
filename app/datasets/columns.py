"""Converts a table of named arrays into a trajectory, objects and a Parcel, by a mapping of its columns."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.datasets.options import FeatureMap, ImportOptions, RotationFormat
from app.datasets.parcel import ObjectEntry, Parcel
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, camera_from_json
from roboprompt_client.types.trajectory import Trajectory

Columns = Mapping[str, np.ndarray[Any, Any]]
STILL, STILL_SHARE = 0.005, 0.2  # a gripper's column that varies by less has neither opened nor closed
_SELECTOR = re.compile(r"(?P<column>.*?)(?:\[(?P<start>-?\d+)(?P<cut>:(?P<stop>-?\d*))?\])?")


def trajectory_of(columns: Columns, mapping: FeatureMap, frequency_hz: float) -> Trajectory:
    """Return the trajectory of an episode; missing joint velocities are derived from positions.

    Raises:
        InvalidInputError: naming the missing part and the existing columns.
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
    """Return the tracked objects with their poses in the first frame."""
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
    """Convert rotations (T, 3 or 4) of any format to quaternions (T, 4); quaternions keep every bit."""
    size = 4 if form.startswith("quaternion") else 3
    if rotations.ndim != 2 or rotations.shape[1] != size:
        raise InvalidInputError("end_effector_rotations", f"has shape {rotations.shape}", f"(T, {size}) for {form}")
    if form == "quaternion_xyzw":
        return rotations
    if form == "quaternion_wxyz":
        return rotations[:, [1, 2, 3, 0]]
    from scipy.spatial.transform import Rotation  # takes half of a process's start and is rarely needed

    make = Rotation.from_rotvec if form == "rotation_vector" else lambda angles: Rotation.from_euler("xyz", angles)
    found: Array = make(rotations.copy()).as_quat()  # scipy takes no read-only arrays, and pyarrow's are
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


def _gripper(columns: Columns, mapping: FeatureMap) -> np.ndarray[Any, np.dtype[np.bool_]]:
    values = _required(columns, mapping.gripper, "gripper")
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
        cameras, images = _cameras(mapping, options, self.image)
        return Parcel.of(
            task=options.task or self.task,
            instruction=text,
            trajectory=trajectory,
            control_frequency_hz=self.frequency_hz,
            objects=objects_of(trajectory, mapping) or options.objects.of(self.name),
            cameras=cameras,
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


def _cameras(
    mapping: FeatureMap, options: ImportOptions, image: Callable[[str], bytes]
) -> tuple[tuple[Camera, ...], dict[str, bytes]]:
    cameras, images = [], {}
    for item in mapping.cameras:
        if options.wants(item.name):
            cameras.append(camera_from_json(item.calibration))
            columns = {f"rgb_{item.name}": item.rgb, f"depth_{item.name}": item.depth}
            images.update({part: image(column) for part, column in columns.items() if column is not None})
    return tuple(cameras), images
