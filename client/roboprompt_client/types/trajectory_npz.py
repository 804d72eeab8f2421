"""A trajectory as the arrays and as the .npz file that robots upload."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array, bounded_array, finite_array
from roboprompt_client.types.trajectory import MAX_RAD, MAX_S, Trajectory

REQUIRED = ("end_effector_positions", "end_effector_quaternions_xyzw", "gripper_open")
FIELDS = {  # array in the file -> field of Trajectory, in the file's order
    "joint_velocities": "joint_velocities_rad_s",
    "end_effector_positions": "positions_m",
    "end_effector_quaternions_xyzw": "quaternions_xyzw",
    "gripper_open": "gripper_open",
    "timestamps": "timestamps_s",
    "joint_positions": "joint_positions_rad",
    "object_positions": "object_positions_m",
    "object_quaternions_xyzw": "object_quaternions_xyzw",
    "gripper_width": "gripper_width_m",
    "wrenches": "wrenches_n_nm",
}
OPTIONAL = tuple(name for name in FIELDS if name not in REQUIRED)
MIN_GRIPPER_TRAVEL_M = 0.005  # fingers that move less neither opened nor closed
MAX_FRAMES = 100_000  # 80 minutes at 20 Hz
VALID = f"a .npz file with the arrays {', '.join(REQUIRED)} (or gripper_width), and optionally {', '.join(OPTIONAL)}"


def trajectory_from_arrays(arrays: Mapping[str, Any], max_frames: int = MAX_FRAMES) -> Trajectory:
    """Return the trajectory of arrays by name.

    Raises:
        InvalidInputError: for missing or unknown names, or arrays that Trajectory refuses.
    """
    given = {name: array for name, array in arrays.items() if array is not None}
    inferred = {"gripper_open"} if "gripper_width" in given else set()
    if missing := [name for name in REQUIRED if name not in given and name not in inferred]:
        raise InvalidInputError(f"trajectory.{missing[0]}", "is missing", VALID)
    if unknown := [name for name in arrays if name not in FIELDS]:
        raise InvalidInputError(f"trajectory.{unknown[0]}", "is not known", VALID)
    gripper = "gripper_open" if "gripper_open" in given else "gripper_width"
    num_frames = len(finite_array(f"trajectory.{gripper}", given[gripper], (None,)))
    if num_frames > max_frames:
        raise InvalidInputError("trajectory", f"has {num_frames} frames", f"at most {max_frames}")
    if "joint_velocities" not in given:
        given["joint_velocities"] = _joint_velocities(num_frames, given.get("joint_positions"), given.get("timestamps"))
    if gripper == "gripper_width":
        given["gripper_open"] = _gripper_open(given["gripper_width"], num_frames)
    return Trajectory(**{FIELDS[name]: array for name, array in given.items()})


def trajectory_from_file(path: Path) -> Trajectory:
    """Return the trajectory of a .npz file; raises InvalidInputError naming the array and what is wrong with it."""
    try:
        if not (data := path.read_bytes()).startswith(b"PK"):
            raise ValueError("it is no archive of arrays, such as np.savez writes")
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            arrays = dict(file)
    except (OSError, ValueError, EOFError, BadZipFile, TypeError, AttributeError) as error:  # the last two: no archive
        raise InvalidInputError("trajectory", f"{path} is not a readable .npz file: {error}", VALID) from error
    return trajectory_from_arrays(arrays)


def npz_from_trajectory(trajectory: Trajectory) -> bytes:
    """Return the .npz file of a trajectory; the same trajectory gives the same bytes."""
    arrays: dict[str, Any] = {name: getattr(trajectory, field) for name, field in FIELDS.items()}
    if trajectory.num_joints == 0:
        del arrays["joint_velocities"]
    stream = io.BytesIO()
    # in C order: the file of an array in Fortran order would differ
    ordered: dict[str, Any] = {name: np.ascontiguousarray(array) for name, array in arrays.items() if array is not None}
    np.savez_compressed(stream, **ordered)
    return stream.getvalue()


def _joint_velocities(
    num_frames: int, joint_positions_rad: npt.ArrayLike | None, timestamps_s: npt.ArrayLike | None
) -> Array:
    """Return (T, J) rad/s, the central differences of the positions; (T, 0) without positions."""
    if joint_positions_rad is None:
        return np.zeros((num_frames, 0))
    positions = bounded_array("trajectory.joint_positions", joint_positions_rad, (num_frames, None), MAX_RAD, "rad")
    if timestamps_s is None:
        message = "is missing and cannot be computed: joint_positions have no timestamps"
        raise InvalidInputError("trajectory.joint_velocities", message, "(T, J) rad/s, or timestamps (T,) s")
    if num_frames < 2:
        return np.zeros_like(positions)
    times = bounded_array("trajectory.timestamps", timestamps_s, (num_frames,), MAX_S, "s")
    if (np.diff(times) <= 0).any():
        raise InvalidInputError("trajectory.timestamps", "do not increase", "increasing seconds")
    rates: Array = np.gradient(positions, times, axis=0)
    return rates


def _gripper_open(widths_m: npt.ArrayLike, num_frames: int) -> npt.NDArray[np.bool_]:
    """Return (T,) whether the fingers are wider apart than the mean of their least and largest width."""
    widths = finite_array("trajectory.gripper_width", widths_m, (num_frames,))
    low, high = float(widths.min(initial=np.inf)), float(widths.max(initial=-np.inf))
    if high - low < MIN_GRIPPER_TRAVEL_M:
        message = f"stays at {low:.4f} to {high:.4f} m, which may be open or closed"
        raise InvalidInputError("trajectory.gripper_width", message, "gripper_open (T,) beside it")
    opened: npt.NDArray[np.bool_] = widths > (low + high) / 2
    return opened
