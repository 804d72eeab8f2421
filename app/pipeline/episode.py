"""What a robot records and what the method makes of it (paper, section III-A).

Every value is checked when it is constructed. Positions are in metres in the world frame; quaternions are xyzw.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from app.pipeline.arrays import Array, finite_array, settle, unit_quaternions
from app.pipeline.camera import RgbdFrame
from app.pipeline.errors import InvalidInputError
from app.pipeline.wording import checked_instruction, checked_name

NUM_JOINTS = 7
MIN_FREQUENCY_HZ, MAX_FREQUENCY_HZ = 0.01, 100_000.0  # slower than any recorder, and faster
MOST_WIDTH_M = 0.2  # that a gripper opens


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The robot's motion over T frames.

    Attributes:
        joint_velocities_rad_s: (T, 7).
        positions_m: (T, 3) end effector in the world frame.
        quaternions_xyzw: (T, 4) end effector in the world frame.
        gripper_open: (T,) bool, what the fingers have done.
        timestamps_s: (T,) increasing, or None.
        joint_positions_rad: (T, 7), or None.
        object_positions_m: (T, N, 3) of the scene's N objects in the world frame, or None: for closed-loop prompts.
        object_quaternions_xyzw: (T, N, 4) of the same objects, or None; only beside positions.
    """

    joint_velocities_rad_s: Array
    positions_m: Array
    quaternions_xyzw: Array
    gripper_open: npt.NDArray[np.bool_]
    timestamps_s: Array | None = None
    joint_positions_rad: Array | None = None
    object_positions_m: Array | None = None
    object_quaternions_xyzw: Array | None = None

    def __post_init__(self) -> None:
        velocities = finite_array("trajectory.joint_velocities", self.joint_velocities_rad_s, (None, NUM_JOINTS))
        num_frames = len(velocities)
        if num_frames == 0:
            raise InvalidInputError("trajectory.joint_velocities", "has no frames (T = 0)", "at least one frame")
        joints, poses = (num_frames, NUM_JOINTS), (num_frames, 4)
        quaternions = unit_quaternions("trajectory.end_effector_quaternions_xyzw", self.quaternions_xyzw, poses)
        settle(
            self,
            joint_velocities_rad_s=velocities,
            positions_m=finite_array("trajectory.end_effector_positions", self.positions_m, (num_frames, 3)),
            quaternions_xyzw=quaternions,
            gripper_open=_booleans("trajectory.gripper_open", self.gripper_open, num_frames),
        )
        if self.timestamps_s is not None:
            settle(self, timestamps_s=_increasing("trajectory.timestamps", self.timestamps_s, num_frames))
        if self.joint_positions_rad is not None:
            positions = finite_array("trajectory.joint_positions", self.joint_positions_rad, joints)
            settle(self, joint_positions_rad=positions)
        self._check_objects(num_frames)

    def _check_objects(self, num_frames: int) -> None:
        name = "trajectory.object_quaternions_xyzw"
        if self.object_positions_m is not None:
            positions = finite_array("trajectory.object_positions", self.object_positions_m, (num_frames, None, 3))
            settle(self, object_positions_m=positions)
        elif self.object_quaternions_xyzw is not None:
            raise InvalidInputError(name, "has no object_positions beside it", "both, or only object_positions")
        if self.object_positions_m is not None and self.object_quaternions_xyzw is not None:
            shape = (*self.object_positions_m.shape[:2], 4)
            settle(self, object_quaternions_xyzw=unit_quaternions(name, self.object_quaternions_xyzw, shape))

    @property
    def num_objects(self) -> int:
        """How many objects were tracked."""
        return 0 if self.object_positions_m is None else self.object_positions_m.shape[1]

    def objects_at(self, frame: int, names: Sequence[str]) -> tuple["ObjectPose", ...]:
        """The tracked objects' poses at `frame`; none if no objects were tracked.

        Args:
            names: of the objects, in the tracks' order.
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

    def action_at(self, frame: int, *, gripper_open: bool | None = None) -> "EndEffectorAction":
        """The end effector's pose at `frame`, and the gripper's state there unless another is given."""
        is_open = bool(self.gripper_open[frame]) if gripper_open is None else gripper_open
        return EndEffectorAction(self.positions_m[frame], self.quaternions_xyzw[frame], is_open)


def _booleans(name: str, value: npt.ArrayLike, length: int) -> npt.NDArray[np.bool_]:
    numbers = finite_array(name, value, (length,))
    if (bad := ~np.isin(numbers, (0.0, 1.0))).any():
        index = int(np.flatnonzero(bad)[0])
        remedy = "0 (closed) or 1 (open), what the fingers have done"
        if numbers.min() >= 0 and numbers.max() <= MOST_WIDTH_M:
            remedy += "; of widths in metres: 1 above the middle between their extremes"
        raise InvalidInputError(name, f"element {index} is {numbers[index]:g}", remedy)
    booleans = numbers.astype(np.bool_)
    booleans.flags.writeable = False
    return booleans


def _increasing(name: str, value: npt.ArrayLike, length: int) -> Array:
    array = finite_array(name, value, (length,))
    if (np.diff(array) <= 0).any():
        index = int(np.flatnonzero(np.diff(array) <= 0)[0]) + 1
        raise InvalidInputError(name, f"element {index} is not after the one before", "increasing seconds")
    return array


@dataclass(frozen=True, eq=False)
class ObjectPose:
    """An object's estimated pose in the world frame.

    Attributes:
        position_m: (3,).
        quaternion_xyzw: (4,), or None where the estimator gives no rotation.
        estimator: which estimator found it.
        cameras: the cameras that saw it.
        confidence: 0..1, as the estimator judges its own result.
        reason: what lowered the confidence or deserves a look, in words; empty if nothing.
    """

    name: str
    position_m: Array
    quaternion_xyzw: Array | None = None
    estimator: str = "given"
    cameras: tuple[str, ...] = ()
    confidence: float = 1.0
    reason: str = ""

    def __post_init__(self) -> None:
        where = f"objects[{checked_name('objects.name', self.name)}]"
        settle(self, position_m=finite_array(f"{where}.position", self.position_m, (3,)))
        if self.quaternion_xyzw is not None:
            unit = unit_quaternions(f"{where}.quaternion_xyzw", self.quaternion_xyzw, (4,))
            settle(self, quaternion_xyzw=unit)
        if not 0 <= self.confidence <= 1:
            raise InvalidInputError(f"{where}.confidence", f"is {self.confidence}", "a number in 0..1")


@dataclass(frozen=True, eq=False)
class EndEffectorAction:
    """An end-effector target: position (3,) m, quaternion (4,) xyzw, both in the world frame, and the gripper."""

    position_m: Array
    quaternion_xyzw: Array
    gripper_open: bool

    def __post_init__(self) -> None:
        settle(self, position_m=finite_array("action.position", self.position_m, (3,)))
        unit = unit_quaternions("action.quaternion_xyzw", self.quaternion_xyzw, (4,))
        settle(self, quaternion_xyzw=unit)

    @classmethod
    def many(
        cls, positions_m: npt.ArrayLike, quaternions_xyzw: npt.ArrayLike, gripper_open: Sequence[bool]
    ) -> list[Self]:
        """N actions from (N, 3) and (N, 4), checked together: numpy takes as long for one as for all."""
        positions = finite_array("actions.position", positions_m, (None, 3))
        quaternions = unit_quaternions("actions.quaternion_xyzw", quaternions_xyzw, (None, 4))
        return [cls._checked(*fields) for fields in zip(positions, quaternions, gripper_open, strict=True)]

    @classmethod
    def _checked(cls, position_m: Array, quaternion_xyzw: Array, gripper_open: bool) -> Self:
        action = object.__new__(cls)
        settle(action, position_m=position_m, quaternion_xyzw=quaternion_xyzw, gripper_open=gripper_open)
        return action


@dataclass(frozen=True, eq=False)
class Episode:
    """A recorded trajectory with the instruction it carries out and the cameras' view of its first frame."""

    instruction: str
    trajectory: Trajectory
    frames: tuple[RgbdFrame, ...] = ()
    control_frequency_hz: float = 20.0
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        settle(self, instruction=checked_instruction("instruction", self.instruction))
        if not MIN_FREQUENCY_HZ <= self.control_frequency_hz <= MAX_FREQUENCY_HZ:
            valid = f"a number in {MIN_FREQUENCY_HZ:g}..{MAX_FREQUENCY_HZ:g}"
            raise InvalidInputError("control_frequency_hz", f"is {self.control_frequency_hz:g}", valid)


@dataclass(frozen=True, eq=False)
class Demonstration:
    """An episode as a prompt uses it: the objects' poses at its first frame and the actions at its keyframes.

    Attributes:
        later_objects: the objects' poses after each action, where the episode tracked them; otherwise empty.
        start: where the end effector was at first, where that is known.
        plan: demonstrations of equal plans and like instructions have the same rows, see
            `app.pipeline.plans`; None: the keyframes are as they were found.
    """

    instruction: str
    objects: tuple[ObjectPose, ...]
    actions: tuple[EndEffectorAction, ...]
    id: str = ""
    later_objects: tuple[tuple[ObjectPose, ...], ...] = ()
    start: EndEffectorAction | None = None
    plan: int | None = None

    def object(self, name: str) -> ObjectPose:
        """The pose of the object of that name, which there is."""
        return next(pose for pose in self.objects if pose.name == name)
