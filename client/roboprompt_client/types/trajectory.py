"""What a robot records, a `Trajectory`, as arrays by name and as the .npz file that is uploaded.

Positions are in meters in the world frame; quaternions are xyzw.
"""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array, bounded_array, finite_array, positions_array, settle, unit_quaternions
from roboprompt_client.types.gripper import MIN_TRAVEL_M, open_by_width
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

MAX_JOINTS = 16
MAX_RAD = MAX_RAD_S = 1e5  # of a joint: larger numbers are no angles in any unit
MAX_N_NM = 1e5  # on a hand: larger numbers are no forces in any unit
MAX_S = 1e11  # of a clock: 3,000 years
MAX_GRIPPER_WIDTH_M = 0.2  # between the fingers of an open gripper
WIDTH_ROUNDING_M = 0.005  # closed fingers may measure a little below 0: 2.6 mm of a Baxter's and of simulated ones
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
MAX_FRAMES = 100_000  # 80 minutes at 20 Hz
VALID = f"a .npz file with the arrays {', '.join(REQUIRED)} (or gripper_width), and optionally {', '.join(OPTIONAL)}"


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The robot's motion over T frames, checked when it is constructed.

    Attributes:
        joint_velocities_rad_s: (T, J) of J = 1 to 16 joints; (T, 0) where the joints are not known.
        positions_m: (T, 3) end effector in the world frame.
        quaternions_xyzw: (T, 4) end effector in the world frame.
        gripper_open: (T,) bool, whether the fingers were open (not whether they were commanded to open).
        timestamps_s: (T,) increasing, or None.
        joint_positions_rad: (T, J), or None.
        object_positions_m: (T, N, 3) of the scene's N objects in the world frame, or None; shows contact.
        object_quaternions_xyzw: (T, N, 4) of the same objects, or None; only together with their positions.
        gripper_width_m: (T,) measured between the fingers, or None.
        wrenches_n_nm: (T, 6) force and torque on the hand, along the world's axes, or None.
    """

    joint_velocities_rad_s: Array
    positions_m: Array
    quaternions_xyzw: Array
    gripper_open: npt.NDArray[np.bool_]
    timestamps_s: Array | None = None
    joint_positions_rad: Array | None = None
    object_positions_m: Array | None = None
    object_quaternions_xyzw: Array | None = None
    gripper_width_m: Array | None = None
    wrenches_n_nm: Array | None = None

    def __post_init__(self) -> None:
        velocities = bounded_array(
            _name("joint_velocities"), self.joint_velocities_rad_s, (None, None), MAX_RAD_S, "rad/s"
        )
        num_frames, num_joints = velocities.shape
        if num_frames == 0:
            raise InvalidInputError(_name("joint_velocities"), "has no frames (T = 0)", "at least one frame")
        if num_joints > MAX_JOINTS:
            raise InvalidInputError(_name("joint_velocities"), f"has {num_joints} joints", f"1 to {MAX_JOINTS}")
        turns = unit_quaternions(_name("end_effector_quaternions_xyzw"), self.quaternions_xyzw, (num_frames, 4))
        settle(
            self,
            joint_velocities_rad_s=velocities,
            positions_m=positions_array(_name("end_effector_positions"), self.positions_m, (num_frames, 3)),
            quaternions_xyzw=turns,
            gripper_open=_booleans(_name("gripper_open"), self.gripper_open, num_frames),
        )
        if (times_s := self.timestamps_s) is not None:
            settle(self, timestamps_s=_increasing(_name("timestamps"), times_s, num_frames))
        if (angles := self.joint_positions_rad) is not None:
            angles = bounded_array(_name("joint_positions"), angles, velocities.shape, MAX_RAD, "rad")
            settle(self, joint_positions_rad=angles)
        if (widths_m := self.gripper_width_m) is not None:
            settle(self, gripper_width_m=_widths(_name("gripper_width"), widths_m, num_frames))
        if (wrenches := self.wrenches_n_nm) is not None:
            wrenches = bounded_array(_name("wrenches"), wrenches, (num_frames, 6), MAX_N_NM, "N and Nm")
            settle(self, wrenches_n_nm=wrenches)
        self._check_objects(num_frames)

    @classmethod
    def from_poses(
        cls,
        positions_m: npt.ArrayLike,
        quaternions_xyzw: npt.ArrayLike,
        gripper_open: npt.ArrayLike,
        timestamps_s: npt.ArrayLike | None = None,
    ) -> "Trajectory":
        """Return the trajectory of an end effector whose joints are not known, from the attributes of these names.

        Raises:
            InvalidInputError: naming the array and what is wrong with it.
        """
        positions = positions_array(_name("end_effector_positions"), positions_m, (None, 3))
        no_joints = np.zeros((len(positions), 0))
        return cls(no_joints, positions, quaternions_xyzw, gripper_open, timestamps_s)  # type: ignore[arg-type]  # checked

    def _check_objects(self, num_frames: int) -> None:
        name, turns = _name("object_quaternions_xyzw"), self.object_quaternions_xyzw
        if self.object_positions_m is None:
            if turns is not None:
                raise InvalidInputError(name, "has no object_positions beside it", "both, or only object_positions")
            return
        positions = positions_array(_name("object_positions"), self.object_positions_m, (num_frames, None, 3))
        settle(self, object_positions_m=positions)
        if turns is not None:
            settle(self, object_quaternions_xyzw=unit_quaternions(name, turns, (*positions.shape[:2], 4)))

    @property
    def num_joints(self) -> int:
        """The number of recorded joints."""
        return int(self.joint_velocities_rad_s.shape[1])

    @property
    def num_objects(self) -> int:
        """The number of tracked objects."""
        return 0 if self.object_positions_m is None else self.object_positions_m.shape[1]

    def objects_at(self, frame: int, names: Sequence[str]) -> tuple[ObjectPose, ...]:
        """Return the tracked objects' poses at `frame`; empty if no objects were tracked.

        Args:
            names: of the objects, in the order of `object_positions_m`.
        """
        if self.object_positions_m is None:
            return ()
        rotations = self.object_quaternions_xyzw
        return tuple(
            ObjectPose(name, self.object_positions_m[frame, k], None if rotations is None else rotations[frame, k])
            for k, name in enumerate(names)
        )

    def __len__(self) -> int:
        return len(self.joint_velocities_rad_s)

    def with_gripper_open_above(self, width_m: float | None) -> "Trajectory":
        """Return a copy whose gripper is open where its measured width is larger; unchanged if either is None."""
        if width_m is None or self.gripper_width_m is None:
            return self
        return replace(self, gripper_open=self.gripper_width_m > width_m)

    def action_at(self, frame: int, *, gripper_open: bool | None = None) -> EndEffectorAction:
        """Return the action to the pose at `frame`, with the gripper's state there unless one is given."""
        is_open = bool(self.gripper_open[frame]) if gripper_open is None else gripper_open
        return EndEffectorAction(self.positions_m[frame], self.quaternions_xyzw[frame], is_open)


def trajectory_from_arrays(arrays: Mapping[str, Any]) -> Trajectory:
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
    fingers = finite_array(f"trajectory.{gripper}", given[gripper], (None,))
    if (num_frames := len(fingers)) > MAX_FRAMES:
        raise InvalidInputError("trajectory", f"has {num_frames} frames", f"at most {MAX_FRAMES}")
    if "joint_velocities" not in given:
        given["joint_velocities"] = _joint_velocities(num_frames, given.get("joint_positions"), given.get("timestamps"))
    if gripper == "gripper_width":
        given["gripper_open"] = _gripper_open(fingers)
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
    rates: Array = np.gradient(positions, _increasing("trajectory.timestamps", timestamps_s, num_frames), axis=0)
    return rates


def _gripper_open(widths_m: Array) -> npt.NDArray[np.bool_]:
    """Return (T,) whether the gripper is open, where its fingers move."""
    low, high = float(widths_m.min(initial=np.inf)), float(widths_m.max(initial=-np.inf))
    if high - low < MIN_TRAVEL_M:
        message = f"stays at {low:.4f} to {high:.4f} m, which may be open or closed"
        raise InvalidInputError("trajectory.gripper_width", message, "gripper_open (T,) beside it")
    return open_by_width(widths_m)


def _name(array: str) -> str:
    return f"trajectory.{array}"


def _booleans(name: str, value: npt.ArrayLike, length: int) -> npt.NDArray[np.bool_]:
    numbers = finite_array(name, value, (length,))
    if (bad := ~np.isin(numbers, (0.0, 1.0))).any():
        index = int(np.flatnonzero(bad)[0])
        remedy = "0 (closed) or 1 (open)"
        if numbers.min() >= 0 and numbers.max() <= MAX_GRIPPER_WIDTH_M:
            remedy += "; for widths in meters use gripper_width"
        raise InvalidInputError(name, f"element {index} is {numbers[index]:g}", remedy)
    booleans = numbers.astype(np.bool_)
    booleans.flags.writeable = False
    return booleans


def _widths(name: str, value: npt.ArrayLike, length: int) -> Array:
    widths_m = finite_array(name, value, (length,))
    if widths_m.min() < -WIDTH_ROUNDING_M or widths_m.max() > MAX_GRIPPER_WIDTH_M:
        message = f"is {widths_m.min():.4g} to {widths_m.max():.4g}"
        raise InvalidInputError(name, message, f"meters between the fingers, 0 to {MAX_GRIPPER_WIDTH_M}")
    return widths_m


def _increasing(name: str, value: npt.ArrayLike, length: int) -> Array:
    array = bounded_array(name, value, (length,), MAX_S, "s")
    if (np.diff(array) <= 0).any():
        index = int(np.flatnonzero(np.diff(array) <= 0)[0]) + 1
        raise InvalidInputError(name, f"element {index} is not after the one before", "increasing seconds")
    return array
