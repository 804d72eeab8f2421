"""Arms whose geometry is known by a name, each with a usual hand: Franka's two, and Universal Robots' e-Series.

Franka: Franka Robotics, "Robot and interface specifications" (Denavit-Hartenberg, Craig's convention; the Panda and the
Research 3 share the geometry). UR: Universal Robots, "DH parameters for calculations of kinematics and dynamics"
(Denavit-Hartenberg, the standard convention); a delivered arm's calibration differs by up to a few millimeters.
"""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from roboprompt_client.arms.driver import pose_matrix
from roboprompt_client.arms.geometry import Chain
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.types.arrays import Array

ArmModel = Literal["panda", "fr3", "ur3e", "ur5e", "ur10e", "ur16e"]
TITLES: Mapping[str, str] = {
    "panda": "Franka Panda",
    "fr3": "Franka Research 3",
    "ur3e": "UR3e",
    "ur5e": "UR5e",
    "ur10e": "UR10e",
    "ur16e": "UR16e",
}

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
SHOULDER_M = np.array([0.0, 0.0, 0.333])
HAND_YAW_RAD, HAND_M = -np.pi / 4, 0.1034  # the Franka Hand on its flange, down to between the fingertips
_FRANKA_A_M = (0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088, 0.0)  # the last: the flange
_FRANKA_D_M = (0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0, 0.107)
_FRANKA_ALPHA_RAD = (0.0, -np.pi / 2, np.pi / 2, np.pi / 2, -np.pi / 2, np.pi / 2, np.pi / 2, 0.0)

# a of links 2 and 3; d of links 1, 4, 5 and 6: all other lengths are 0
_UR_LENGTHS_M = {
    "ur3e": ((-0.24355, -0.2132), (0.15185, 0.13105, 0.08535, 0.0921)),
    "ur5e": ((-0.425, -0.3922), (0.1625, 0.1333, 0.0997, 0.0996)),
    "ur10e": ((-0.6127, -0.57155), (0.1807, 0.17415, 0.11985, 0.11655)),
    "ur16e": ((-0.4784, -0.36), (0.1807, 0.17415, 0.11985, 0.11655)),
}
_UR_ALPHA_RAD = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
_UR_LIMITS_RAD = np.array([2 * np.pi, 2 * np.pi, np.pi, 2 * np.pi, 2 * np.pi, 2 * np.pi])
UR_READY_RAD = (np.pi, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0)  # before the base along +x, pointing down
UR_GRIPPER_M = 0.163  # a Robotiq 2F-85's fingertips from the flange, as its maker sets the tool center point


def named_geometry(model: ArmModel) -> Chain:
    """Return the geometry of a Franka with a Franka Hand, or of a Universal Robots arm with a Robotiq 2F-85."""
    return PandaGeometry(model) if model in LIMITS_RAD else URGeometry(model)


class PandaGeometry(Chain):
    """The geometry of a Franka Panda or Research 3, which have different joint limits.

    Args:
        model: `panda` or `fr3`.
        flange_to_tip: (4, 4) the tip's pose in the flange's frame; None: the Franka Hand's.

    Raises:
        InvalidInputError: for another model.
    """

    def __init__(self, model: str = "fr3", flange_to_tip: Array | None = None) -> None:
        low, high = map(np.array, LIMITS_RAD[checked_model(model, LIMITS_RAD)])
        links = np.array([*map(_craig, _FRANKA_A_M, _FRANKA_D_M, _FRANKA_ALPHA_RAD)])
        super().__init__(
            links, low, high, np.array(READY_RAD), franka_hand() if flange_to_tip is None else flange_to_tip
        )

    def way(self, joints_rad: Array, position_m: Array, quaternion_xyzw: Array) -> Array:
        goal = self.to_flange(pose_matrix(position_m, quaternion_xyzw))
        away_m = float(np.linalg.norm(goal[:3, 3] - SHOULDER_M))
        if away_m > REACH_M:
            raise MotionError(f"the pose is out of reach: {away_m:.3f} m from the shoulder, at most {REACH_M} m")
        return super().way(joints_rad, position_m, quaternion_xyzw)


class URGeometry(Chain):
    """The geometry of an e-Series arm, in the controller's base frame.

    Args:
        model: `ur3e`, `ur5e`, `ur10e` or `ur16e`.
        flange_to_tip: (4, 4) the tip's pose in the flange's frame; None: a Robotiq 2F-85's.

    Raises:
        InvalidInputError: for another model.
    """

    def __init__(self, model: str, flange_to_tip: Array | None = None) -> None:
        (a2_m, a3_m), (d1_m, d4_m, d5_m, d6_m) = _UR_LENGTHS_M[checked_model(model, _UR_LENGTHS_M)]
        a_m, d_m = (0.0, a2_m, a3_m, 0.0, 0.0, 0.0), (d1_m, 0.0, 0.0, d4_m, d5_m, d6_m)
        links = np.array([np.eye(4), *map(_standard, a_m, d_m, _UR_ALPHA_RAD)])
        tip = pose_matrix(np.array([0.0, 0.0, UR_GRIPPER_M]), np.array([0.0, 0.0, 0.0, 1.0]))
        tip = tip if flange_to_tip is None else flange_to_tip
        super().__init__(links, -_UR_LIMITS_RAD, _UR_LIMITS_RAD, np.array(UR_READY_RAD), tip)


def checked_model(model: str, known: Mapping[str, object] = _UR_LENGTHS_M) -> str:
    """Return the model; raises InvalidInputError if it is none of the known ones."""
    if model not in known:
        raise InvalidInputError("model", f"is {model!r:.40}", ", ".join(known))
    return model


def franka_hand() -> Array:
    """Return (4, 4) the pose of the point between the fingertips in the flange's frame."""
    cos, sin = np.cos(HAND_YAW_RAD), np.sin(HAND_YAW_RAD)
    return np.array([[cos, -sin, 0, 0], [sin, cos, 0, 0], [0, 0, 1, HAND_M], [0, 0, 0, 1]])


def _craig(a_m: float, d_m: float, alpha_rad: float) -> Array:
    """Return a joint's frame (4, 4) at 0 rad in the frame of the joint before."""
    cos, sin = np.cos(alpha_rad), np.sin(alpha_rad)
    return np.array([[1, 0, 0, a_m], [0, cos, -sin, -d_m * sin], [0, sin, cos, d_m * cos], [0, 0, 0, 1]])


def _standard(a_m: float, d_m: float, alpha_rad: float) -> Array:
    """Return a link's end (4, 4) in the frame of its joint at 0 rad."""
    cos, sin = np.cos(alpha_rad), np.sin(alpha_rad)
    return np.array([[1, 0, 0, a_m], [0, cos, -sin, 0], [0, sin, cos, d_m], [0, 0, 0, 1]])


flange = PandaGeometry().flange  # the same for both Frankas and whatever the hand
