"""Errors of a pose estimator, drawn at random (paper, section V "Robustness to pose estimation error")."""

import math
from collections.abc import Iterable

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import ObjectPose

# FoundationPose's average errors on the paper's cubes
MEAN_ERROR_M = 0.0168
MEAN_ERROR_RAD = math.radians(4.61)
MEAN_LENGTH = 2 * math.sqrt(2 / math.pi)  # of a vector of three standard normal numbers
STREAM = 7  # keeps the draw of an error apart from that of the same seed's scene


def disturbed(poses: Iterable[ObjectPose], scale: float, seed: int) -> tuple[ObjectPose, ...]:
    """The poses with Gaussian errors whose average sizes are `scale` times 1.68 cm and 4.61 degrees.

    Every axis is treated alike. A seed's errors point the same way at every scale, so that scales compare on equal
    terms. A pose without rotation keeps none.
    """
    if scale == 0:
        return tuple(poses)
    random = np.random.default_rng((STREAM, seed))
    return tuple(_disturb(pose, scale, random) for pose in poses)


def _disturb(pose: ObjectPose, scale: float, random: np.random.Generator) -> ObjectPose:
    shift, turn = random.standard_normal((2, 3)) * scale / MEAN_LENGTH
    quaternion = pose.quaternion_xyzw
    if quaternion is not None:
        quaternion = (Rotation.from_rotvec(turn * MEAN_ERROR_RAD) * Rotation.from_quat(quaternion)).as_quat()
    return ObjectPose(pose.name, pose.position_m + shift * MEAN_ERROR_M, quaternion, pose.estimator, pose.cameras)
