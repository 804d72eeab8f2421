"""Whether an arm can follow a straight line within its joints' limits, and its joints at the end of the line."""

from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from roboprompt_client.arms.driver import ArmState, pose_matrix, straight_way
from roboprompt_client.errors import MotionError
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array

# The end effector (4, 4) in the base frame for joints (J,), and the Jacobian (6, J) of its linear and angular velocity
Forward = Callable[[Array], tuple[Array, Array]]
JOINT_MARGIN_RAD = 0.02  # the arm's own reflex comes at the limit
STEP_M, STEP_RAD = 0.01, 0.05
POSE_TOLERANCE = 1e-4  # meters and radians
DAMPING, MAX_ITERATIONS = 0.02, 60


class Nearest(NamedTuple):
    """The joint nearest to its limit, counted from 1, and the angle left; below 0: beyond the limit."""

    joint: int
    margin_deg: float


class Geometry(Protocol):
    """An arm's joints, in its base frame."""

    def way(self, joints_rad: Array, position_m: Array, quaternion_xyzw: Array) -> Array:
        """Return the joints (J,) at the end of the straight way from joints (J,) to a pose.

        Raises:
            MotionError: if the pose is out of reach, or the way leads beyond a joint's limit, which it names.
        """
        ...

    def nearest_limit(self, joints_rad: Array) -> Nearest:
        """Return the joint that is nearest to its limit."""
        ...


@runtime_checkable
class KnowsItsJoints(Protocol):
    """A driver whose arm's geometry is known."""

    def geometry(self) -> Geometry:
        """Return the geometry with the arm's present tool; raises MotionError if the arm does not answer."""
        ...


def nearest_limit(joints_rad: Array, low_rad: Array, high_rad: Array) -> Nearest:
    """Return which of the joints (J,) is nearest to its bounds (J,)."""
    margins = np.minimum(joints_rad - low_rad, high_rad - joints_rad)
    index = int(margins.argmin())
    return Nearest(index + 1, float(np.degrees(margins[index])))


def follow_line(forward: Forward, joints_rad: Array, goal: Array, low_rad: Array, high_rad: Array) -> Array:
    """Return the joints (J,) at the end of the straight way to a pose.

    Args:
        joints_rad: (J,) at its beginning.
        goal: (4, 4) the end effector's pose.
        low_rad, high_rad: (J,) the joints' limits.

    Raises:
        MotionError: if the goal is out of reach, or the way leads beyond a joint's limit, which it names.
    """
    start, _ = forward(joints_rad)
    here = ArmState(start[:3, 3], rotations.from_matrix(start[:3, :3]))
    poses = list(straight_way(here, goal[:3, 3], rotations.from_matrix(goal[:3, :3]), STEP_M, STEP_RAD))
    joints = np.array(joints_rad, float)
    for number, pose in enumerate(poses, 1):
        part = number / len(poses)
        joints = _follow(forward, joints, pose_matrix(*pose), part)
        _check_limits(joints, low_rad + JOINT_MARGIN_RAD, high_rad - JOINT_MARGIN_RAD, part)
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
