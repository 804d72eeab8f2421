"""The kinematics of an arm whose joints follow one another: where each is, and the hand's straight ways."""

import numpy as np

from roboprompt_client.arms.driver import pose_matrix
from roboprompt_client.arms.geometry import Nearest, follow_line, nearest_limit
from roboprompt_client.errors import MotionError
from roboprompt_client.types.arrays import Array


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
