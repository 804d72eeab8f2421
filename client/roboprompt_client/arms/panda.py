"""Whether a Franka arm gets from where it is to a pose, in a straight line and within its joints' limits.

Geometry and limits: Franka Robotics, "Robot and interface specifications" (Denavit-Hartenberg, Craig's convention; the
Panda and the Research 3 share the geometry).
"""

from dataclasses import dataclass

import numpy as np

from roboprompt_client.arms.driver import pose_matrix
from roboprompt_client.arms.geometry import Nearest, follow_line, nearest_limit
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.types.arrays import Array

_A_M = (0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088)
_D_M = (0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0)
_ALPHA_RAD = (0.0, -np.pi / 2, np.pi / 2, np.pi / 2, -np.pi / 2, np.pi / 2, np.pi / 2)
_FLANGE_M = 0.107
LIMITS_RAD = {
    "panda": (
        (-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973),
        (2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973),
    ),
    "fr3": (
        (-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159),
        (2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159),
    ),
}
READY_RAD = (0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4)
REACH_M = 0.855  # of the flange from the shoulder
HAND_YAW_RAD, HAND_M = -np.pi / 4, 0.1034  # the Franka Hand on its flange, down to between the fingertips
SHOULDER_M = np.array([0.0, 0.0, 0.333])


def flange(joints_rad: Array) -> tuple[Array, Array]:
    """The flange in the base frame (4, 4), and the Jacobian (6, 7) of its linear and angular velocity."""
    frames = _frames(joints_rad)
    axes, arms = frames[1:-1, :3, 2], frames[-1, :3, 3] - frames[1:-1, :3, 3]
    return frames[-1], np.concatenate([np.cross(axes, arms), axes], axis=1).T


def skeleton(joints_rad: Array) -> Array:
    """(9, 3) base, the seven joints and the flange in the base frame: the arm as lines from point to point."""
    return _frames(joints_rad)[:, :3, 3]


def _frames(joints_rad: Array) -> Array:
    """(9, 4, 4) of the base, the seven joints and the flange, in the base frame."""
    frames = [np.eye(4)]
    for a, d, alpha, angle in zip(_A_M, _D_M, _ALPHA_RAD, joints_rad, strict=True):
        frames.append(frames[-1] @ _link(a, d, alpha, float(angle)))
    return np.array([*frames, frames[-1] @ _link(0.0, _FLANGE_M, 0.0, 0.0)])


def _link(a_m: float, d_m: float, alpha_rad: float, angle_rad: float) -> Array:
    """One joint's frame in the one before (Craig's convention)."""
    ca, sa, ct, st = np.cos(alpha_rad), np.sin(alpha_rad), np.cos(angle_rad), np.sin(angle_rad)
    return np.array(
        [
            [ct, -st, 0.0, a_m],
            [st * ca, ct * ca, -sa, -d_m * sa],
            [st * sa, ct * sa, ca, d_m * ca],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


@dataclass(frozen=True, eq=False)
class PandaGeometry:
    """A Franka Panda's or Research 3's.

    Args:
        model: `panda` or `fr3`: whose joint limits hold.
        flange_to_tip: (4, 4) tip to flange; None: the Franka Hand's.

    Raises:
        InvalidInputError: for another model.
    """

    model: str = "fr3"
    flange_to_tip: Array | None = None

    def __post_init__(self) -> None:
        if self.model not in LIMITS_RAD:
            raise InvalidInputError("model", f"is {self.model!r:.40}", ", ".join(LIMITS_RAD))

    def way(self, joints_rad: Array, position_m: Array, quaternion_xyzw: Array) -> Array:
        tip = franka_hand() if self.flange_to_tip is None else self.flange_to_tip
        goal = pose_matrix(position_m, quaternion_xyzw) @ np.linalg.inv(tip)
        away_m = float(np.linalg.norm(goal[:3, 3] - SHOULDER_M))
        if away_m > REACH_M:
            raise MotionError(f"the pose is out of reach: {away_m:.3f} m from the shoulder, at most {REACH_M} m")
        return follow_line(flange, joints_rad, goal, *self._limits_rad)

    def nearest_limit(self, joints_rad: Array) -> Nearest:
        return nearest_limit(joints_rad, *self._limits_rad)

    @property
    def _limits_rad(self) -> tuple[Array, Array]:
        low, high = LIMITS_RAD[self.model]
        return np.array(low), np.array(high)

    @property
    def ready_rad(self) -> Array:
        """(7,) the maker's ready pose, the hand pointing down."""
        return np.array(READY_RAD)


def franka_hand() -> Array:
    """(4, 4) the point between the fingertips to the flange."""
    cos, sin = np.cos(HAND_YAW_RAD), np.sin(HAND_YAW_RAD)
    return np.array([[cos, -sin, 0, 0], [sin, cos, 0, 0], [0, 0, 1, HAND_M], [0, 0, 0, 1]])
