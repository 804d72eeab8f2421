"""Where an arm's joints are, whether it can follow a straight line within their limits, and its joints at the end."""

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
    """A driver that may know its arm's geometry."""

    def geometry(self) -> Geometry | None:
        """Return the geometry with the arm's present tool, if known; raises MotionError if the arm does not answer."""
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


class Chain:
    """A `Geometry` of J revolute joints.

    Args:
        links: (J + 1, 4, 4) the frame of each joint at 0 rad in the frame of the joint before, of the first in the
            base's; at last that of the flange.
        axes: (J, 3) unit vectors about which the joints turn, in their own frames.
        low_rad, high_rad: (J,) limits of the joints; infinite for one that turns without end.
        ready_rad: (J,) joints from which other poses are reached.
        hand: (4, 4) pose of the hand in the flange's frame.
    """

    def __init__(
        self, links: Array, axes: Array, low_rad: Array, high_rad: Array, ready_rad: Array, hand: Array | None = None
    ) -> None:
        self._links, self._axes, self._hand = links, axes, np.eye(4) if hand is None else hand
        self.low_rad, self.high_rad, self.ready_rad = low_rad, high_rad, ready_rad
        self._across = np.cross(np.eye(3)[None], axes[:, None])  # (J, 3, 3) of the vector product with each axis
        self._across_twice = self._across @ self._across

    @property
    def num_joints(self) -> int:
        return len(self._axes)

    def skeleton(self, joints_rad: Array) -> Array:
        """Return (J + 2, 3) positions of base, joints and flange in the base frame, to be drawn as lines."""
        return self._frames(joints_rad)[:, :3, 3]

    def flange(self, joints_rad: Array) -> tuple[Array, Array]:
        """Return the flange's pose (4, 4) in the base frame, and the Jacobian (6, J) of its velocities there."""
        frames = self._frames(joints_rad)
        axes = np.einsum("jab,jb->ja", frames[1:-1, :3, :3], self._axes)
        return frames[-1], np.concatenate([np.cross(axes, frames[-1, :3, 3] - frames[1:-1, :3, 3]), axes], axis=1).T

    def hand(self, joints_rad: Array) -> Array:
        """Return the hand's pose (4, 4) in the base frame."""
        pose: Array = self._frames(joints_rad)[-1] @ self._hand
        return pose

    def way(self, joints_rad: Array, position_m: Array, quaternion_xyzw: Array) -> Array:
        if len(joints_rad) != self.num_joints:
            raise MotionError(f"the arm reports {len(joints_rad)} joints, its geometry has {self.num_joints}")
        goal = self.to_flange(pose_matrix(position_m, quaternion_xyzw))
        return follow_line(self.flange, joints_rad, goal, self.low_rad, self.high_rad)

    def to_flange(self, hand: Array) -> Array:
        """Return the flange's pose (4, 4) that puts the hand at a pose (4, 4)."""
        pose: Array = hand @ np.linalg.inv(self._hand)
        return pose

    def nearest_limit(self, joints_rad: Array) -> Nearest:
        return nearest_limit(joints_rad, self.low_rad, self.high_rad)

    def _frames(self, joints_rad: Array) -> Array:
        """Return (J + 2, 4, 4) poses of base, joints and flange in the base frame."""
        sin, cos = np.sin(joints_rad)[:, None, None], np.cos(joints_rad)[:, None, None]
        moved = self._links.copy()  # each joint's frame as it is turned (Rodrigues)
        moved[:-1, :3, :3] @= np.eye(3) + sin * self._across + (1 - cos) * self._across_twice
        frames = [np.eye(4)]
        for link in moved:
            frames.append(frames[-1] @ link)
        return np.array(frames)
