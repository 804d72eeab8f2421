"""A table of named arrays and a mapping of its columns -> Trajectory and objects, and one episode's Parcel.

The mapping and the user's options say what the columns are.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from app.datasets.options import FeatureMap, ImportOptions, RotationFormat
from app.datasets.parcel import ObjectEntry, Parcel
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera, camera_from_json
from roboprompt_client.types.trajectory import Trajectory

Columns = Mapping[str, np.ndarray[Any, Any]]
STILL, STILL_SHARE = 0.005, 0.2  # of a gripper's column: fingers that vary by less have neither opened nor closed
_SELECTOR = re.compile(r"(?P<column>.*?)(?:\[(?P<start>-?\d+)(?P<cut>:(?P<stop>-?\d*))?\])?")


def trajectory_of(columns: Columns, mapping: FeatureMap, frequency_hz: float) -> Trajectory:
    """The trajectory of one episode; joint velocities that were not recorded are derived from the positions.

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
    from scipy.spatial.transform import Rotation  # half the start of a reader's process, for which few formats ask

    make = Rotation.from_rotvec if form == "rotation_vector" else lambda angles: Rotation.from_euler("xyz", angles)
    found: Array = make(rotations.copy()).as_quat()  # scipy takes no read-only array, as those of pyarrow are
    return found


def selected(columns: Columns, selector: str) -> Array:
    """The column, or what the selector cuts out of it: (T,) or (T, k); raises InvalidInputError naming the columns."""
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


def parcel_of(
    *,
    name: str,
    source: str,
    task: str,
    instruction: str | None,
    columns: Columns,
    frequency_hz: float,
    mapping: FeatureMap,
    options: ImportOptions,
    image: Callable[[str], bytes],
    image_columns: Sequence[str] = (),
) -> Parcel:
    """The episode as it is sent.

    Args:
        name: of the episode in its dataset.
        source: the format, kept with the episode.
        task, instruction: what the dataset says; options go before.
        image: the encoded first image of a column; raises DamagedError.
        image_columns: those that have images, whether the mapping uses them or not.

    Raises:
        InvalidInputError: for a part that is missing or not as it must be.
    """
    if (text := options.instruction or instruction) is None:
        raise InvalidInputError("instruction", "the dataset names none", "--instruction 'what the robot does'")
    trajectory = trajectory_of(columns, mapping, frequency_hz)
    cameras, images = _cameras(mapping, options, image)
    used = {column for item in mapping.cameras for column in (item.rgb, item.depth)}
    unused = [column for column in image_columns if column not in used]
    derived = mapping.joint_velocities is None
    notes = [
        *(["joint velocities: derived from joint positions"] if derived else []),
        *([f"calibration of {', '.join(unused)}: images are left out"] if unused else []),
    ]
    return Parcel.of(
        task=options.task or task,
        instruction=text,
        trajectory=trajectory,
        control_frequency_hz=frequency_hz,
        objects=objects_of(trajectory, mapping) or options.objects.of(name),
        cameras=cameras,
        images=images,
        extra={"source": source, "episode": name},
        notes=tuple(notes),
    )


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
