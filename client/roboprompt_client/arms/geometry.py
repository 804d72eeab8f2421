"""What is known of an arm's joints: whether a straight way can be gone, and where they are at its end."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from roboprompt_client.arms.driver import pose_matrix
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.extras import import_extra
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array

# The end effector (4, 4) in the base frame for joints (J,), and the Jacobian (6, J) of its linear and angular velocity
Forward = Callable[[Array], tuple[Array, Array]]
JOINT_MARGIN_RAD = 0.02  # the arm's own reflex comes at the limit
STEP_M, STEP_RAD = 0.01, 0.05
POSE_TOLERANCE = 1e-4  # meters and radians
DAMPING, MAX_ITERATIONS = 0.02, 60


class Nearest(NamedTuple):
    """The joint that is nearest to a limit of its own, counted from 1, and how far it is from it; below 0: beyond."""

    joint: int
    margin_deg: float


class Geometry(Protocol):
    """An arm's joints, in its base frame."""

    def way(self, joints_rad: Array, position_m: Array, quaternion_xyzw: Array) -> Array:
        """The joints (J,) at the end of the straight way from joints (J,) to a pose.

        Raises:
            MotionError: if it is out of reach or beyond a joint's limit; says which.
        """
        ...

    def nearest_limit(self, joints_rad: Array) -> Nearest:
        """The joint that is nearest to its limit."""
        ...


@runtime_checkable
class KnowsItsJoints(Protocol):
    """A driver whose arm's geometry is known."""

    def geometry(self) -> Geometry:
        """With the tool that the arm has now; raises MotionError if the arm does not answer."""
        ...


def nearest_limit(joints_rad: Array, low_rad: Array, high_rad: Array) -> Nearest:
    """Which of the joints (J,) is nearest to its bounds (J,)."""
    margins = np.minimum(joints_rad - low_rad, high_rad - joints_rad)
    index = int(margins.argmin())
    return Nearest(index + 1, float(np.degrees(margins[index])))


def follow_line(forward: Forward, joints_rad: Array, goal: Array, low_rad: Array, high_rad: Array) -> Array:
    """The joints (J,) at the end of the straight way to a pose.

    Args:
        joints_rad: (J,) where the arm is.
        goal: (4, 4) of the end effector.
        low_rad, high_rad: (J,) the joints' limits.

    Raises:
        MotionError: if the way ends before the goal, or leads to a joint's limit, naming it.
    """
    start, _ = forward(joints_rad)
    turn = rotations.to_rotation_vector(rotations.from_matrix(goal[:3, :3] @ start[:3, :3].T))
    way_m, way_rad = float(np.linalg.norm(goal[:3, 3] - start[:3, 3])), float(np.linalg.norm(turn))
    steps = max(1, int(np.ceil(max(way_m / STEP_M, way_rad / STEP_RAD))))
    joints = np.array(joints_rad, float)
    for part in np.arange(1, steps + 1) / steps:
        between = np.eye(4)
        between[:3, :3] = rotations.to_matrix(rotations.from_rotation_vector(part * turn)) @ start[:3, :3]
        between[:3, 3] = start[:3, 3] + part * (goal[:3, 3] - start[:3, 3])
        joints = _follow(forward, joints, between, float(part))
        _check_limits(joints, low_rad + JOINT_MARGIN_RAD, high_rad - JOINT_MARGIN_RAD, float(part))
    return joints


def _follow(forward: Forward, joints_rad: Array, goal: Array, part: float) -> Array:
    joints = joints_rad
    for _ in range(MAX_ITERATIONS):
        here, jacobian = forward(joints)
        turn = rotations.to_rotation_vector(rotations.from_matrix(goal[:3, :3] @ here[:3, :3].T))
        error = np.concatenate([goal[:3, 3] - here[:3, 3], turn])
        if np.abs(error).max() < POSE_TOLERANCE:
            return joints
        joints = joints + jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + DAMPING**2 * np.eye(6), error)
    raise MotionError(f"the pose is out of reach: the straight way to it ends after {100 * part:.0f} %")


def _check_limits(joints_rad: Array, low_rad: Array, high_rad: Array, part: float) -> None:
    for number, (angle, low, high) in enumerate(zip(joints_rad, low_rad, high_rad, strict=True), 1):
        if not low <= angle <= high:
            bound = f"{low:.3f} to {high:.3f} rad"
            where = f"after {100 * part:.0f} % of the way"
            raise MotionError(f"joint {number} would come to {angle:.3f} rad {where} (allowed: {bound})")


class UrdfGeometry:
    """An arm's joints after its URDF; a `Geometry`.

    Args:
        frame: of the file: the end effector whose pose the arm's driver reports.

    Raises:
        InvalidInputError: if pinocchio is not installed, the file is none, has no such frame, or a joint that turns
            without end or has no single coordinate.
    """

    def __init__(self, path: Path, frame: str) -> None:
        self._pin = pin = import_extra("pinocchio", "pinocchio", "urdf")
        try:
            self._model = pin.buildModelFromUrdf(str(path))
        except ValueError as error:
            raise InvalidInputError("urdf", f"{path}: {error}", "a URDF file") from error
        if not self._model.existFrame(frame):
            valid = ", ".join(item.name for item in self._model.frames)
            raise InvalidInputError("urdf_frame", f"{frame!r:.80} is not in {path}", valid)
        if self._model.nq != self._model.nv:
            raise InvalidInputError("urdf", f"{path} has a joint without limits", "joints with limits")
        self._data, self._frame = self._model.createData(), self._model.getFrameId(frame)

    def way(self, joints_rad: Array, position_m: Array, quaternion_xyzw: Array) -> Array:
        if len(joints_rad) != self._model.nq:
            raise MotionError(f"the arm says {len(joints_rad)} joints, its URDF has {self._model.nq}")
        goal = pose_matrix(position_m, quaternion_xyzw)
        return follow_line(self._forward, joints_rad, goal, *self._limits_rad)

    def nearest_limit(self, joints_rad: Array) -> Nearest:
        return nearest_limit(joints_rad, *self._limits_rad)

    @property
    def _limits_rad(self) -> tuple[Array, Array]:
        return np.array(self._model.lowerPositionLimit), np.array(self._model.upperPositionLimit)

    def _forward(self, joints_rad: Array) -> tuple[Array, Array]:
        axes = self._pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = self._pin.computeFrameJacobian(self._model, self._data, joints_rad, self._frame, axes)
        self._pin.updateFramePlacement(self._model, self._data, self._frame)
        return np.array(self._data.oMf[self._frame].homogeneous), np.array(jacobian)
