"""The geometry of a Franka arm: forward kinematics, joint limits, and whether it can follow a straight line.

Geometry and limits: Franka Robotics, "Robot and interface specifications" (Denavit-Hartenberg, Craig's convention; the
Panda and the Research 3 share the geometry).
"""

import numpy as np

from roboprompt_client.arms.driver import pose_matrix
from roboprompt_client.arms.geometry import Chain
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
READY_RAD = (0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4)  # the maker's; the hand points down
REACH_M = 0.855  # of the flange from the shoulder
HAND_YAW_RAD, HAND_M = -np.pi / 4, 0.1034  # the Franka Hand on its flange, down to between the fingertips
SHOULDER_M = np.array([0.0, 0.0, 0.333])


def _link(a_m: float, d_m: float, alpha_rad: float) -> Array:
    """Return a joint's frame (4, 4) at 0 rad in the frame of the joint before (Craig's convention)."""
    cos, sin = np.cos(alpha_rad), np.sin(alpha_rad)
    return np.array([[1, 0, 0, a_m], [0, cos, -sin, -d_m * sin], [0, sin, cos, d_m * cos], [0, 0, 0, 1]])


_LINKS = np.array([*map(_link, _A_M, _D_M, _ALPHA_RAD), _link(0.0, _FLANGE_M, 0.0)])


class PandaGeometry(Chain):
    """The geometry of a Franka Panda or Research 3.

    Args:
        model: `panda` or `fr3`, which have different joint limits.
        flange_to_tip: (4, 4) the tip's pose in the flange's frame; None: the Franka Hand's.

    Raises:
        InvalidInputError: for another model.
    """

    def __init__(self, model: str = "fr3", flange_to_tip: Array | None = None) -> None:
        if model not in LIMITS_RAD:
            raise InvalidInputError("model", f"is {model!r:.40}", ", ".join(LIMITS_RAD))
        low, high = map(np.array, LIMITS_RAD[model])
        tip = franka_hand() if flange_to_tip is None else flange_to_tip
        super().__init__(_LINKS, np.tile([0.0, 0.0, 1.0], (len(low), 1)), low, high, np.array(READY_RAD), tip)

    def way(self, joints_rad: Array, position_m: Array, quaternion_xyzw: Array) -> Array:
        goal = self.to_flange(pose_matrix(position_m, quaternion_xyzw))
        away_m = float(np.linalg.norm(goal[:3, 3] - SHOULDER_M))
        if away_m > REACH_M:
            raise MotionError(f"the pose is out of reach: {away_m:.3f} m from the shoulder, at most {REACH_M} m")
        return super().way(joints_rad, position_m, quaternion_xyzw)


def franka_hand() -> Array:
    """Return (4, 4) the pose of the point between the fingertips in the flange's frame."""
    cos, sin = np.cos(HAND_YAW_RAD), np.sin(HAND_YAW_RAD)
    return np.array([[cos, -sin, 0, 0], [sin, cos, 0, 0], [0, 0, 1, HAND_M], [0, 0, 0, 1]])


flange = PandaGeometry().flange  # the same for both models and whatever the hand
