"""The geometry of Universal Robots' e-Series arms: forward kinematics and joint limits, in the controller's base frame.

Geometry: Universal Robots, "DH parameters for calculations of kinematics and dynamics" (Denavit-Hartenberg, the
standard convention). A delivered arm's calibration differs from it by up to a few millimeters.
"""

import numpy as np

from roboprompt_client.arms.geometry import Chain
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array

# a of links 2 and 3; d of links 1, 4, 5 and 6: all other lengths are 0
_LENGTHS_M = {
    "ur3e": ((-0.24355, -0.2132), (0.15185, 0.13105, 0.08535, 0.0921)),
    "ur5e": ((-0.425, -0.3922), (0.1625, 0.1333, 0.0997, 0.0996)),
    "ur10e": ((-0.6127, -0.57155), (0.1807, 0.17415, 0.11985, 0.11655)),
    "ur16e": ((-0.4784, -0.36), (0.1807, 0.17415, 0.11985, 0.11655)),
}
MODELS = tuple(_LENGTHS_M)
_ALPHA_RAD = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
_LIMITS_RAD = np.array([2 * np.pi, 2 * np.pi, np.pi, 2 * np.pi, 2 * np.pi, 2 * np.pi])
# Before the base along +x; the hand points down
READY_RAD = (np.pi, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0)
GRIPPER_M = 0.163  # a Robotiq 2F-85's fingertips from the flange, as its maker sets the tool center point


def checked_model(model: str) -> str:
    """Return the model; raises InvalidInputError if it is none of `MODELS`."""
    if model not in _LENGTHS_M:
        raise InvalidInputError("model", f"is {model!r:.40}", ", ".join(MODELS))
    return model


class URGeometry(Chain):
    """The geometry of an e-Series arm.

    Args:
        model: one of `MODELS`.
        flange_to_tip: (4, 4) the tip's pose in the flange's frame; None: a Robotiq 2F-85's.

    Raises:
        InvalidInputError: for another model.
    """

    def __init__(self, model: str, flange_to_tip: Array | None = None) -> None:
        (a2_m, a3_m), (d1_m, d4_m, d5_m, d6_m) = _LENGTHS_M[checked_model(model)]
        a_m, d_m = (0.0, a2_m, a3_m, 0.0, 0.0, 0.0), (d1_m, 0.0, 0.0, d4_m, d5_m, d6_m)
        links = np.array([np.eye(4), *map(_link, a_m, d_m, _ALPHA_RAD)])
        tip = _gripper() if flange_to_tip is None else flange_to_tip
        super().__init__(links, np.tile([0.0, 0.0, 1.0], (6, 1)), -_LIMITS_RAD, _LIMITS_RAD, np.array(READY_RAD), tip)


def _link(a_m: float, d_m: float, alpha_rad: float) -> Array:
    """Return a link's end (4, 4) in the frame of its joint at 0 rad (the standard convention)."""
    cos, sin = np.cos(alpha_rad), np.sin(alpha_rad)
    return np.array([[1, 0, 0, a_m], [0, cos, -sin, 0], [0, sin, cos, d_m], [0, 0, 0, 1]])


def _gripper() -> Array:
    tip = np.eye(4)
    tip[2, 3] = GRIPPER_M
    return tip
