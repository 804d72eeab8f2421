"""Random errors of a pose estimator (paper, section V "Robustness to pose estimation error")."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from roboprompt_client.types.poses import ObjectPose

# FoundationPose's average errors on the paper's cubes
MEAN_ERROR_M = 0.0168
MEAN_ERROR_RAD = math.radians(4.61)
MEAN_LENGTH = 2 * math.sqrt(2 / math.pi)  # of a vector of three standard normal numbers


def disturbed(
    poses: Iterable[ObjectPose], random: np.random.Generator, *, mean_error_m: float, mean_error_rad: float
) -> tuple[ObjectPose, ...]:
    """The poses with Gaussian errors of the given average sizes, every axis alike.

    The same draws point the same way whatever the sizes. A pose without rotation keeps none.
    """
    return tuple(_disturb(pose, random, mean_error_m, mean_error_rad) for pose in poses)


def _disturb(pose: ObjectPose, random: np.random.Generator, mean_error_m: float, mean_error_rad: float) -> ObjectPose:
    shift, turn = random.standard_normal((2, 3)) / MEAN_LENGTH
    quaternion = pose.quaternion_xyzw
    if quaternion is not None:
        quaternion = (Rotation.from_rotvec(turn * mean_error_rad) * Rotation.from_quat(quaternion)).as_quat()
    return replace(pose, position_m=pose.position_m + shift * mean_error_m, quaternion_xyzw=quaternion)
