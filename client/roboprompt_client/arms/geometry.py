"""Where an arm's joints are, whether it can follow a straight line within their limits, and its joints at the end."""

from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from roboprompt_client.arms.driver import ArmState, pose_matrix, straight_way
from roboprompt_client.errors import MotionError
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array

JOINT_MARGIN_RAD = 0.02  # the arm's own reflex comes at the limit
STEP_M, STEP_RAD = 0.01, 0.05
POSE_TOLERANCE = 1e-4  # meters and radians
DAMPING, MAX_ITERATIONS = 0.02, 60
# The vector product with the z axis, about which every joint turns in its own frame
ACROSS = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


class Nearest(NamedTuple):
    """The joint nearest to its limit, counted from 1, and the angle left; below 0: beyond the limit."""

    joint: int
    margin_deg: float


class Chain:
    """The kinematics of J revolute joints, each of which turns about the z axis of its frame.

    Args:
        links: (J + 1, 4, 4) the frame of each joint at 0 rad in the frame of the joint before, of the first in the
            base's; at last that of the flange.
        low_rad, high_rad: (J,) limits of the joints.
        ready_rad: (J,) joints from which other poses are reached.
        hand: (4, 4) pose of the hand in the flange's frame.
    """

    def __init__(self, links: Array, low_rad: Array, high_rad: Array, ready_rad: Array, hand: Array) -> None:
        self._links, self._hand = links, hand
        self.low_rad, self.high_rad, self.ready_rad = low_rad, high_rad, ready_rad

    @property
    def num_joints(self) -> int:
        return len(self.low_rad)

    def skeleton(self, joints_rad: Array) -> Array:
        """Return (J + 2, 3) positions of base, joints and flange in the base frame, to be drawn as lines."""
        return self._frames(joints_rad)[:, :3, 3]

    def flange(self, joints_rad: Array) -> tuple[Array, Array]:
        """Return the flange's pose (4, 4) in the base frame, and the Jacobian (6, J) of its velocities there."""
        frames = self._frames(joints_rad)
        axes = frames[1:-1, :3, 2]
        return frames[-1], np.concatenate([np.cross(axes, frames[-1, :3, 3] - frames[1:-1, :3, 3]), axes], axis=1).T

    def hand(self, joints_rad: Array) -> Array:
        """Return the hand's pose (4, 4) in the base frame."""
        pose: Array = self._frames(joints_rad)[-1] @ self._hand
        return pose

    def way(self, joints_rad: Array, position_m: Array, quaternion_xyzw: Array) -> Array:
        """Return the joints (J,) at the end of the straight way from joints (J,) to a pose of the hand, base frame.

        Raises:
            MotionError: if the pose is out of reach, or the way leads beyond a joint's limit, which it names.
        """
        if len(joints_rad) != self.num_joints:
            raise MotionError(f"the arm reports {len(joints_rad)} joints, its geometry has {self.num_joints}")
        start, _ = self.flange(joints_rad)
        goal = self.to_flange(pose_matrix(position_m, quaternion_xyzw))
        here = ArmState(start[:3, 3], rotations.from_matrix(start[:3, :3]))
        poses = list(straight_way(here, goal[:3, 3], rotations.from_matrix(goal[:3, :3]), STEP_M, STEP_RAD))
        joints = np.array(joints_rad, float)
        for number, pose in enumerate(poses, 1):
            joints = self._follow(joints, pose_matrix(*pose), number / len(poses))
        return joints

    def to_flange(self, hand: Array) -> Array:
        """Return the flange's pose (4, 4) that puts the hand at a pose (4, 4)."""
        pose: Array = hand @ np.linalg.inv(self._hand)
        return pose

    def nearest_limit(self, joints_rad: Array) -> Nearest:
        """Return which of the joints (J,) is nearest to its limit."""
        margins = np.minimum(joints_rad - self.low_rad, self.high_rad - joints_rad)
        index = int(margins.argmin())
        return Nearest(index + 1, float(np.degrees(margins[index])))

    def _follow(self, joints: Array, goal: Array, part: float) -> Array:
        """Return joints (J,) near `joints` that put the flange at a pose (4, 4), which lies at this part of the way."""
        for _ in range(MAX_ITERATIONS):
            here, jacobian = self.flange(joints)
            turn = rotations.to_rotation_vector(rotations.from_matrix(goal[:3, :3] @ here[:3, :3].T))
            error = np.concatenate([goal[:3, 3] - here[:3, 3], turn])
            if np.abs(error).max() < POSE_TOLERANCE:
                self._check_limits(joints, part)
                return joints
            joints = joints + jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + DAMPING**2 * np.eye(6), error)
        raise MotionError(f"the pose is out of reach: the straight way to it ends after {100 * part:.0f} %")

    def _check_limits(self, joints_rad: Array, part: float) -> None:
        low_rad, high_rad = self.low_rad + JOINT_MARGIN_RAD, self.high_rad - JOINT_MARGIN_RAD
        for number, (angle, low, high) in enumerate(zip(joints_rad, low_rad, high_rad, strict=True), 1):
            if not low <= angle <= high:
                bound, where = f"{low:.3f} to {high:.3f} rad", f"after {100 * part:.0f} % of the way"
                raise MotionError(f"joint {number} would come to {angle:.3f} rad {where} (allowed: {bound})")

    def _frames(self, joints_rad: Array) -> Array:
        """Return (J + 2, 4, 4) poses of base, joints and flange in the base frame."""
        sin, cos = np.sin(joints_rad)[:, None, None], np.cos(joints_rad)[:, None, None]
        moved = self._links.copy()  # each joint's frame as it is turned (Rodrigues)
        moved[:-1, :3, :3] @= np.eye(3) + sin * ACROSS + (1 - cos) * (ACROSS @ ACROSS)
        frames = [np.eye(4)]
        for link in moved:
            frames.append(frames[-1] @ link)
        return np.array(frames)


@runtime_checkable
class KnowsItsJoints(Protocol):
    """A driver that may know its arm's geometry."""

    def geometry(self) -> Chain | None:
        """Return the geometry with the arm's present tool, if known; raises MotionError if the arm does not answer."""
