"""What a robot records: a `Trajectory`. Positions are in meters in the world frame; quaternions are xyzw."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array, bounded_array, finite_array, positions_array, settle, unit_quaternions
from roboprompt_client.types.poses import EndEffectorAction, ObjectPose

MAX_JOINTS = 16
MAX_RAD = MAX_RAD_S = 1e5  # of a joint: larger numbers are no angles in any unit
MAX_N_NM = 1e5  # on a hand: larger numbers are no forces in any unit
MAX_S = 1e11  # of a clock: 3,000 years
MAX_GRIPPER_WIDTH_M = 0.2  # between the fingers of an open gripper
WIDTH_ROUNDING_M = 0.005  # closed fingers may measure a little below 0: 2.6 mm of a Baxter's and of simulated ones


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
        name, speeds = "trajectory.joint_velocities", self.joint_velocities_rad_s
        velocities = bounded_array(name, speeds, (None, None), MAX_RAD_S, "rad/s")
        num_frames, num_joints = velocities.shape
        if num_frames == 0:
            raise InvalidInputError(name, "has no frames (T = 0)", "at least one frame")
        if num_joints > MAX_JOINTS:
            raise InvalidInputError(name, f"has {num_joints} joints", f"1 to {MAX_JOINTS}")
        quaternions_name = "trajectory.end_effector_quaternions_xyzw"
        quaternions = unit_quaternions(quaternions_name, self.quaternions_xyzw, (num_frames, 4))
        settle(
            self,
            joint_velocities_rad_s=velocities,
            positions_m=positions_array("trajectory.end_effector_positions", self.positions_m, (num_frames, 3)),
            quaternions_xyzw=quaternions,
            gripper_open=_booleans("trajectory.gripper_open", self.gripper_open, num_frames),
        )
        if (times_s := self.timestamps_s) is not None:
            settle(self, timestamps_s=_increasing("trajectory.timestamps", times_s, num_frames))
        if (angles := self.joint_positions_rad) is not None:
            angles = bounded_array("trajectory.joint_positions", angles, velocities.shape, MAX_RAD, "rad")
            settle(self, joint_positions_rad=angles)
        if (widths_m := self.gripper_width_m) is not None:
            settle(self, gripper_width_m=_widths("trajectory.gripper_width", widths_m, num_frames))
        if (wrenches := self.wrenches_n_nm) is not None:
            wrenches = bounded_array("trajectory.wrenches", wrenches, (num_frames, 6), MAX_N_NM, "N and Nm")
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
        """Return the trajectory of an end effector whose joints are not known.

        Args:
            positions_m: (T, 3) in the world frame.
            quaternions_xyzw: (T, 4) in the world frame.
            gripper_open: (T,) bool.
            timestamps_s: (T,) increasing.

        Raises:
            InvalidInputError: naming the array and what is wrong with it.
        """
        positions = positions_array("trajectory.end_effector_positions", positions_m, (None, 3))
        no_joints = np.zeros((len(positions), 0))
        return cls(no_joints, positions, quaternions_xyzw, gripper_open, timestamps_s)  # type: ignore[arg-type]  # checked

    def _check_objects(self, num_frames: int) -> None:
        name = "trajectory.object_quaternions_xyzw"
        if self.object_positions_m is not None:
            positions = positions_array("trajectory.object_positions", self.object_positions_m, (num_frames, None, 3))
            settle(self, object_positions_m=positions)
        elif self.object_quaternions_xyzw is not None:
            raise InvalidInputError(name, "has no object_positions beside it", "both, or only object_positions")
        if self.object_positions_m is not None and self.object_quaternions_xyzw is not None:
            shape = (*self.object_positions_m.shape[:2], 4)
            settle(self, object_quaternions_xyzw=unit_quaternions(name, self.object_quaternions_xyzw, shape))

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

    def part(self, first: int, end: int) -> "Trajectory":
        """Return the frames from `first` on, up to `end` and without it."""
        arrays = {name: array for name, array in vars(self).items() if array is not None}
        return replace(self, **{name: array[first:end] for name, array in arrays.items()})

    def with_gripper_open_above(self, width_m: float | None) -> "Trajectory":
        """Return a copy whose gripper is open where its measured width is larger; unchanged if either is None."""
        if width_m is None or self.gripper_width_m is None:
            return self
        return replace(self, gripper_open=self.gripper_width_m > width_m)

    def action_at(self, frame: int, *, gripper_open: bool | None = None) -> EndEffectorAction:
        """Return the action to the pose at `frame`, with the gripper's state there unless one is given."""
        is_open = bool(self.gripper_open[frame]) if gripper_open is None else gripper_open
        return EndEffectorAction(self.positions_m[frame], self.quaternions_xyzw[frame], is_open)


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
